// A pixel is one 64-bit number: depth above owner.

@group(2) @binding(1) var<storage, read_write> pixels: array<atomic<u64>>;

fn offer(pixel: u32, depth: f32, owner: u32) {
    atomicMax(&pixels[pixel], (u64(bitcast<u32>(depth)) << 32u) | u64(owner));
}
