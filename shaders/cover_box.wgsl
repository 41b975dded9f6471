// Compute path: offers a splat to all pixels that it covers.

fn cover(shape: Shape, owner: u32) {
    let size = 2.0 * camera.half_size_px;
    let box = box_of(shape);
    // The pixels whose middles lie in the box; written so that a box that is none has no pixels.
    let low = max(floor(box.xy), vec2(0.0));
    let high = min(ceil(box.zw), size);
    if !all(low < high) {
        return;
    }
    let width = u32(size.x);
    let first = vec2<u32>(low);
    let end = vec2<u32>(high);
    for (var y = first.y; y < end.y; y++) {
        for (var x = first.x; x < end.x; x++) {
            let hit = hit(shape, vec2(f32(x), f32(y)) + 0.5);
            if hit.covered {
                offer(y * width + x, hit.depth, owner);
            }
        }
    }
}
