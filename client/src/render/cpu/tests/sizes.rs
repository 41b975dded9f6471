//! Sizes of splats.

use lodestream_protocol::NodeKey;

use super::*;
use crate::render::{DrawNode, SizeLimits};

/// Two points left and right of the axis, 10 away.
fn two(size: SplatSize) -> RenderSettings {
    RenderSettings { splat: Splat::Square, splat_size: size, ..orthographic([41, 21]) }
}

/// Widths of what is drawn in the middle row of the left and of the right half.
fn widths(picture: &Picture) -> [usize; 2] {
    let row: Vec<_> = drawn(picture).into_iter().filter(|d| d.1 == 10).collect();
    let left = row.iter().filter(|d| d.0 < 20).count();
    [left, row.len() - left]
}

#[test]
fn own_sizes_are_twice_the_radius_or_the_longer_axis() {
    let mut surfels = [Surfel::at(-10.0, 0.0, 10.0), Surfel::at(10.0, 0.0, 10.0)];
    (surfels[0].radius, surfels[1].radius) = (1.5, 3.5);
    surfels[0].axes = [[1.0, 0.0, 0.0], [0.0, 0.0, 2.5]];
    surfels[1].axes = [[4.5, 0.0, 0.0], [0.0, 0.0, 1.0]];
    let settings = two(SplatSize::Own);
    assert_eq!(widths(&draw(&surfels, &["radius"], &settings)), [3, 7]);
    assert_eq!(widths(&draw(&surfels, &["axis_u", "axis_v"], &settings)), [5, 9]);
    // A radius goes before axes.
    assert_eq!(widths(&draw(&surfels, &["axis_u", "axis_v", "radius"], &settings)), [3, 7]);
    // What is no radius is the least size.
    for radius in [f32::NAN, f32::INFINITY, -3.0, 0.0] {
        surfels[0].radius = radius;
        assert_eq!(widths(&draw(&surfels, &["radius"], &settings)), [1, 7], "{radius}");
    }
}

#[test]
fn sizes_stay_between_their_limits() {
    let mut surfels = [Surfel::at(-10.0, 0.0, 10.0), Surfel::at(10.0, 0.0, 10.0)];
    (surfels[0].radius, surfels[1].radius) = (0.25, 100.0);
    let size_limits = SizeLimits { min_px: 3.0, max_px: 7.0 };
    let settings = RenderSettings { size_limits, ..two(SplatSize::Own) };
    assert_eq!(widths(&draw(&surfels, &["radius"], &settings)), [3, 7]);
    let settings = RenderSettings { size_limits, ..two(SplatSize::World(0.5)) };
    assert_eq!(widths(&draw(&surfels, &[], &settings)), [3, 3]);
}

#[test]
fn adaptive_sizes_follow_the_deepest_node_that_is_drawn_where_the_point_is() {
    // The root holds a point in its lower left half and one in its right half. Of its children only
    // one on the right is drawn, and of that one's none: the tree is uneven.
    let points = [(-10.0, -0.0), (10.0, 0.0)].map(|(x, z)| Surfel::at(x, z, 10.0));
    let mut scene = scene(&points, &[]);
    scene.nodes[0].spacing = 9.0;
    let q = scene.nodes[0].points.positions[1];
    let coords = q.map(|c| c >> 31);
    let child = NodeKey::new(1, coords).expect("a child of the root");
    let mut empty = scene.nodes[0].points.as_ref().clone();
    (empty.key, empty.positions, empty.columns) = (child, Vec::new(), Vec::new());
    let node = DrawNode { cloud: 0, key: child, spacing: 3.0, points: Arc::new(empty), part: 0 };
    let picture = |scene: &TestScene, size| render(scene, &two(size)).picture;

    assert_eq!(widths(&picture(&scene, SplatSize::Adaptive(1.0))), [9, 9]);
    scene.nodes.push(node);
    assert_eq!(widths(&picture(&scene, SplatSize::Adaptive(1.0))), [9, 3]);
    assert_eq!(widths(&picture(&scene, SplatSize::Adaptive(2.0)))[1], 6);
    // By the point's own node: the same for both.
    assert_eq!(widths(&picture(&scene, SplatSize::Level(1.0))), [9, 9]);
    // A cloud without sizes of its own is sized by 1.6 times the spacing.
    assert_eq!(widths(&picture(&scene, SplatSize::Own)), [15, 5]);
    // A deeper node of which the parent is not drawn changes nothing.
    let grandchild = NodeKey::new(2, q.map(|c| c >> 30)).expect("a grandchild");
    let mut deeper = scene.nodes[1].clone();
    (deeper.key, deeper.spacing) = (grandchild, 1.0);
    scene.nodes[1] = deeper;
    assert_eq!(widths(&picture(&scene, SplatSize::Adaptive(1.0))), [9, 9]);
}
