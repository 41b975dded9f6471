// Fragments: those that are hit, at the splat's depth.

@fragment
fn fragment(in: Varyings) -> @location(0) vec4<f32> {
    if !hit_of(in).covered {
        discard;
    }
    return in.color;
}
