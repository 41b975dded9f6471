// Colour: one for the whole node (its level, or a constant).

fn splat_color(node: Node, record: Record, position: vec3<u32>) -> vec4<f32> {
    return vec4(unpack4x8unorm(node.color).rgb, 1.0);
}
