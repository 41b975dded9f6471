// Compute path: offers a point to its one pixel.

fn cover(shape: Shape, owner: u32) {
    let size = 2.0 * camera.half_size_px;
    // Written so that a place that is none is outside.
    if all(shape.center_px >= vec2(0.0)) && all(shape.center_px < size) {
        let at = vec2<u32>(shape.center_px);
        offer(at.y * u32(size.x) + at.x, shape.depth, owner);
    }
}
