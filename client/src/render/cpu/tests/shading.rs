//! Phong's illumination and eye-dome lighting.

use super::*;
use crate::render::{EyeDome, Shading};

const PHONG: Shading = Shading { phong: true, eye_dome: None };

fn edl(strength: f64, radius_px: f64) -> Shading {
    Shading { phong: false, eye_dome: Some(EyeDome { strength, radius_px }) }
}

fn shaded(shading: Shading, settings: RenderSettings) -> RenderSettings {
    RenderSettings { shading, ..settings }
}

#[test]
fn a_surface_that_faces_the_eye_is_lit_as_computed_by_hand() {
    // n = (0, 0, -1): n·l = 0.8, so the shade is 0.35 + 0.65 * 0.8 = 0.87; r·v = 0.8, so the
    // highlight is 0.15 * 0.8^32 = 0.000119 of white.
    let rgb = [100, 200, 0];
    for normal in [[0.0, -1.0, 0.0], [0.0, 2.5, 0.0]] {
        let surfel = Surfel { rgb, normal, ..Surfel::at(0.0, 0.0, 10.0) };
        for settings in [orthographic([9, 7]), perspective([9, 7])] {
            let settings = shaded(PHONG, with(Splat::Circle, 3.0, settings));
            let picture = draw(&[surfel], &["normal"], &settings);
            assert_eq!(color_at(&picture, 4, 3), [87, 174, 0], "{normal:?}");
            assert_eq!(color_at(&picture, 0, 0), BACKGROUND);
        }
    }
}

#[test]
fn in_perspective_the_side_that_is_seen_counts() {
    // Facing right, and a little away from where the camera looks. On the left of the view its
    // front is seen, and is away from the light; on the right its back, which is in the light.
    let normal = [1.0, 0.25, 0.0];
    let rgb = [100; 3];
    let at = |right: f64| Surfel { rgb, normal, ..Surfel::at(right, 0.0, 10.0) };
    let settings = shaded(PHONG, with(Splat::Circle, 1.0, perspective([21, 21])));
    let colors = [-8.0, 8.0].map(|right| {
        let picture = draw(&[at(right)], &["normal"], &settings);
        let (column, row, _) = drawn(&picture)[0];
        color_at(&picture, column, row)[0]
    });
    // n·l = (0.36 + 0.25 * 0.8) / sqrt(1.0625) = 0.5433 with the back: 35 + 65 * 0.5433 = 70.3.
    assert_eq!(colors, [35, 70]);
    // Without perspective, of both the back is seen.
    let settings = shaded(PHONG, with(Splat::Circle, 1.0, orthographic([21, 21])));
    let picture = draw(&[at(-8.0), at(8.0)], &["normal"], &settings);
    let colors = drawn(&picture).into_iter().map(|d| color_at(&picture, d.0, d.1)[0]);
    assert_eq!(colors.collect::<Vec<_>>(), [70, 70]);
}

#[test]
fn points_without_a_normal_keep_their_colour() {
    for (normal, attributes) in
        [([0.0; 3], &["normal"][..]), ([f32::NAN; 3], &["normal"]), ([0.0, -1.0, 0.0], &[])]
    {
        let surfel = Surfel { normal, ..Surfel::at(0.0, 0.0, 10.0) };
        let settings = shaded(PHONG, with(Splat::Circle, 3.0, orthographic([9, 7])));
        assert_eq!(color_at(&draw(&[surfel], attributes, &settings), 4, 3), surfel.rgb);
    }
}

/// A near and a far half, side by side, each one square.
fn step(near: f64, far: f64) -> [Surfel; 2] {
    let rgb = [200, 100, 50];
    // Both 64 px wide; the near one ends at the middle column's left edge.
    let half = |right: f64, away: f64| Surfel { rgb, ..Surfel::at(right, 0.0, away) };
    [half(-32.5, near), half(31.5, far)]
}

/// The colour of the far half's first column: over that of the near half.
fn shade(picture: &Picture, column: u32) -> f64 {
    f64::from(color_at(picture, column, 10)[0]) / 200.0
}

#[test]
fn a_plane_that_faces_the_camera_is_not_shaded() {
    let many = (-80..80).flat_map(|i| (-40..40).map(move |j| (f64::from(i), f64::from(j))));
    let plane: Vec<_> = many.map(|(x, z)| Surfel::at(0.3 * x, 0.3 * z, 10.0)).collect();
    for settings in [orthographic([21, 11]), perspective([21, 11])] {
        let plain = with(Splat::Square, 3.0, settings);
        let expected = draw(&plane, &[], &plain);
        assert!(expected.coverage() > 0.99);
        let lit = draw(&plane, &[], &shaded(edl(2.0, 1.0), plain));
        assert_eq!(lit, expected);
    }
}

