// Fragments: those that are hit, brought forward by the splat's radius, so that those pass the depth
// test that lie within it behind the nearest; weighted by their place on the splat.
// (Botsch et al. 2005)

struct Fragment {
    @location(0) weighted: vec4<f32>,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn fragment(in: Varyings) -> Fragment {
    let hit = hit_of(in);
    if !hit.covered {
        discard;
    }
    let weight = exp(-3.0 * hit.r_squared);
    let distance = max(camera.near / hit.depth - world_radius(in), camera.near);
    // However small the radius: the nearest splat itself passes.
    let depth = max(camera.near / distance, hit.depth);
    return Fragment(vec4(in.color.rgb * weight, weight), depth);
}
