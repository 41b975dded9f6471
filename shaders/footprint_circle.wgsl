// Footprint: a circle that faces the picture. A pixel is covered where its middle is at most
// size/2 from the centre, and where it holds the centre: so a splat never falls between pixels.

const VERTICES_PER_SPLAT = 3u;

struct Varyings {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(flat) color: vec4<f32>,
    // Centre in pixels; square of the radius.
    @location(1) @interpolate(flat) circle: vec3<f32>,
}

fn footprint_vertex(footprint: Footprint, corner: u32, color: vec4<f32>) -> Varyings {
    // One triangle around it costs less to set up than the two of a square, which for small splats
    // is all the cost; the fragment stage cuts the corners off. Its inner circle holds the middles
    // of all covered pixels, that of the one with the centre too (at most sqrt(0.5) away), and a
    // margin for rasterisers that snap vertices.
    let radius_px = 0.5 * footprint.size_px;
    let reach_px = max(radius_px, 0.7072) + 0.02;
    let corners = array(vec2(0.0, -2.0), vec2(1.7320508, 1.0), vec2(-1.7320508, 1.0));
    let px = footprint.center_px + reach_px * corners[corner];
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
