// A pixel is its greatest depth and the number of points that fall on it.

@group(2) @binding(1) var<storage, read_write> depths: array<atomic<u32>>;
@group(2) @binding(2) var<storage, read_write> counts: array<atomic<u32>>;

fn offer(pixel: u32, depth: f32, owner: u32) {
    atomicMax(&depths[pixel], bitcast<u32>(depth));
    atomicAdd(&counts[pixel], 1u);
}
