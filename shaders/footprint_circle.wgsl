// Footprint: a circle that faces the picture. A pixel is covered where its middle is at most
// size/2 from the centre, and where it holds the centre: so a splat never falls between pixels.

const VERTICES_PER_SPLAT = 4u;

struct Varyings {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(flat) color: vec4<f32>,
    // Centre in pixels; square of the radius.
    @location(1) @interpolate(flat) circle: vec3<f32>,
}

fn footprint_vertex(footprint: Footprint, corner: u32, color: vec4<f32>) -> Varyings {
    // The whole pixels of the square around it; the fragment stage cuts the corners off.
    let side = vec2(f32(corner & 1u), f32(corner >> 1u)) - 0.5;
    let px = floor(footprint.center_px + side * footprint.size_px + 0.5);
    let radius_px = 0.5 * footprint.size_px;
    let circle = vec3(footprint.center_px, radius_px * radius_px);
    return Varyings(clip_from_px(px, footprint.depth), color, circle);
}

fn nothing() -> Varyings {
    return Varyings(clip_nowhere(), vec4(0.0), vec3(0.0));
}

@fragment
fn fragment(in: Varyings) -> @location(0) vec4<f32> {
    let from_center = in.clip.xy - in.circle.xy;
    let holds_center = all(floor(in.clip.xy) == floor(in.circle.xy));
    if dot(from_center, from_center) > in.circle.z && !holds_center {
        discard;
    }
    return in.color;
}
