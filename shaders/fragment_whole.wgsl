// Fragments: all that the rasteriser finds, at its depth.

@fragment
fn fragment(in: Varyings) -> @location(0) vec4<f32> {
    return in.color;
}
