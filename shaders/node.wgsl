// Nodes: from packed records to view space. The one place that knows the record layout.
// Rust twins: `NodeUniform` and `ChunkEntry` in client/src/render/gpu/layout.rs; packing:
// client/src/render/gpu/pack.rs.
//
// A record is x, y, z relative to the lowest corner of the node's points, each with as few bits as
// the node needs, then COLOR_BITS of colour, NORMAL_BITS of normal and SHAPE_BITS of size and axes
// (constants of the shader's variant); records follow one another without padding, lowest bit
// first. A chunk is CHUNK_POINTS records and starts at a word.

struct Node {
    // View space position of the anchor, world units.
    anchor_view: vec3<f32>,
    // Bits of x, y, z, one byte each, lowest first.
    position_bits: u32,
    // View space displacement per lattice step along x, y and z.
    step_x: vec3<f32>,
    // Colour of the whole node: red, green, blue, alpha from the lowest byte.
    color: u32,
    step_y: vec3<f32>,
    // Place on the elevation ramp (0 to 1) of relative z = 0, and the rise per lattice step.
    elevation: f32,
    step_z: vec3<f32>,
    elevation_step: f32,
    // The lattice point nearest to the eye within the box of the node's points. Differences to
    // it are taken in integers: near the eye nothing is lost, far from it nothing cancels.
    anchor: vec3<u32>,
    // Diameter of its splats, world units, where all have the same; 0 where sizes are in pixels.
    size_world: f32,
    // Lowest corner of its points, lattice units relative to its cube, and bits of the cube's side.
    corner: vec3<u32>,
    side_bits: u32,
    // Its place in the visible tree.
    tree_place: u32,
    // World units of 1 in the records' radii and axes.
    shape_unit: f32,
    padding: vec2<u32>,
}

struct Chunk {
    node: u32,
    first_word: u32,
    points: u32,
}

@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> chunks: array<Chunk>;
@group(1) @binding(0) var<storage, read> words: array<u32>;

// `count` (0 to 32) bits that start `bit` bits after `first_word`.
fn read_bits(first_word: u32, bit: u32, count: u32) -> u32 {
    if count == 0u {
        return 0u;
    }
    let word = first_word + (bit >> 5u);
    let shift = bit & 31u;
    var value = words[word] >> shift;
    if shift + count > 32u {
        value |= words[word + 1u] << (32u - shift);
    }
    return value & (0xffffffffu >> (32u - count));
}

// Where a record is.
struct Record {
    first_word: u32,
    // First bit of the record, and of what follows its position.
    bit: u32,
    payload_bit: u32,
    bits: vec3<u32>,
}

fn record_at(chunk: Chunk, position_bits: u32, index: u32) -> Record {
    let bits = vec3(position_bits, position_bits >> 8u, position_bits >> 16u) & vec3(255u);
    let of_position = bits.x + bits.y + bits.z;
    let bit = index * (of_position + COLOR_BITS + NORMAL_BITS + SHAPE_BITS);
    return Record(chunk.first_word, bit, bit + of_position, bits);
}

// Lattice units relative to the lowest corner of the node's points.
fn read_position(record: Record) -> vec3<u32> {
    let y_at = record.bits.x;
    let z_at = y_at + record.bits.y;
    if z_at + record.bits.z > 64u {
        return vec3(
            read_bits(record.first_word, record.bit, record.bits.x),
            read_bits(record.first_word, record.bit + y_at, record.bits.y),
            read_bits(record.first_word, record.bit + z_at, record.bits.z),
        );
    }
    // All of it is in three words: shifted to where it begins, in two.
    let word = record.first_word + (record.bit >> 5u);
    let shift = record.bit & 31u;
    let middle = words[word + 1u];
    let low = words[word] >> shift | (middle << 1u) << (31u - shift);
    let high = middle >> shift | (words[word + 2u] << 1u) << (31u - shift);
    return vec3(
        extractBits(low, 0u, record.bits.x),
        window(low, high, y_at, record.bits.y),
        window(low, high, z_at, record.bits.z),
    );
}

// `count` bits from bit `at` of two words.
fn window(low: u32, high: u32, at: u32, count: u32) -> u32 {
    let shift = at & 31u;
    let across = low >> shift | (high << 1u) << (31u - shift);
    return extractBits(select(high >> shift, across, at < 32u), 0u, count);
}

fn read_color(record: Record) -> u32 {
    return read_bits(record.first_word, record.payload_bit, COLOR_BITS);
}

fn view_from_record(node: Node, position: vec3<u32>) -> vec3<f32> {
    // Unsigned differences may span 32 bits, so the sign is taken apart.
    let above = vec3<f32>(position - node.anchor);
    let below = vec3<f32>(node.anchor - position);
    let d = select(-below, above, position >= node.anchor);
    return node.anchor_view + d.x * node.step_x + d.y * node.step_y + d.z * node.step_z;
}
