// Raster path of meshes: one instance is a chunk of records, one splat MESH_VERTICES of its vertices.

struct Varyings {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(flat) color: vec4<f32>,
}

fn nothing() -> Varyings {
    return Varyings(clip_nowhere(), vec4(0.0));
}

@vertex
fn vertex(@builtin(vertex_index) vertex: u32, @builtin(instance_index) instance: u32) -> Varyings {
    let chunk = chunks[instance];
    let index = vertex / MESH_VERTICES;
    if index >= chunk.points {
        return nothing();
    }
    let node = nodes[chunk.node];
    let surfel = surfel_at(chunk, node, index);
    let reach_px = vec2(0.5 * surfel.size_px + 1.0);
    if !surfel.visible || !touches_picture(surfel.place.center_px, reach_px) {
        return nothing();
    }
    let color = shaded_color(node, surfel.record, surfel.position, surfel.place.view);
    return Varyings(mesh_place(surfel.place, surfel.size_px, vertex % MESH_VERTICES), color);
}

fn hit_of(in: Varyings) -> Hit {
    return Hit(true, in.clip.z, 0.0);
}
