// Footprint: a square that faces the picture. A pixel is covered where its middle lies inside:
// center - size/2 < middle <= center + size/2 on both axes (never none, as size >= 1).

struct Shape {
    // The covered pixels are a rectangle of whole pixels: drawn as such, the result does not hang
    // on how a rasteriser snaps vertices.
    low: vec2<f32>,
    high: vec2<f32>,
    depth: f32,
}

fn shape_of(place: Place, size: f32, axes: mat2x3<f32>) -> Shape {
    let low = floor(place.center_px - 0.5 * size + 0.5);
    let high = floor(place.center_px + 0.5 * size + 0.5);
    return Shape(low, high, place.depth);
}

fn box_of(shape: Shape) -> vec4<f32> {
    return vec4(shape.low, shape.high);
}

fn hit(shape: Shape, px: vec2<f32>) -> Hit {
    return Hit(true, shape.depth, 0.0);
}
