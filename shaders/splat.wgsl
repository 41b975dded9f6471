// Splats: one instance is a chunk of records, one splat VERTICES_PER_SPLAT of its vertices.

@vertex
fn vertex(@builtin(vertex_index) vertex: u32, @builtin(instance_index) instance: u32) -> Varyings {
    let chunk = chunks[instance];
    let index = vertex / VERTICES_PER_SPLAT;
    if index >= chunk.points {
        return nothing();
    }
    let node = nodes[chunk.node];
    let record = read_record(chunk, node.record_bits, index);
    let footprint = project(view_from_record(node, record.position));
    if !footprint.visible {
        return nothing();
    }
    return footprint_vertex(footprint, vertex % VERTICES_PER_SPLAT, splat_color(node, record));
}
