// Colour: the record's payload is a class of the LAS specification, 8 bits.

fn splat_color(node: Node, record: Record, position: vec3<u32>) -> vec4<f32> {
    return ramp_color(CLASS_TABLE, read_color(record));
}
