// Raster stage of squares: two triangles each.

const VERTICES_PER_SPLAT = 4u;

struct Varyings {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(flat) color: vec4<f32>,
}

fn varyings(shape: Shape, corner: u32, color: vec4<f32>) -> Varyings {
    let px = select(shape.low, shape.high, vec2((corner & 1u) != 0u, corner >= 2u));
    return Varyings(clip_from_px(px, shape.depth), color);
}

fn nothing() -> Varyings {
    return Varyings(clip_nowhere(), vec4(0.0));
}

fn hit_of(in: Varyings) -> Hit {
    return Hit(true, in.clip.z, 0.0);
}
