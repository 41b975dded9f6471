// Orientation: the cloud has none, so that splats face the picture.

fn half_axes(node: Node, record: Record, radius: f32) -> mat2x3<f32> {
    return disc_across(vec3(0.0), radius);
}
