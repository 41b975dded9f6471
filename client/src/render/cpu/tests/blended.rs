//! Blended splats.

use super::*;

const BLENDED: [Splat; 3] = [Splat::Blended, Splat::BlendedDisc, Splat::BlendedEllipse];

/// A slanted wall of splats of random colours, and one of a single colour behind it.
fn walls(behind: f64) -> Vec<Surfel> {
    let mut random = crate::render::testing::Random::new(3);
    let mut surfels = Vec::new();
    for (i, j) in (-12..=12).flat_map(|i| (-10..=10).map(move |j| (i, j))) {
        let (right, up) = (f64::from(i) + random.unit(), f64::from(j) + random.unit());
        let away = 60.0 + 0.25 * right;
        let normal = [0.25, -1.0, 0.0];
        let axes = [[1.0, 0.25, 0.0], [0.0, 0.0, 0.5]];
        let rgb = [0; 3].map(|_| (random.next() & 255) as u8);
        surfels.push(Surfel { rgb, normal, axes, ..Surfel::at(right, up, away) });
        let rgb = [255, 0, 255];
        surfels.push(Surfel { rgb, normal, axes, ..Surfel::at(right, up, away + behind) });
    }
    surfels
}

const ALL: [&str; 3] = ["normal", "axis_u", "axis_v"];

#[test]
fn two_splats_are_mixed_by_the_place_of_the_pixel_in_each() {
    // 2 px apart: the pixel of each is at the centre of the one and 2 / 2.5 from that of the other.
    let mut surfels = [Surfel::at(0.0, 0.0, 10.0), Surfel::at(2.0, 0.0, 10.5)];
    (surfels[0].rgb, surfels[1].rgb) = ([200, 0, 50], [0, 100, 50]);
    let weight = (-3.0 * 0.8_f64.powi(2)).exp();
    let mixed = |a: f64, b: f64| ((a + weight * b) / (1.0 + weight)).round() as u8;
    let picture = draw(&surfels, &[], &with(Splat::Blended, 5.0, orthographic([9, 7])));
    assert_eq!(color_at(&picture, 4, 3), [mixed(200.0, 0.0), mixed(0.0, 100.0), 50]);
    assert_eq!(color_at(&picture, 6, 3), [mixed(0.0, 200.0), mixed(100.0, 0.0), 50]);
    // Half way: both alike.
    assert_eq!(color_at(&picture, 5, 3), [100, 50, 50]);
    // The nearer one's distance, where both are.
    assert_eq!([4, 5, 6, 8].map(|x| depth_at(&picture, x, 3)), [10.0, 10.0, 10.0, 10.5]);
    assert_eq!(color_at(&picture, 0, 0), BACKGROUND);
}

#[test]
fn what_is_farther_behind_than_the_radius_does_not_bleed_through() {
    // Radii are 2.5 units.
    for (behind, bleeds) in [(2.4, true), (2.6, false)] {
        let mut surfels = [Surfel::at(0.0, 0.0, 10.0), Surfel::at(0.0, 0.0, 10.0 + behind)];
        surfels[1].rgb = [255; 3];
        for splat in BLENDED {
            let picture = draw(&surfels, &[], &with(splat, 5.0, orthographic([9, 7])));
            let is_first = color_at(&picture, 4, 3) == surfels[0].rgb;
            assert_eq!(is_first, !bleeds, "{splat:?} {behind}");
            assert_eq!(depth_at(&picture, 4, 3), 10.0);
        }
    }
    for splat in BLENDED {
        let settings = with(splat, 4.0, orthographic([21, 17]));
        let alone = draw(&walls(0.0)[..], &ALL, &settings);
        let front: Vec<_> = walls(3.0).into_iter().step_by(2).collect();
        let hidden = draw(&walls(9.0), &ALL, &settings);
        let front = draw(&front, &ALL, &settings);
        assert_eq!(front.coverage(), 1.0);
        // Slanted splats reach a quarter of their radius to the front and the back.
        assert_eq!(hidden, front, "{splat:?}");
        assert_ne!(alone, front, "{splat:?}: what lies in the wall is of it");
    }
}

#[test]
fn equal_colours_stay_equal() {
    for splat in BLENDED {
        let mut surfels = walls(1.0);
        surfels.iter_mut().for_each(|surfel| surfel.rgb = [1, 77, 254]);
        let picture = draw(&surfels, &ALL, &with(splat, 6.0, perspective([40, 30])));
        let drawn = drawn(&picture);
        assert!(drawn.len() > 80, "{}", drawn.len());
        for (column, row, _) in drawn {
            assert_eq!(color_at(&picture, column, row), [1, 77, 254]);
        }
    }
}

#[test]
fn the_order_of_points_and_the_number_of_threads_are_all_the_same() {
    let surfels = walls(0.5);
    let reversed: Vec<_> = surfels.iter().rev().copied().collect();
    for splat in BLENDED {
        let settings = with(splat, 7.0, perspective([80, 60]));
        let expected = draw(&surfels, &ALL, &settings);
        assert_eq!(draw(&reversed, &ALL, &settings), expected, "{splat:?}");
        for threads in [1, 4] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let found = pool.expect("threads").install(|| draw(&surfels, &ALL, &settings));
            assert_eq!(found, expected, "{splat:?} on {threads} threads");
        }
    }
}

#[test]
fn the_nearest_is_of_its_own_surface_however_small_it_is() {
    // A radius far below what f32 can tell at that distance.
    let surfel = Surfel::at(0.0, 0.0, 1000.123);
    let narrow = Projection::Orthographic { height: 1e-5 };
    let mut settings = with(Splat::Blended, 3.0, orthographic([9, 7]));
    settings.camera.projection = narrow;
    let picture = draw(&[surfel], &[], &settings);
    assert_eq!(color_at(&picture, 4, 3), surfel.rgb);
}

#[test]
fn blended_splats_are_lit_before_they_are_mixed() {
    let surfel = Surfel { normal: [0.0, -1.0, 0.0], ..Surfel::at(0.0, 0.0, 10.0) };
    let shading = "phong".parse().expect("a shading");
    let settings = RenderSettings { shading, ..with(Splat::Blended, 5.0, orthographic([9, 7])) };
    let lit = color_at(&draw(&[surfel], &["normal"], &settings), 4, 3);
    let plain = RenderSettings { splat: Splat::Circle, ..settings };
    assert_eq!(lit, color_at(&draw(&[surfel], &["normal"], &plain), 4, 3));
    assert_ne!(lit, surfel.rgb);
}
