//! Discs and ellipses.

use super::*;

/// Sides of the pictures: 90 degrees, so a unit at distance 1 is half as many pixels.
const SIDE: u32 = 61;
const HALF: f64 = 30.5;

/// A splat in view space, half axes in world units.
#[derive(Clone, Copy)]
struct Ellipse {
    center: DVec3,
    axes: [DVec3; 2],
}

impl Ellipse {
    /// Half axes of which the longer is `radius_px` at the centre's distance.
    fn of(center: DVec3, axes: [DVec3; 2], radius_px: f64, is_perspective: bool) -> Self {
        let radius = if is_perspective { radius_px * center.z / HALF } else { radius_px };
        let longer = axes[0].length().max(axes[1].length());
        Self { center, axes: axes.map(|axis| axis * (radius / longer)) }
    }

    /// Where the line from `eye` along `sight` meets the splat: by its plane's normal, not by
    /// projecting its axes: distance, and square of the place within it.
    fn hit(&self, eye: DVec3, sight: DVec3) -> Option<(f64, f64)> {
        let [u, v] = self.axes;
        let normal = u.cross(v);
        let away = normal.dot(self.center - eye) / normal.dot(sight);
        let from_center = eye + sight * away - self.center;
        // In the plane: a u + b v = from_center, by least squares.
        let (uu, uv, vv) = (u.dot(u), u.dot(v), v.dot(v));
        let (fu, fv) = (from_center.dot(u), from_center.dot(v));
        let whole = uu * vv - uv * uv;
        let (a, b) = ((fu * vv - fv * uv) / whole, (fv * uu - fu * uv) / whole);
        Some((away * sight.z, a * a + b * b)).filter(|_| away > -1e-9)
    }
}

/// View space from the tests' world, and back: it only swaps y and z.
fn swapped(v: DVec3) -> DVec3 {
    DVec3::new(v.x, v.z, v.y)
}

fn settings(splat: Splat, size: f32, is_perspective: bool) -> RenderSettings {
    let side = [SIDE; 2];
    with(splat, size, if is_perspective { perspective(side) } else { orthographic(side) })
}

/// Fails where what was drawn is not what the pixels' rays meet, nor the centre's pixel at the
/// centre's distance where its ray misses. Returns how many pixels were drawn.
fn assert_by_rays(found: &Picture, ellipse: &Ellipse, is_perspective: bool, what: &str) -> usize {
    let center = ellipse.center;
    let w = if is_perspective { center.z / HALF } else { 1.0 };
    let center_px = [HALF + center.x / w, HALF - center.y / w].map(f64::floor);
    let mut drawn = 0;
    for (row, column) in (0..SIDE).flat_map(|row| (0..SIDE).map(move |column| (row, column))) {
        let right = f64::from(column) + 0.5 - HALF;
        let up = HALF - f64::from(row) - 0.5;
        let (eye, sight) = if is_perspective {
            (DVec3::ZERO, DVec3::new(right / HALF, up / HALF, 1.0))
        } else {
            (DVec3::new(right, up, 0.0), DVec3::Z)
        };
        let found = f64::from(depth_at(found, column, row));
        drawn += usize::from(found.is_finite());
        let what = format!("{what}: {column}, {row}");
        let expected = match ellipse.hit(eye, sight) {
            // On the rim, and beside the eye, rounding may decide.
            Some((distance, r_squared))
                if distance.abs() < 1e-9 || (r_squared - 1.0).abs() < 1e-9 =>
            {
                continue;
            }
            Some((distance, r_squared)) if r_squared < 1.0 => distance,
            _ if center_px == [f64::from(column), f64::from(row)] => center.z,
            _ => f64::INFINITY,
        };
        assert_eq!(found.is_finite(), expected.is_finite(), "{what}");
        if expected.is_finite() {
            let difference = (found - expected).abs();
            assert!(difference <= 1e-6 * expected, "{what}: {found}, expected {expected}");
        }
    }
    drawn
}

fn surfel(center: DVec3, normal: DVec3, axes: [DVec3; 2]) -> Surfel {
    Surfel {
        place: swapped(center),
        normal: swapped(normal).as_vec3().to_array(),
        axes: axes.map(|axis| swapped(axis).as_vec3().to_array()),
        ..Surfel::at(0.0, 0.0, 0.0)
    }
}

