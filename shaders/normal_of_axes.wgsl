// Normals of records without a normal of their own: across their half axes.

// In view space; zero where the point has none.
fn read_normal(record: Record) -> vec3<f32> {
    let bit = record.payload_bit + COLOR_BITS + NORMAL_BITS;
    let a = unpack2x16float(read_bits(record.first_word, bit, 32u));
    let b = unpack2x16float(read_bits(record.first_word, bit + 32u, 32u));
    let c = unpack2x16float(read_bits(record.first_word, bit + 64u, 32u));
    let across = cross(vec3(a, b.x), vec3(b.y, c));
    let length = length(across);
    return select(vec3(0.0), view_from_world(across / length), length > 0.0);
}
