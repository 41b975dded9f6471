// Size: by the detail that is drawn where the point is. (Radner 2018, algorithm 5)
// Rust twin: client/src/render/tree.rs.

struct TreeNode {
    // A bit per octant: whether the child is drawn; above them, in 24 bits, where the first is.
    children: u32,
    // Distance between neighbouring points, world units.
    spacing: f32,
}

@group(0) @binding(4) var<storage, read> tree: array<TreeNode>;

fn splat_world_size(node: Node, record: Record, position: vec3<u32>) -> f32 {
    let in_cube = position + node.corner;
    var at = tree[node.tree_place];
    for (var bit = node.side_bits; bit > 0u; bit--) {
        let octants = (in_cube >> vec3(bit - 1u)) & vec3(1u);
        let octant = octants.x | octants.y << 1u | octants.z << 2u;
        if (at.children >> octant & 1u) == 0u {
            break;
        }
        let before = countOneBits(at.children & ((1u << octant) - 1u));
        at = tree[(at.children >> 8u) + before];
    }
    return camera.size_factor * at.spacing;
}
