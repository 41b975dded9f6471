//! Points per pixel.

use super::*;
use crate::render::{ColorMode, Shading, TruthRenderer, ramp::Ramp};

fn counted() -> (Vec<Surfel>, RenderSettings) {
    // Columns 0 to 3 of the middle row hold 0, 1, 2 and 4 points.
    let places = [(1, 1), (2, 2), (3, 4)];
    let surfels = places.into_iter().flat_map(|(column, count)| {
        let right = f64::from(column) - 4.0;
        (0..count).map(move |i| Surfel::at(right + 0.1 * f64::from(i), 0.2, 20.0 - f64::from(i)))
    });
    let settings = RenderSettings { color: ColorMode::Density, ..orthographic([9, 7]) };
    (surfels.collect(), settings)
}

#[test]
fn each_pixel_shows_how_many_points_are_on_it() {
    let (surfels, settings) = counted();
    let frame = render(&scene(&surfels, &[]), &settings);
    let picture = &frame.picture;
    let colors = [0, 1, 2, 3].map(|column| color_at(picture, column, 3));
    let [quarter, half, whole] = [64, 128, 255].map(|step| Ramp::Density.color(step));
    assert_eq!(colors, [BACKGROUND, quarter, half, whole]);
    // The nearest point's.
    assert_eq!([1, 2, 3].map(|column| depth_at(picture, column, 3)), [20.0, 19.0, 17.0]);
    assert_eq!(drawn(picture).len(), 3);
    let told = frame.points_per_pixel.expect("counted");
    assert_eq!(told.bins, [1, 1, 0, 1]);
    assert_eq!((told.largest, told.most_frequent, told.covered_pixels), (4, 1, 3));
    assert!((told.mean - 7.0 / 3.0).abs() < 1e-12);
}

#[test]
fn splats_sizes_and_shading_play_no_part() {
    let (surfels, settings) = counted();
    let expected = render(&scene(&surfels, &["normal"]), &settings);
    let shading: Shading = "phong+edl".parse().expect("a shading");
    for (splat, _) in Splat::ALL {
        let settings = RenderSettings { shading, ..with(splat, 30.0, settings) };
        assert_eq!(render(&scene(&surfels, &["normal"]), &settings), expected, "{splat:?}");
    }
}

#[test]
fn the_truth_counts_pixels_not_samples() {
    let (surfels, settings) = counted();
    let scene = scene(&surfels, &[]);
    let expected = render(&scene, &settings);
    let mut truth =
        TruthRenderer::new(&settings, &scene.clouds, scene.scene().tree(), 4).expect("possible");
    assert_eq!(truth.passes(), 1);
    truth.add_node(scene.nodes[0].clone()).expect("a node of the scene");
    assert_eq!(truth.finish().expect("complete"), expected);
}

#[test]
fn nothing_else_counts_points() {
    let (surfels, settings) = counted();
    let settings = RenderSettings { color: ColorMode::Rgb, ..settings };
    assert_eq!(render(&scene(&surfels, &[]), &settings).points_per_pixel, None);
}
