//! The meshes that stand for paraboloids. (Fraiss 2017, 3.3.4)

use crate::Footprint;

/// A paraboloid as triangles.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    /// Offset from the tip in radii (right, down), and how many radii behind it.
    pub vertices: Vec<[f64; 3]>,
    /// Corners of the triangles.
    pub triangles: Vec<[u16; 3]>,
}

impl Mesh {
    /// The mesh of a footprint; `None` for what is no mesh.
    #[must_use]
    pub fn of(footprint: Footprint) -> Option<Self> {
        // A few dozen at most.
        let rings: Vec<_> = footprint.rings().iter().map(|count| *count as u16).collect();
        let first = *rings.first()?;
        let mut vertices = vec![[0.0; 3]];
        let mut triangles: Vec<[u16; 3]> =
            (0..first).map(|k| [0, 1 + k, 1 + (k + 1) % first]).collect();
        let mut start = 1;
        for (index, &count) in rings.iter().enumerate() {
            let r = (index + 1) as f64 / rings.len() as f64;
            vertices.extend((0..count).map(|k| {
                let (sin, cos) =
                    (std::f64::consts::TAU * f64::from(k) / f64::from(count)).sin_cos();
                [r * cos, r * sin, r * r]
            }));
            if let Some(&outer) = rings.get(index + 1) {
                let inside = |k: u16| start + k % count;
                let outside = |k: u16| start + count + k % outer;
                for k in 0..count {
                    let (a, next) = (inside(k), inside(k + 1));
                    if outer == count {
                        triangles.push([a, outside(k), outside(k + 1)]);
                        triangles.push([a, outside(k + 1), next]);
                    } else {
                        triangles.push([a, outside(2 * k), outside(2 * k + 1)]);
                        triangles.push([a, outside(2 * k + 1), next]);
                        triangles.push([next, outside(2 * k + 1), outside(2 * k + 2)]);
                    }
                }
            }
            start += count;
        }
        Some(Self { vertices, triangles })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meshes_have_their_number_of_triangles_and_cover_a_polygon_once() {
        let cases = [
            (Footprint::Paraboloid8, 8),
            (Footprint::Paraboloid16, 16),
            (Footprint::Paraboloid32, 32),
            (Footprint::Paraboloid48, 48),
        ];
        for (footprint, count) in cases {
            let mesh = Mesh::of(footprint).expect("a mesh");
            assert_eq!(mesh.triangles.len(), count);
            let area: f64 = mesh
                .triangles
                .iter()
                .map(|t| {
                    let [a, b, c] = t.map(|i| mesh.vertices[usize::from(i)]);
                    0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
                })
                .inspect(|area| assert!(*area > 0.0, "all wind the same way"))
                .sum();
            let sides = f64::from(*footprint.rings().last().expect("rings"));
            let polygon = 0.5 * sides * (std::f64::consts::TAU / sides).sin();
            assert!((area - polygon).abs() < 1e-12, "{footprint:?}: {area} of {polygon}");
            for [x, y, z] in mesh.vertices {
                assert!((x * x + y * y - z).abs() < 1e-12, "on the paraboloid");
            }
        }
        assert_eq!(Mesh::of(Footprint::Circle), None);
    }
}
