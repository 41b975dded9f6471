// Fragments: those that are hit, each at its own depth.

struct Fragment {
    @location(0) color: vec4<f32>,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn fragment(in: Varyings) -> Fragment {
    let hit = hit_of(in);
    if !hit.covered {
        discard;
    }
    return Fragment(in.color, hit.depth);
}
