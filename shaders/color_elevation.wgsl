// Colour: the height on the elevation ramp; needs no payload.

fn splat_color(node: Node, record: Record, position: vec3<u32>) -> vec4<f32> {
    let t = node.elevation + node.elevation_step * f32(position.z);
    return ramp_color(ELEVATION_RAMP, u32(clamp(t, 0.0, 1.0) * 255.0 + 0.5));
}