#[test]
fn a_step_darkens_what_is_behind_it() {
    // 1.5 units, pixels: three of the eight neighbours are nearer by 1.5 px / 1 px.
    let expected = (-0.5 * 3.0 * 1.5 / 8.0_f64).exp();
    let settings = with(Splat::Square, 64.0, orthographic([21, 21]));
    let plain = draw(&step(20.0, 21.5), &[], &settings);
    let lit = draw(&step(20.0, 21.5), &[], &shaded(edl(0.5, 1.0), settings));
    assert_eq!([9, 10].map(|column| depth_at(&lit, column, 10)), [20.0, 21.5]);
    assert!((shade(&lit, 10) - expected).abs() < 0.5 / 200.0 + 1e-9);
    for column in [0, 9, 11, 20] {
        assert_eq!(color_at(&lit, column, 10), color_at(&plain, column, 10), "{column}");
    }
    // All channels alike, and no depth changed.
    assert_eq!(
        color_at(&lit, 10, 10),
        [200.0, 100.0, 50.0].map(|c: f64| (c * expected).round() as u8)
    );
    assert_eq!(lit.depth, plain.depth);
}

#[test]
fn a_cliff_is_no_darker_than_the_steepest_slope() {
    let settings = shaded(edl(0.5, 1.0), with(Splat::Square, 64.0, orthographic([21, 21])));
    let expected = (-0.5 * 3.0 * 4.0 / 8.0_f64).exp();
    for far in [24.5, 300.0] {
        let lit = draw(&step(20.0, far), &[], &settings);
        assert!((shade(&lit, 10) - expected).abs() < 0.5 / 200.0 + 1e-9, "{far}");
    }
}

#[test]
fn what_is_beside_nothing_is_not_shaded() {
    let settings = with(Splat::Square, 5.0, orthographic([21, 21]));
    let alone = [Surfel::at(0.0, 0.0, 20.0), Surfel::at(8.5, 8.5, 3.0)];
    let plain = draw(&alone, &[], &settings);
    assert_eq!(draw(&alone, &[], &shaded(edl(5.0, 1.5), settings)), plain);
}

#[test]
fn the_same_step_in_pixels_has_the_same_shade_in_every_projection() {
    let lit = |surfels: &[Surfel], settings| {
        shade(&draw(surfels, &[], &shaded(edl(0.5, 1.0), settings)), 10)
    };
    let square = |settings| with(Splat::Square, 64.0, settings);
    let expected = lit(&step(20.0, 21.5), square(orthographic([21, 21])));
    // In perspective a step of 1.5 px is a ratio: 10.5 px per unit at distance 1.
    for near in [10.5, 200.0] {
        let far = near * (1.5 / 10.5_f64).exp();
        let px = |away: f64| away / 10.5;
        let surfels = step(near, far)
            .map(|s| Surfel { place: s.place * DVec3::new(px(s.place.y), 1.0, 1.0), ..s });
        let found = lit(&surfels, square(perspective([21, 21])));
        assert!((found - expected).abs() <= 1.0 / 200.0, "{found}, {expected} at {near}");
    }
}

#[test]
fn a_slope_has_the_same_shade_at_any_resolution() {
    // One disc that fills the picture, slanted to the right.
    let rgb = [200; 3];
    for is_perspective in [false, true] {
        let surfel = Surfel { rgb, normal: [-0.5, -1.0, 0.25], ..Surfel::at(0.0, 0.0, 100.0) };
        let lit = |side: u32| {
            let settings = if is_perspective {
                perspective([side; 2])
            } else {
                let mut settings = orthographic([side; 2]);
                settings.camera.projection = Projection::Orthographic { height: 40.0 };
                settings
            };
            let settings = with(Splat::Disc, 1024.0, settings);
            let picture = draw(&[surfel], &["normal"], &shaded(edl(2.0, 2.0), settings));
            assert_eq!(picture.coverage(), 1.0);
            f64::from(color_at(&picture, side / 4, side / 2)[0]) / 200.0
        };
        let [one, two, three] = [40, 80, 120].map(lit);
        assert!(one < 0.9, "{one}");
        assert!(
            (one - two).abs() <= 2.0 / 200.0 && (one - three).abs() <= 2.0 / 200.0,
            "{one} {two} {three}"
        );
    }
}

#[test]
fn the_truth_is_lit_as_a_picture_of_its_samples() {
    // A cliff's shadow is as wide as the radius in pixels, whatever the samples.
    let scene = scene(&step(20.0, 26.0), &[]);
    let settings = shaded(edl(0.5, 2.0), with(Splat::Square, 64.0, orthographic([21, 21])));
    let mut truth =
        crate::render::TruthRenderer::new(&settings, &scene.clouds, Default::default(), 4)
            .expect("possible");
    truth.add_node(scene.nodes[0].clone()).expect("a node of the scene");
    let truth = truth.finish().expect("complete").picture;
    let picture = render(&scene, &settings).picture;
    let means = [&truth, &picture]
        .map(|picture| (10..12).map(|column| shade(picture, column)).sum::<f64>() / 2.0);
    assert!((means[0] - means[1]).abs() < 0.1, "{means:?}");
    assert!(shade(&truth, 13) == 1.0 && shade(&picture, 13) == 1.0);
    assert!(means[0] < 0.8, "{means:?}");
}