/// Exact in f32, so that nothing differs but the arithmetic.
fn normals() -> Vec<DVec3> {
    let towards = [
        [0.0, 0.0, -1.0],
        [0.0, 0.0, 2.0],
        [0.5, 0.25, -1.0],
        [-1.0, 0.5, 0.5],
        [1.0, -1.0, -0.125],
        [0.0, 1.0, 0.375],
        [-1.0, 0.0625, 0.03125],
    ];
    towards.into_iter().map(DVec3::from).collect()
}

#[test]
fn discs_are_where_the_rays_meet_them() {
    let centers = [[0.0, 0.0, 12.0], [4.0, -3.0, 12.0], [-7.5, 6.25, 9.0], [0.0, 14.0, 13.0]];
    for is_perspective in [true, false] {
        for center in centers.map(DVec3::from) {
            for normal in normals() {
                for size in [1.0_f32, 7.0, 24.5, 300.0] {
                    let axes = normal.normalize().any_orthonormal_pair().into();
                    let radius_px = 0.5 * f64::from(size);
                    let disc = Ellipse::of(center, axes, radius_px, is_perspective);
                    let settings = settings(Splat::Disc, size, is_perspective);
                    let surfel = surfel(center, normal, [DVec3::ZERO; 2]);
                    let found = draw(&[surfel], &["normal"], &settings);
                    let what = format!("{is_perspective} {center} {normal} {size}");
                    assert_by_rays(&found, &disc, is_perspective, &what);
                }
            }
        }
    }
}

#[test]
fn a_disc_is_what_the_places_on_it_are_projected_to() {
    // A dense sample of the disc, no ray and no plane.
    let (center, normal) = (DVec3::new(3.0, -2.0, 12.0), DVec3::new(1.0, 0.5, -0.75));
    let [u, v]: [DVec3; 2] = normal.normalize().any_orthonormal_pair().into();
    let disc = Ellipse::of(center, [u, v], 14.0, true);
    let mut nearest = vec![(f64::INFINITY, 0.0); (SIDE * SIDE) as usize];
    let steps = 900;
    for (i, j) in (-steps..=steps).flat_map(|i| (-steps..=steps).map(move |j| (i, j))) {
        let (a, b) = (f64::from(i) / f64::from(steps), f64::from(j) / f64::from(steps));
        if a * a + b * b > 1.0 {
            continue;
        }
        let place = disc.center + a * disc.axes[0] + b * disc.axes[1];
        let (x, y) = (HALF + HALF * place.x / place.z, HALF - HALF * place.y / place.z);
        let (column, row) = (x.floor(), y.floor());
        let pixel = &mut nearest[(row * f64::from(SIDE) + column) as usize];
        let from_middle = (x - column - 0.5).hypot(y - row - 0.5);
        if from_middle < pixel.0 {
            *pixel = (from_middle, place.z);
        }
    }
    let surfel = surfel(center, normal, [DVec3::ZERO; 2]);
    let picture = draw(&[surfel], &["normal"], &settings(Splat::Disc, 28.0, true));
    let (mut covered, mut rim) = (0, 0);
    for (found, (from_middle, distance)) in picture.depth.iter().zip(nearest) {
        // Neighbouring places are at most a thirtieth of a pixel apart.
        if found.is_finite() {
            covered += 1;
            assert!(from_middle < 0.03, "{from_middle}");
            assert!((f64::from(*found) - distance).abs() < 0.05, "{found} for {distance}");
        } else if from_middle < 0.03 {
            // The middle is beside the rim.
            rim += 1;
        }
    }
    assert!(covered > 200 && rim < 6, "{covered} covered, {rim} at the rim");
}

