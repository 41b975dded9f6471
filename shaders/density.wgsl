// From counts to the heat map: linearly from none to the most of the picture. (D. Schütz 2021, 4.1)

struct Density {
    width: u32,
    pixels: u32,
}

@group(1) @binding(0) var<uniform> density: Density;
@group(1) @binding(1) var<storage, read> depths: array<u32>;
@group(1) @binding(2) var<storage, read> counts: array<u32>;
@group(1) @binding(3) var<storage, read> most: array<u32>;

struct Fragment {
    @location(0) color: vec4<f32>,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn fragment(in: Full) -> Fragment {
    let at = vec2<u32>(in.clip.xy);
    let pixel = at.y * density.width + at.x;
    if counts[pixel] == 0u {
        discard;
    }
    let t = f32(counts[pixel]) / f32(most[0]);
    return Fragment(ramp_color(DENSITY_RAMP, u32(t * 255.0 + 0.5)), bitcast<f32>(depths[pixel]));
}
