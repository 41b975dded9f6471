// Raster stage of round splats that face the picture: one triangle each. It costs less to set up than
// the two of a square, which for small splats is all the cost; the fragment stage cuts the corners
// off.

const VERTICES_PER_SPLAT = 3u;

struct Varyings {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(flat) color: vec4<f32>,
    // Centre and radius in pixels.
    @location(1) @interpolate(flat) circle: vec3<f32>,
    // Distance of the centre, radius in world units.
    @location(2) @interpolate(flat) world: vec2<f32>,
}

fn varyings(shape: Shape, corner: u32, color: vec4<f32>) -> Varyings {
    // Its inner circle holds the middles of all covered pixels, that of the one with the centre too
    // (at most sqrt(0.5) away), and a margin for rasterisers that snap vertices.
    let reach_px = max(shape.radius_px, 0.7072) + 0.02;
    let corners = array(vec2(0.0, -2.0), vec2(1.7320508, 1.0), vec2(-1.7320508, 1.0));
    let px = shape.center_px + reach_px * corners[corner];
    // The fragment stage, where parts have a depth of their own, does without this one.
    let clip = clip_from_px(px, camera.near / shape.distance);
    let world = vec2(shape.distance, shape.world_radius);
    return Varyings(clip, color, vec3(shape.center_px, shape.radius_px), world);
}

fn nothing() -> Varyings {
    return Varyings(clip_nowhere(), vec4(0.0), vec3(0.0), vec2(0.0));
}

fn hit_of(in: Varyings) -> Hit {
    return hit(Shape(in.circle.xy, in.circle.z, in.world.x, in.world.y), in.clip.xy);
}

fn world_radius(in: Varyings) -> f32 {
    return in.world.y;
}
