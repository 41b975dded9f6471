// Raster path: one instance is a chunk of records, one splat VERTICES_PER_SPLAT of its vertices.

@vertex
fn vertex(@builtin(vertex_index) vertex: u32, @builtin(instance_index) instance: u32) -> Varyings {
    let chunk = chunks[instance];
    let index = vertex / VERTICES_PER_SPLAT;
    if index >= chunk.points {
        return nothing();
    }
    let node = nodes[chunk.node];
    let surfel = surfel_at(chunk, node, index);
    if !surfel.visible {
        return nothing();
    }
    let shape = shape_of_surfel(node, surfel);
    let box = box_of(shape);
    if !touches_picture(0.5 * (box.xy + box.zw), 0.5 * (box.zw - box.xy)) {
        return nothing();
    }
    let color = shaded_color(node, surfel.record, surfel.position, surfel.place.view);
    return varyings(shape, vertex % VERTICES_PER_SPLAT, color);
}