#[test]
fn ellipses_are_where_the_rays_meet_them() {
    let spans: [[[f64; 3]; 2]; 5] = [
        [[2.0, 0.0, 0.0], [0.0, 0.5, 0.0]],
        [[0.5, 0.5, 0.25], [-0.125, 0.25, 0.5]],
        // Not at right angles; the second one longer.
        [[1.0, 0.25, 0.0], [1.5, 2.0, -1.0]],
        // In a plane through the eye, but for one of the centres.
        [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]],
        [[1.0, 0.0, 0.0], [0.0, 1.0 / 64.0, 1.0 / 64.0]],
    ];
    for is_perspective in [true, false] {
        for center in [[4.0, -3.0, 12.0], [-6.5, 5.0, 30.0]].map(DVec3::from) {
            for axes in spans.map(|axes| axes.map(DVec3::from)) {
                for size in [5.0_f32, 33.0] {
                    let radius_px = 0.5 * f64::from(size);
                    let ellipse = Ellipse::of(center, axes, radius_px, is_perspective);
                    let settings = settings(Splat::Ellipse, size, is_perspective);
                    let surfel = surfel(center, DVec3::ZERO, axes);
                    let found = draw(&[surfel], &["axis_u", "axis_v"], &settings);
                    let what = format!("{is_perspective} {center} {axes:?} {size}");
                    assert_by_rays(&found, &ellipse, is_perspective, &what);
                }
            }
        }
    }
}

#[test]
fn a_disc_through_the_eye_is_drawn_as_far_as_it_is_in_front() {
    // It reaches 3.5 to 30 units around a centre 3 units away: to the eye's sides and behind it.
    let center = DVec3::new(0.5, -1.0, 3.0);
    let normals = [[0.25, 1.0, 0.0], [1.0, 0.5, 0.25], [-0.5, 1.0, -0.25]].map(DVec3::from);
    for (normal, size) in normals.into_iter().flat_map(|n| [(n, 72.0), (n, 120.0), (n, 610.0)]) {
        let axes = normal.normalize().any_orthonormal_pair().into();
        let disc = Ellipse::of(center, axes, 0.5 * f64::from(size), true);
        let reach = (disc.axes[0].z.powi(2) + disc.axes[1].z.powi(2)).sqrt();
        assert!(reach > center.z, "behind the eye");
        let surfel = surfel(center, normal, [DVec3::ZERO; 2]);
        let found = draw(&[surfel], &["normal"], &settings(Splat::Disc, size, true));
        let drawn = assert_by_rays(&found, &disc, true, &normal.to_string());
        assert!(drawn > 100, "{drawn}");
    }
}

#[test]
fn a_disc_reaches_no_farther_from_its_centre_than_the_largest_splat() {
    // A floor just below the eye, which begins behind it: the horizon is right above its centre,
    // and it would reach across all of the picture.
    let settings = with(Splat::Disc, 1024.0, perspective([4001, 3]));
    let floor = Surfel { normal: [0.0, 0.0, 1.0], ..Surfel::at(0.0, -0.01, 10.0) };
    let found = drawn(&draw(&[floor], &["normal"], &settings));
    let columns: Vec<_> = found.iter().map(|d| d.0).collect();
    assert_eq!((columns.iter().min(), columns.iter().max()), (Some(&976), Some(&3024)));
}

#[test]
fn edge_on_a_disc_is_the_pixel_that_holds_its_centre() {
    for is_perspective in [true, false] {
        let surfel = Surfel { normal: [1.0, 0.0, 0.0], ..Surfel::at(0.0, 0.0, 12.0) };
        let settings = settings(Splat::Disc, 20.0, is_perspective);
        let found = drawn(&draw(&[surfel], &["normal"], &settings));
        assert_drawn(&found, &[(30, 30, 12.0)], "edge on");
    }
}

#[test]
fn without_a_direction_a_disc_is_a_circle() {
    let circle = draw(&[Surfel::at(3.3, -2.2, 12.0)], &[], &settings(Splat::Circle, 15.0, true));
    let nan = f32::NAN;
    for normal in [[0.0; 3], [nan, 0.0, 1.0], [f32::INFINITY, 0.0, 0.0], [1e-42, 0.0, 0.0]] {
        // The last is a direction, though a short one.
        let is_direction = normal[0] == 1e-42;
        let surfel = Surfel { normal, ..Surfel::at(3.3, -2.2, 12.0) };
        for (splat, attributes) in [
            (Splat::Disc, &["normal"][..]),
            (Splat::Disc, &[]),
            (Splat::Ellipse, &["normal"]),
            (Splat::Ellipse, &[]),
        ] {
            let found = draw(&[surfel], attributes, &settings(splat, 15.0, true));
            let is_circle = !is_direction || attributes.is_empty();
            assert_eq!(found == circle, is_circle, "{splat:?} {normal:?} {attributes:?}");
        }
    }
}

