// Shapes of surfels.

fn shape_of_surfel(node: Node, surfel: Surfel) -> Shape {
    let radius = 0.5 * surfel.size_px / surfel.place.scale;
    return shape_of(surfel.place, surfel.size_px, half_axes(node, surfel.record, radius));
}
