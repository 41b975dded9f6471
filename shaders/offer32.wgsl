// A pixel is two 32-bit numbers, found in two passes: the greatest depth; then, of those who have it,
// the greatest owner. For adapters without atomics of 64 bits.

@group(2) @binding(1) var<storage, read_write> depths: array<atomic<u32>>;
@group(2) @binding(2) var<storage, read_write> owners: array<atomic<u32>>;

fn offer(pixel: u32, depth: f32, owner: u32) {
    // Not negative, so that its bits order as it does.
    let bits = bitcast<u32>(depth);
    if run.pass_index == 0u {
        if bits > atomicLoad(&depths[pixel]) {
            atomicMax(&depths[pixel], bits);
        }
    } else if bits == atomicLoad(&depths[pixel]) {
        atomicMax(&owners[pixel], owner);
    }
}
