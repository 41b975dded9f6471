// Shading: Phong's illumination by one light. (Radner 2018, 4.5)
// Rust twin, with the constants: client/src/render/settings/shading.rs.

fn shaded_color(node: Node, record: Record, position: vec3<u32>, view: vec3<f32>) -> vec4<f32> {
    let color = splat_color(node, record, position);
    let found = read_normal(record);
    if dot(found, found) < 0.5 {
        return color;
    }
    let to_eye = select(vec3(0.0, 0.0, -1.0), -normalize(view), camera.perspective > 0.5);
    // Scans' normals look to either side.
    let normal = select(-found, found, dot(found, to_eye) >= 0.0);
    let diffuse = max(dot(normal, PHONG_TO_LIGHT), 0.0);
    let highlight = max(dot(reflect(-PHONG_TO_LIGHT, normal), to_eye), 0.0);
    let light = PHONG_AMBIENT + PHONG_DIFFUSE * diffuse;
    let specular = PHONG_SPECULAR * pow(highlight, PHONG_SHININESS);
    return vec4(clamp(color.rgb * light + specular, vec3(0.0), vec3(1.0)), 1.0);
}
