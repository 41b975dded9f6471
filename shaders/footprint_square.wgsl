// Footprint: a square that faces the picture. A pixel is covered where its middle lies inside:
// center - size/2 < middle <= center + size/2 on both axes (never none, as size >= 1).

const VERTICES_PER_SPLAT = 4u;

struct Varyings {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(flat) color: vec4<f32>,
}

fn footprint_vertex(footprint: Footprint, corner: u32, color: vec4<f32>) -> Varyings {
    // The covered pixels are a rectangle of whole pixels: drawn as such, the result does not hang
    // on how a rasteriser snaps vertices.
    let side = vec2(f32(corner & 1u), f32(corner >> 1u)) - 0.5;
    let px = floor(footprint.center_px + side * footprint.size_px + 0.5);
    return Varyings(clip_from_px(px, footprint.depth), color);
}

fn nothing() -> Varyings {
    return Varyings(clip_nowhere(), vec4(0.0));
}

@fragment
fn fragment(in: Varyings) -> @location(0) vec4<f32> {
    return in.color;
}
