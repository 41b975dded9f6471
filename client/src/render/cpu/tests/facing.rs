//! Splats that face the picture: what one point covers, and how far away.

use super::*;

/// Square, circle and the splats with depth, in their order.
const FACING: [Splat; 5] =
    [Splat::Point, Splat::Square, Splat::Circle, Splat::Cone, Splat::Paraboloid];

/// By the rules: all pixels asked one by one.
fn expected(
    splat: Splat,
    [x, y]: [f64; 2],
    size_px: f64,
    distance: f64,
    picture_px: [u32; 2],
) -> Vec<(u32, u32, f64)> {
    let radius = 0.5 * size_px;
    let [width, height] = picture_px;
    let pixels = (0..height).flat_map(|row| (0..width).map(move |column| (column, row)));
    let part = |(column, row): (u32, u32)| {
        let dx = f64::from(column) + 0.5 - x;
        let dy = f64::from(row) + 0.5 - y;
        let holds_center = x.floor() == f64::from(column) && y.floor() == f64::from(row);
        let from_center = dx.hypot(dy);
        let in_square = |d: f64| -radius < d && d <= radius;
        let covered = match splat {
            Splat::Point => holds_center,
            Splat::Square => in_square(dx) && in_square(dy),
            _ => holds_center || from_center <= radius,
        };
        let behind = match splat {
            Splat::Cone => from_center.min(radius),
            Splat::Paraboloid => from_center.min(radius).powi(2) / radius,
            _ => 0.0,
        };
        covered.then_some((column, row, distance + behind))
    };
    pixels.filter_map(part).collect()
}

#[test]
fn a_cone_and_a_paraboloid_of_three_pixels_are_as_counted_by_hand() {
    // Its centre in the middle of a pixel: the nine pixels around are within 1.5 px.
    let surfel = Surfel::at(0.0, 0.0, 10.0);
    let around = |corner: f64, side: f64| {
        vec![
            (3, 2, corner),
            (4, 2, side),
            (5, 2, corner),
            (3, 3, side),
            (4, 3, 10.0),
            (5, 3, side),
            (3, 4, corner),
            (4, 4, side),
            (5, 4, corner),
        ]
    };
    let cases = [
        (Splat::Circle, around(10.0, 10.0)),
        (Splat::Cone, around(10.0 + 2_f64.sqrt(), 11.0)),
        (Splat::Paraboloid, around(10.0 + 2.0 / 1.5, 10.0 + 1.0 / 1.5)),
    ];
    for (splat, expected) in cases {
        let settings = with(splat, 3.0, orthographic([9, 7]));
        let found = drawn(&draw(&[surfel], &[], &settings));
        assert_drawn(&found, &expected, splat.name());
    }
}

#[test]
fn depth_is_in_world_units_wherever_the_splat_is() {
    // Twice as far as a pixel is a world unit: 2.5 px are 5 units.
    let surfel = Surfel::at(0.0, 0.0, 21.0);
    let settings = with(Splat::Cone, 5.0, perspective([21, 21]));
    let picture = draw(&[surfel], &[], &settings);
    assert!((depth_at(&picture, 10, 10) - 21.0).abs() < 1e-5);
    assert!((depth_at(&picture, 12, 10) - 25.0).abs() < 1e-5);
    assert!((depth_at(&picture, 10, 9) - 23.0).abs() < 1e-5);
}

#[test]
fn every_place_and_size_covers_what_the_rules_say() {
    // In the middle, off it, on edges and corners of pixels, on the picture's edges and beside it.
    let places = [0.0, 0.125, 0.25, -0.375, 0.5, -0.5, 1.5, 4.25, -4.5, 4.5, 5.5, -7.0, 40.0];
    for splat in FACING {
        for size in [1.0_f32, 1.5, 2.0, 3.0, 4.0, 6.5, 25.0, 1024.0] {
            for (right, up) in places.iter().flat_map(|x| places.iter().map(move |y| (*x, *y))) {
                let settings = with(splat, size, orthographic([9, 7]));
                let found = drawn(&draw(&[Surfel::at(right, up, 10.0)], &[], &settings));
                let center = [4.5 + right, 3.5 - up];
                let expected = expected(splat, center, f64::from(size), 10.0, [9, 7]);
                assert_drawn(&found, &expected, &format!("{splat:?} {size} at {right}, {up}"));
            }
        }
    }
}

#[test]
fn a_splat_smaller_than_a_pixel_is_a_pixel() {
    for splat in FACING {
        let settings = with(splat, 0.01, orthographic([9, 7]));
        // In a corner of its pixel: farther from the middle than half a pixel, so at the rim.
        let found = drawn(&draw(&[Surfel::at(0.45, 0.45, 10.0)], &[], &settings));
        let behind = if matches!(splat, Splat::Cone | Splat::Paraboloid) { 0.5 } else { 0.0 };
        assert_drawn(&found, &[(4, 3, 10.0 + behind)], splat.name());
    }
}

#[test]
fn of_two_cones_the_one_whose_centre_is_nearer_wins_a_pixel() {
    let mut surfels = [Surfel::at(-2.0, 0.0, 10.0), Surfel::at(3.0, 0.0, 10.0)];
    surfels[1].rgb = [200, 0, 0];
    for splat in [Splat::Cone, Splat::Paraboloid] {
        let settings = with(splat, 12.0, orthographic([15, 7]));
        let picture = draw(&surfels, &[], &settings);
        for (column, row, _) in drawn(&picture) {
            // Their bisector runs through the middle of column 7 and a half.
            let nearer = surfels[usize::from(column > 7)].rgb;
            assert_eq!(color_at(&picture, column, row), nearer, "{splat:?} {column}, {row}");
        }
    }
}
