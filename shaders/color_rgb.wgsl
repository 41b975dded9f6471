// Colour: the record's payload is red, green, blue, 8 bits each.

fn splat_color(node: Node, record: Record, position: vec3<u32>) -> vec4<f32> {
    return vec4(unpack4x8unorm(read_color(record)).rgb, 1.0);
}
