// Footprint: round, facing the picture. A pixel is covered where its middle is at most size/2 from
// the centre, and where it holds the centre: so a splat never falls between pixels. `receded` (of
// the circle, cone or paraboloid) says how far its parts lie behind the centre.

struct Shape {
    center_px: vec2<f32>,
    radius_px: f32,
    // Of the centre, with the depth's bias.
    distance: f32,
    world_radius: f32,
}

fn shape_of(place: Place, size: f32, axes: mat2x3<f32>) -> Shape {
    let radius_px = 0.5 * size;
    return Shape(place.center_px, radius_px, place.view.z + camera.depth_bias, radius_px / place.scale);
}

fn box_of(shape: Shape) -> vec4<f32> {
    // The pixel that holds the centre too.
    let reach = max(shape.radius_px, 0.5);
    return vec4(shape.center_px - reach, shape.center_px + reach);
}

fn hit(shape: Shape, px: vec2<f32>) -> Hit {
    let from_center = px - shape.center_px;
    let squared = dot(from_center, from_center);
    let radius_squared = shape.radius_px * shape.radius_px;
    let holds_center = all(floor(px) == floor(shape.center_px));
    let r_squared = min(squared / radius_squared, 1.0);
    let depth = camera.near / (shape.distance + receded(r_squared) * shape.world_radius);
    return Hit(squared <= radius_squared || holds_center, depth, r_squared);
}
