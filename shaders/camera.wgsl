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
    // Splat size in pixels: clamp(size_px + size_world_px / w).
    size_px: f32,
    size_world_px: f32,
    smallest_size_px: f32,
    largest_size_px: f32,
    padding: vec2<f32>,
}

@group(0) @binding(0) var<uniform> camera: Camera;

// A splat on the picture.
struct Footprint {
    // Centre in pixels from the upper left corner, y down.
    center_px: vec2<f32>,
    size_px: f32,
    // Reversed: 1 at the near plane, 0 infinitely far away.
    depth: f32,
    visible: bool,
}

fn project(view: vec3<f32>) -> Footprint {
    var footprint: Footprint;
    let depth_distance = view.z + camera.depth_bias;
    // Written so that NaN is invisible.
    footprint.visible = depth_distance >= camera.near;
    let w = select(1.0, view.z, camera.perspective > 0.5);
    let across_px = camera.px_per_world * view.xy / w;
    footprint.center_px = camera.half_size_px + vec2(across_px.x, -across_px.y);
    footprint.size_px =
        clamp(camera.size_px + camera.size_world_px / w, camera.smallest_size_px, camera.largest_size_px);
    footprint.depth = camera.near / depth_distance;
    let reach_px = 0.5 * footprint.size_px + 1.0;
    let outside = abs(footprint.center_px - camera.half_size_px) - reach_px;
    footprint.visible = footprint.visible && all(outside <= camera.half_size_px);
    return footprint;
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
