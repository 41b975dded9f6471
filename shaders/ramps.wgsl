// Colour ramps of 256 steps, one after the other. Rust twin: client/src/render/ramp.rs.

@group(0) @binding(3) var<storage, read> ramps: array<u32>;

const ELEVATION_RAMP = 0u;
const INTENSITY_RAMP = 256u;
const CLASS_TABLE = 512u;
const DENSITY_RAMP = 768u;

fn ramp_color(ramp: u32, step: u32) -> vec4<f32> {
    return vec4(unpack4x8unorm(ramps[ramp + step]).rgb, 1.0);
}
