// Raster stage of one-pixel points.

const VERTICES_PER_SPLAT = 1u;

struct Varyings {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(flat) color: vec4<f32>,
}

fn varyings(shape: Shape, corner: u32, color: vec4<f32>) -> Varyings {
    // In the middle of its pixel, where no rasteriser can round it into another.
    return Varyings(clip_from_px(floor(shape.center_px) + 0.5, shape.depth), color);
}

fn nothing() -> Varyings {
    return Varyings(clip_nowhere(), vec4(0.0));
}

fn hit_of(in: Varyings) -> Hit {
    return Hit(true, in.clip.z, 0.0);
}
