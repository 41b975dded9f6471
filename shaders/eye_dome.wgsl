// Eye-dome lighting: a pixel is darker the farther it lies behind those around it.
// (Boucheny 2009; the rule: `EyeDome` in client/src/render/settings/shading.rs)

struct EyeDome {
    // Numerator of the depth.
    near: f32,
    // Pixels per world unit across the view, at w = 1.
    px_per_world: f32,
    // 1: steps are of the logarithms of distances; 0: of the distances.
    perspective: f32,
    // -strength / 8 / radius in pixels; steps count up to `steepest` pixels.
    shade: f32,
    steepest: f32,
    padding: f32,
    size_px: vec2<i32>,
    neighbours: array<vec4<i32>, 4>,
}

@group(0) @binding(0) var<uniform> dome: EyeDome;
@group(0) @binding(1) var colors: texture_2d<f32>;
@group(0) @binding(2) var depths: texture_depth_2d;

@fragment
fn fragment(in: Full) -> @location(0) vec4<f32> {
    let at = vec2<i32>(in.clip.xy);
    let color = textureLoad(colors, at, 0);
    let depth = textureLoad(depths, at, 0);
    if depth <= 0.0 {
        return color;
    }
    var sum = 0.0;
    for (var i = 0u; i < 8u; i++) {
        let pair = dome.neighbours[i >> 1u];
        let beside = at + select(pair.xy, pair.zw, (i & 1u) == 1u);
        if any(beside < vec2(0)) || any(beside >= dome.size_px) {
            continue;
        }
        let other = textureLoad(depths, beside, 0);
        if other > depth {
            // Of ratios, not of differences: exact for neighbours that are almost as far.
            let behind = select(
                dome.near / depth - dome.near / other,
                log(other / depth),
                dome.perspective > 0.5,
            );
            sum += min(dome.px_per_world * behind, dome.steepest);
        }
    }
    return vec4(color.rgb * exp(dome.shade * sum), color.a);
}
