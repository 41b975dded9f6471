// Orientation: a disc across the normal, facing the picture where there is none.

fn half_axes(node: Node, record: Record, radius: f32) -> mat2x3<f32> {
    return disc_across(read_normal(record), radius);
}
