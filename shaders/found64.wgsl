// What the compute path found on a pixel.

@group(2) @binding(1) var<storage, read> pixels: array<vec2<u32>>;

// Depth (as bits), owner.
fn found(pixel: u32) -> vec2<u32> {
    return pixels[pixel].yx;
}
