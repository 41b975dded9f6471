// Orientation: none is needed.

fn half_axes(node: Node, record: Record, radius: f32) -> mat2x3<f32> {
    return mat2x3(vec3(0.0), vec3(0.0));
}
