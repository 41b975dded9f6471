// Size: the same for all splats of the node.

fn splat_world_size(node: Node, record: Record, position: vec3<u32>) -> f32 {
    return node.size_world;
}
