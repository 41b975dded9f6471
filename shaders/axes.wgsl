// Half axes of records: six half-precision floats in the node's unit, world space.
// Rust twin: `pack_axes` in client/src/render/gpu/pack.rs.

struct Axes {
    u: vec3<f32>,
    v: vec3<f32>,
}

// In view space, world units; zero where the point has none.
fn read_axes(node: Node, record: Record) -> Axes {
    let bit = record.payload_bit + COLOR_BITS + NORMAL_BITS;
    let a = unpack2x16float(read_bits(record.first_word, bit, 32u));
    let b = unpack2x16float(read_bits(record.first_word, bit + 32u, 32u));
    let c = unpack2x16float(read_bits(record.first_word, bit + 64u, 32u));
    return Axes(
        view_from_world(vec3(a, b.x)) * node.shape_unit,
        view_from_world(vec3(b.y, c)) * node.shape_unit,
    );
}
