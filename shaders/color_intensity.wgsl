// Colour: the record's payload is a step of the intensity ramp, 8 bits.

fn splat_color(node: Node, record: Record, position: vec3<u32>) -> vec4<f32> {
    return ramp_color(INTENSITY_RAMP, read_color(record));
}
