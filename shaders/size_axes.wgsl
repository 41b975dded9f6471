// Size: twice the longer of the record's half axes.

fn splat_world_size(node: Node, record: Record, position: vec3<u32>) -> f32 {
    let axes = read_axes(node, record);
    return 2.0 * sqrt(max(dot(axes.u, axes.u), dot(axes.v, axes.v)));
}
