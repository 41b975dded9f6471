// Footprint: a paraboloid as a mesh of triangles. MESH holds, for each vertex of it, its offset from
// the centre in radii (x right, y down) and how many radii it lies behind the centre.

fn mesh_place(place: Place, size: f32, vertex: u32) -> vec4<f32> {
    // So large that the pixel which holds the centre has its middle inside: 0.7072 px from it at
    // most, in a polygon of eight sides.
    let radius_px = max(0.5 * size, 0.766);
    let offset = MESH[vertex];
    let px = place.center_px + offset.xy * radius_px;
    let distance = place.view.z + offset.z * (0.5 * size / place.scale);
    return clip_from_px(px, depth_at(distance));
}
