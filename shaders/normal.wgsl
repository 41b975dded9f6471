// Normals of records: 12 bits of each octahedral coordinate, world space.
// Rust twin: `pack_normal` in client/src/render/gpu/pack.rs.

// In view space; zero where the point has none.
fn read_normal(record: Record) -> vec3<f32> {
    let packed = read_bits(record.first_word, record.payload_bit + COLOR_BITS, NORMAL_BITS);
    let code = vec2(packed & 4095u, packed >> 12u);
    if code.x == 4095u {
        return vec3(0.0);
    }
    let plane = vec2<f32>(code) / 2047.0 - 1.0;
    let height = 1.0 - abs(plane.x) - abs(plane.y);
    let folded = (1.0 - abs(plane.yx)) * select(vec2(-1.0), vec2(1.0), plane >= vec2(0.0));
    let world = vec3(select(folded, plane, height >= 0.0), height);
    return view_from_world(normalize(world));
}
