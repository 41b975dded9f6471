// Orientation: an ellipse spanned by its half axes, the longer one scaled to the radius; a disc that
// faces the picture where there are none.

fn half_axes(node: Node, record: Record, radius: f32) -> mat2x3<f32> {
    let axes = read_axes(node, record);
    let longest = sqrt(max(dot(axes.u, axes.u), dot(axes.v, axes.v)));
    if longest <= 0.0 {
        return disc_across(vec3(0.0), radius);
    }
    return mat2x3(axes.u * (radius / longest), axes.v * (radius / longest));
}
