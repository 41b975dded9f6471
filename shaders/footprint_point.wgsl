// Footprint: the pixel that holds the centre. Drawn as a point list.

struct Shape {
    center_px: vec2<f32>,
    depth: f32,
}

fn shape_of(place: Place, size: f32, axes: mat2x3<f32>) -> Shape {
    return Shape(place.center_px, place.depth);
}

fn box_of(shape: Shape) -> vec4<f32> {
    return vec4(floor(shape.center_px), floor(shape.center_px) + 1.0);
}

fn hit(shape: Shape, px: vec2<f32>) -> Hit {
    return Hit(true, shape.depth, 0.0);
}
