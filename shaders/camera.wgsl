// The camera: from view space to pixels. The one place that knows the projection.
// Rust twin: `CameraUniform` in client/src/render/gpu/layout.rs; the same in f64: client/src/render/view.rs.
//
// View space: x right, y up, z = distance along the view direction (positive in front).

struct Camera {
    // Half the picture's width and height.
    half_size_px: vec2<f32>,
    // Pixels per world unit across the view, at w = 1.
    px_per_world: f32,
    // 1: perspective, w is the distance; 0: orthographic, w is 1.
    perspective: f32,
    // Nearest distance that is drawn, plus `depth_bias`; also the numerator of the depth.
    near: f32,
    // 0 in perspective; in an orthographic view it keeps depth finite at the eye's plane.
    depth_bias: f32,
    // Splat size where it is in pixels, else 0.
    size_px: f32,
    smallest_size_px: f32,
    largest_size_px: f32,
    // Times the spacing, for sizes that adapt to it.
    size_factor: f32,
    padding: vec2<f32>,
    // Rotation from world to view space, column by column.
    right_up_ahead_of_x: vec4<f32>,
    right_up_ahead_of_y: vec4<f32>,
    right_up_ahead_of_z: vec4<f32>,
}

@group(0) @binding(0) var<uniform> camera: Camera;

// A splat's place on the picture.
struct Place {
    // Centre in view space.
    view: vec3<f32>,
    // Centre in pixels from the upper left corner, y down.
    center_px: vec2<f32>,
    // Pixels per world unit across the view at its distance.
    scale: f32,
    // Reversed: 1 at the near plane, 0 infinitely far away.
    depth: f32,
    in_front: bool,
}

fn project(view: vec3<f32>) -> Place {
    var place: Place;
    place.view = view;
    let depth_distance = view.z + camera.depth_bias;
    // Written so that NaN is not in front.
    place.in_front = depth_distance >= camera.near;
    let w = select(1.0, view.z, camera.perspective > 0.5);
    let across_px = camera.px_per_world * view.xy / w;
    place.center_px = camera.half_size_px + vec2(across_px.x, -across_px.y);
    place.scale = camera.px_per_world / w;
    place.depth = camera.near / depth_distance;
    return place;
}

// Size in pixels of a splat of `world` units (0 where sizes are in pixels).
fn size_px(place: Place, world: f32) -> f32 {
    return clamp(camera.size_px + world * place.scale, camera.smallest_size_px, camera.largest_size_px);
}

// Whether a splat that reaches so far from its centre touches the picture.
fn touches_picture(center_px: vec2<f32>, reach_px: vec2<f32>) -> bool {
    return all(abs(center_px - camera.half_size_px) - reach_px <= camera.half_size_px);
}

fn depth_at(distance: f32) -> f32 {
    return camera.near / (distance + camera.depth_bias);
}

fn view_from_world(direction: vec3<f32>) -> vec3<f32> {
    return direction.x * camera.right_up_ahead_of_x.xyz + direction.y * camera.right_up_ahead_of_y.xyz
        + direction.z * camera.right_up_ahead_of_z.xyz;
}

// Clip space of a place on the picture. w is 1: the division is done.
fn clip_from_px(px: vec2<f32>, depth: f32) -> vec4<f32> {
    let ndc = px / camera.half_size_px - 1.0;
    return vec4(ndc.x, -ndc.y, depth, 1.0);
}

// A place that is outside of every picture.
fn clip_nowhere() -> vec4<f32> {
    return vec4(2.0, 2.0, 2.0, 1.0);
}
