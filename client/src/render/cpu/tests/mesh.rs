//! Paraboloids of triangles.

use super::*;

const MESHES: [Splat; 4] =
    [Splat::Paraboloid8, Splat::Paraboloid16, Splat::Paraboloid32, Splat::Paraboloid48];

/// Place from the tip in radii, depth behind it in radii.
type Vertex = ([f64; 2], f64);

/// The triangles as the rule lists them.
fn triangles(splat: Splat) -> Vec<[Vertex; 3]> {
    let rings = splat.footprint().rings();
    let vertex = |ring: usize, k: u32| {
        let r = (ring + 1) as f64 / rings.len() as f64;
        let angle = std::f64::consts::TAU * f64::from(k) / f64::from(rings[ring]);
        ([r * angle.cos(), r * angle.sin()], r * r)
    };
    let mut triangles = Vec::new();
    for k in 0..rings[0] {
        triangles.push([([0.0; 2], 0.0), vertex(0, k), vertex(0, k + 1)]);
    }
    for ring in 1..rings.len() {
        let (a, b) = (|k| vertex(ring - 1, k), |k| vertex(ring, k));
        for k in 0..rings[ring - 1] {
            if rings[ring] == rings[ring - 1] {
                triangles.push([a(k), b(k), b(k + 1)]);
                triangles.push([a(k), b(k + 1), a(k + 1)]);
            } else {
                triangles.push([a(k), b(2 * k), b(2 * k + 1)]);
                triangles.push([a(k), b(2 * k + 1), a(k + 1)]);
                triangles.push([a(k + 1), b(2 * k + 1), b(2 * k + 2)]);
            }
        }
    }
    triangles
}

/// Reversed depth at a place in radii, and how far inside of its triangle (in barycentric terms).
fn sampled(triangles: &[[Vertex; 3]], at: [f64; 2], depth: impl Fn(f64) -> f64) -> (f64, f64) {
    let mut best = (0.0, f64::NEG_INFINITY);
    for [a, b, c] in triangles {
        let doubled = |[x0, y0]: [f64; 2], [x1, y1]: [f64; 2], [x2, y2]: [f64; 2]| {
            (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        };
        let whole = doubled(a.0, b.0, c.0);
        let weights = [doubled(at, b.0, c.0), doubled(a.0, at, c.0), doubled(a.0, b.0, at)]
            .map(|w| w / whole);
        let inside = weights.into_iter().fold(f64::INFINITY, f64::min);
        if inside > best.1 {
            let depths = [a, b, c].map(|v| depth(v.1));
            best = ((0..3).map(|i| weights[i] * depths[i]).sum(), inside);
        }
    }
    best
}

#[test]
fn meshes_have_as_many_triangles_as_their_names_say() {
    for (splat, count) in MESHES.into_iter().zip([8, 16, 32, 48]) {
        assert_eq!(triangles(splat).len(), count);
    }
}

#[test]
fn every_pixel_is_of_the_triangle_that_holds_its_middle() {
    let (size, away) = (61.0, 40.0);
    for (splat, settings) in MESHES
        .into_iter()
        .flat_map(|splat| [(splat, orthographic([71, 71])), (splat, perspective([71, 71]))])
    {
        let triangles = triangles(splat);
        for (right, up) in [(0.0, 0.0), (0.3, -0.2), (-20.0, 7.7)] {
            let picture = draw(&[Surfel::at(right, up, away)], &[], &with(splat, size, settings));
            let is_perspective =
                matches!(settings.camera.projection, Projection::Perspective { .. });
            let per_unit = if is_perspective { 35.5 / away } else { 1.0 };
            let center = [35.5 + right * per_unit, 35.5 - up * per_unit];
            let radius = 0.5 * f64::from(size) / per_unit;
            for (row, column) in (0..71).flat_map(|row| (0..71).map(move |column| (row, column))) {
                let middle = [f64::from(column) + 0.5, f64::from(row) + 0.5];
                let at = [0, 1].map(|i| (middle[i] - center[i]) / (0.5 * f64::from(size)));
                // An orthographic view's near plane is far less than f32 can tell here.
                let depth = |behind: f64| 1.0 / (away + behind * radius);
                let (depth, inside) = sampled(&triangles, at, depth);
                let found = f64::from(depth_at(&picture, column, row));
                if inside > 1e-6 {
                    assert!(
                        (found * depth - 1.0).abs() < 1e-6,
                        "{splat:?} {column}, {row}: {found}"
                    );
                } else if inside < -1e-6 {
                    assert_eq!(found, f64::INFINITY, "{splat:?} {column}, {row}");
                }
            }
        }
    }
}

#[test]
fn half_way_along_an_edge_the_reversed_depths_are_mixed() {
    // Tip 10 away, first vertex 4 px to the right and 14 away: between them 1 / mean(1/10, 1/14).
    let settings = with(Splat::Paraboloid8, 8.0, orthographic([15, 15]));
    let picture = draw(&[Surfel::at(0.0, 0.0, 10.0)], &[], &settings);
    assert!((depth_at(&picture, 9, 7) - 2.0 / (1.0 / 10.0 + 1.0 / 14.0)).abs() < 1e-5);
    assert!((depth_at(&picture, 7, 7) - 10.0).abs() < 1e-6);
}

#[test]
fn the_smallest_mesh_covers_the_pixel_that_holds_its_centre() {
    for splat in MESHES {
        let settings = with(splat, 1.0, orthographic([9, 7]));
        // In the middle of a pixel, and near the corner of one.
        for (x, y) in [(0.0, 0.0), (0.45, 0.45), (-0.45, 0.45), (0.49, -0.49)] {
            let found = drawn(&draw(&[Surfel::at(x, y, 10.0)], &[], &settings));
            let holds = found.iter().any(|(column, row, _)| (*column, *row) == (4, 3));
            assert!(holds && found.len() <= 4, "{} at {x}, {y}: {found:?}", splat.name());
        }
    }
}

#[test]
fn more_triangles_are_nearer_to_the_paraboloid() {
    // Far away, where reversed depth is as good as straight between vertices.
    let surfel = Surfel::at(0.0, 0.0, 2000.0);
    let picture = |splat| draw(&[surfel], &[], &with(splat, 151.0, orthographic([161, 161])));
    let paraboloid = picture(Splat::Paraboloid);
    let error = |other: &Picture| {
        let pairs = paraboloid.depth.iter().zip(&other.depth).filter(|(_, d)| d.is_finite());
        let (sum, count) =
            pairs.fold((0.0, 0), |(sum, n), (a, b)| (sum + f64::from(a - b).powi(2), n + 1));
        (sum / f64::from(count)).sqrt()
    };
    let errors = MESHES.map(|splat| error(&picture(splat)));
    assert!(errors.windows(2).all(|pair| pair[1] < pair[0]), "{errors:?}");
    // In parts of the radius.
    let [coarsest, .., finest] = errors.map(|error| error / 75.5);
    assert!(coarsest > 0.2 && finest < 0.05, "{errors:?}");
    // And covers more of the circle.
    let covered = |splat| picture(splat).coverage();
    assert!(covered(Splat::Paraboloid8) < covered(Splat::Paraboloid32));
    assert!(covered(Splat::Paraboloid32) < paraboloid.coverage());
}
