// Footprint: the pixel that holds the centre. Drawn as a point list.

const VERTICES_PER_SPLAT = 1u;

struct Varyings {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(flat) color: vec4<f32>,
}

fn footprint_vertex(footprint: Footprint, corner: u32, color: vec4<f32>) -> Varyings {
    // In the middle of its pixel, where no rasteriser can round it into another.
    let px = floor(footprint.center_px) + 0.5;
    return Varyings(clip_from_px(px, footprint.depth), color);
}

fn nothing() -> Varyings {
    return Varyings(clip_nowhere(), vec4(0.0));
}

@fragment
fn fragment(in: Varyings) -> @location(0) vec4<f32> {
    return in.color;
}
