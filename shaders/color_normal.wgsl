// Colour: the direction of the normal in world space.

fn splat_color(node: Node, record: Record, position: vec3<u32>) -> vec4<f32> {
    let view = read_normal(record);
    if dot(view, view) < 0.5 {
        return vec4(unpack4x8unorm(node.color).rgb, 1.0);
    }
    // Back to world space: the rotation's transpose.
    let world = vec3(
        dot(view, camera.right_up_ahead_of_x.xyz),
        dot(view, camera.right_up_ahead_of_y.xyz),
        dot(view, camera.right_up_ahead_of_z.xyz),
    );
    return vec4(0.5 * world + 0.5, 1.0);
}
