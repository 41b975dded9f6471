// Raster stage of ellipses in space: the box around each, as two triangles.

const VERTICES_PER_SPLAT = 4u;

struct Varyings {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(flat) color: vec4<f32>,
    @location(1) @interpolate(flat) center_px: vec2<f32>,
    @location(2) @interpolate(flat) axes_px: vec4<f32>,
    // Slopes, then rises.
    @location(3) @interpolate(flat) growth: vec4<f32>,
    // Distance of the centre, radius in world units.
    @location(4) @interpolate(flat) world: vec2<f32>,
}

fn varyings(shape: Shape, corner: u32, color: vec4<f32>) -> Varyings {
    let box = box_of(shape);
    // A margin for rasterisers that snap vertices.
    let low = box.xy - 0.02;
    let high = box.zw + 0.02;
    let px = select(low, high, vec2((corner & 1u) != 0u, corner >= 2u));
    let clip = clip_from_px(px, camera.near / shape.distance);
    let growth = vec4(shape.slopes, shape.rise);
    let world = vec2(shape.distance, shape.world_radius);
    return Varyings(clip, color, shape.center_px, shape.axes_px, growth, world);
}

fn nothing() -> Varyings {
    return Varyings(clip_nowhere(), vec4(0.0), vec2(0.0), vec4(0.0), vec4(0.0), vec2(0.0));
}

fn hit_of(in: Varyings) -> Hit {
    let growth = in.growth;
    return hit(Shape(in.center_px, in.axes_px, growth.xy, growth.zw, in.world.x, in.world.y), in.clip.xy);
}

fn world_radius(in: Varyings) -> f32 {
    return in.world.y;
}
