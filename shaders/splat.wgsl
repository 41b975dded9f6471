// Splats: from a record to a shape on the picture.

struct Hit {
    covered: bool,
    depth: f32,
    // Square of the distance from the centre, in radii; at most 1.
    r_squared: f32,
}

// A point made ready to be drawn.
struct Surfel {
    visible: bool,
    place: Place,
    size_px: f32,
    position: vec3<u32>,
    record: Record,
}

fn surfel_at(chunk: Chunk, node: Node, index: u32) -> Surfel {
    var surfel: Surfel;
    surfel.record = record_at(chunk, node.position_bits, index);
    surfel.position = read_position(surfel.record);
    surfel.place = project(view_from_record(node, surfel.position));
    surfel.visible = surfel.place.in_front;
    surfel.size_px = size_px(surfel.place, splat_world_size(node, surfel.record, surfel.position));
    return surfel;
}
