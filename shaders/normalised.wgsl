// The mean of what was blended: sums of weighted colours over the sums of weights.

@group(0) @binding(0) var sums: texture_2d<f32>;

@fragment
fn fragment(in: Full) -> @location(0) vec4<f32> {
    let sum = textureLoad(sums, vec2<u32>(in.clip.xy), 0);
    if sum.w <= 0.0 {
        discard;
    }
    return vec4(sum.rgb / sum.w, 1.0);
}