#[test]
fn without_axes_an_ellipse_is_a_disc() {
    let nan = [f32::NAN, 0.0, 1.0];
    for axes in [[[0.0; 3]; 2], [nan, [1.0, 0.0, 0.0]], [[1.0, 0.0, 0.0], [f32::INFINITY; 3]]] {
        let surfel = Surfel { normal: [0.5, -1.0, 0.25], axes, ..Surfel::at(2.0, 1.0, 12.0) };
        let disc = draw(&[surfel], &["normal"], &settings(Splat::Disc, 21.0, true));
        // Both attributes are there; what they say is of no use.
        let with_axes = ["normal", "axis_u", "axis_v"];
        let found = draw(&[surfel], &with_axes, &settings(Splat::Ellipse, 21.0, true));
        let faces = draw(&[surfel], &[], &settings(Splat::Disc, 21.0, true));
        // Normals are not fetched for ellipses that have axes: such points face the picture.
        assert_eq!(found, faces, "{axes:?}");
        let found = draw(&[surfel], &["normal"], &settings(Splat::Ellipse, 21.0, true));
        assert_eq!(found, disc);
        assert_ne!(faces, disc);
    }
}

#[test]
fn a_disc_takes_its_normal_from_axes_where_it_has_no_other() {
    let axes = [[1.0, 0.0, 0.0], [0.0, 0.25, 0.5]];
    let surfel = Surfel { normal: [0.0, -0.5, 0.25], axes, ..Surfel::at(2.0, 1.0, 12.0) };
    let settings = settings(Splat::Disc, 21.0, true);
    let by_normal = draw(&[surfel], &["normal"], &settings);
    let by_axes = draw(&[surfel], &["axis_u", "axis_v"], &settings);
    let places = |p: &Picture| drawn(p).iter().map(|d| (d.0, d.1)).collect::<Vec<_>>();
    assert_eq!(places(&by_normal), places(&by_axes));
    assert!(by_normal.coverage() > 0.02);
}

#[test]
fn flat_ellipses_are_the_pixel_that_holds_their_centre() {
    let flat: [[[f32; 3]; 2]; 4] = [
        [[1.0, 0.5, 0.25], [0.0; 3]],
        [[0.0; 3], [0.0, 0.0, 2.0]],
        [[1.0, 0.25, 0.5], [2.0, 0.5, 1.0]],
        [[1e-30, 0.0, 0.0], [0.0, 0.0, 1e30]],
    ];
    for axes in flat {
        let surfel = Surfel { axes, ..Surfel::at(2.2, 1.3, 12.0) };
        let settings = settings(Splat::Ellipse, 40.0, true);
        let found = drawn(&draw(&[surfel], &["axis_u", "axis_v"], &settings));
        let center = [30.5 + 2.2 * 30.5 / 12.0, 30.5 - 1.3 * 30.5 / 12.0].map(|c| c as u32);
        assert_drawn(&found, &[(center[0], center[1], 12.0)], &format!("{axes:?}"));
    }
}

#[test]
fn a_needle_is_the_line_of_pixels_whose_middles_it_holds() {
    let axes = [[0.0, 0.0, 1e-6], [1.0, 0.0, 0.0]];
    for (up, count) in [(0.0, 41), (0.3, 1)] {
        let surfel = Surfel { axes, ..Surfel::at(0.0, up, 12.0) };
        let settings = settings(Splat::Ellipse, 41.0, false);
        let found = drawn(&draw(&[surfel], &["axis_u", "axis_v"], &settings));
        assert_eq!(found.len(), count, "{up}");
        assert!(found.iter().all(|d| d.1 == 30 && d.2 == 12.0), "{found:?}");
    }
}
