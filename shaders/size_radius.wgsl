// Size: twice the record's own radius, a half-precision float in the node's unit.

fn splat_world_size(node: Node, record: Record, position: vec3<u32>) -> f32 {
    let packed = read_bits(record.first_word, record.payload_bit + COLOR_BITS + NORMAL_BITS, 16u);
    return 2.0 * unpack2x16float(packed).x * node.shape_unit;
}
