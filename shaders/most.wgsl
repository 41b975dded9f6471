// The greatest count of the picture.

struct Density {
    width: u32,
    pixels: u32,
}

@group(1) @binding(0) var<uniform> density: Density;
@group(1) @binding(2) var<storage, read> counts: array<u32>;
@group(1) @binding(3) var<storage, read_write> most: array<atomic<u32>>;

@compute @workgroup_size(256)
fn find_most(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) index: u32) {
    let pixel = (group.y * 65535u + group.x) * 256u + index;
    if pixel < density.pixels && counts[pixel] > 0u {
        atomicMax(&most[0], counts[pixel]);
    }
}
