// Shading: none.

fn shaded_color(node: Node, record: Record, position: vec3<u32>, view: vec3<f32>) -> vec4<f32> {
    return splat_color(node, record, position);
}
