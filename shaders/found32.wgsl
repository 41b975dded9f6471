// What the compute path found on a pixel.

@group(2) @binding(1) var<storage, read> depths: array<u32>;
@group(2) @binding(2) var<storage, read> owners: array<u32>;

// Depth (as bits), owner.
fn found(pixel: u32) -> vec2<u32> {
    return vec2(depths[pixel], owners[pixel]);
}
