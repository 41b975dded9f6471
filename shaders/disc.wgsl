// A disc in space, as half axes.

fn disc_across(normal: vec3<f32>, radius: f32) -> mat2x3<f32> {
    if dot(normal, normal) < 0.5 {
        return mat2x3(vec3(radius, 0.0, 0.0), vec3(0.0, radius, 0.0));
    }
    // The axis that is farthest from the normal gives the best conditioned tangent.
    // (Radner 2018, eqs. 4.3, 4.4)
    let helper = select(vec3(0.0, 1.0, 0.0), vec3(1.0, 0.0, 0.0), abs(normal.x) < 0.6);
    let u = normalize(cross(normal, helper));
    return mat2x3(radius * u, radius * cross(normal, u));
}
