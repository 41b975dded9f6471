//! From where a dataset is looked at: down from the south-west, all of it, in parallel projection.

use lodestream_protocol::Manifest;

use super::canvas::Projected;

/// Direction of the view over the ground, from east to north, in degrees.
const AZIMUTH: f64 = 62.0;
/// How far the view looks down, in degrees.
const DESCENT: f64 = 38.0;
/// Share of the canvas on each side that stays free.
const MARGIN: f64 = 0.03;
/// Share of the points on each side that may fall off the canvas: a scan's strays.
const STRAYS: f64 = 0.001;

/// A parallel projection.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    size: [f64; 2],
    /// The middle of the bounds, in lattice units.
    middle: [f64; 3],
    /// World units of a lattice unit.
    scale: f64,
    /// The canvas's middle in world units, along its axes.
    center: [f64; 2],
    samples_per_unit: f64,
}

impl View {
    /// A view of all within the bounds; nothing where there is nothing.
    pub(super) fn of(manifest: &Manifest, size: [u32; 2]) -> Option<Self> {
        let bounds = &manifest.bounds;
        (manifest.points > 0).then(|| Self {
            size: size.map(f64::from),
            middle: std::array::from_fn(|a| {
                (f64::from(bounds.min[a]) + f64::from(bounds.max[a])) / 2.0
            }),
            scale: manifest.lattice.scale,
            center: [0.0; 2],
            samples_per_unit: 1.0,
        })
    }

    /// The same, such that the points fill the canvas.
    pub(super) fn fitted(self, points: impl Iterator<Item = [u32; 3]>) -> Self {
        let (mut xs, mut ys) = (Vec::new(), Vec::new());
        for point in points {
            let [x, y, _] = self.axes(point);
            xs.push(x as f32);
            ys.push(y as f32);
        }
        let [x, y] = [xs, ys].map(|mut values| extent(&mut values));
        let room = |size: f64, (low, high): (f64, f64)| {
            size * (1.0 - 2.0 * MARGIN) / (high - low).max(self.scale)
        };
        let samples_per_unit = room(self.size[0], x).min(room(self.size[1], y));
        Self { center: [(x.0 + x.1) / 2.0, (y.0 + y.1) / 2.0], samples_per_unit, ..self }
    }

    /// World units along the canvas's axes, and away from the viewer.
    fn axes(&self, point: [u32; 3]) -> [f64; 3] {
        let [x, y, z] = std::array::from_fn::<f64, 3, _>(|a| {
            (f64::from(point[a]) - self.middle[a]) * self.scale
        });
        let (sin, cos) = AZIMUTH.to_radians().sin_cos();
        let (right, ahead) = (x * sin - y * cos, x * cos + y * sin);
        let (down, level) = DESCENT.to_radians().sin_cos();
        [right, -(ahead * down + z * level), ahead * level - z * down]
    }

    pub(super) fn project(&self, point: [u32; 3]) -> Projected {
        let [x, y, depth] = self.axes(point);
        let place = |value: f64, axis: usize| {
            ((value - self.center[axis]) * self.samples_per_unit + self.size[axis] / 2.0) as f32
        };
        Projected { x: place(x, 0), y: place(y, 1), depth: (depth * self.samples_per_unit) as f32 }
    }

    /// Samples along a length in world units.
    pub(super) fn pixels(&self, length: f64) -> f32 {
        (length * self.samples_per_unit) as f32
    }
}

/// Lowest and highest of the values but for strays.
fn extent(values: &mut [f32]) -> (f64, f64) {
    if values.is_empty() {
        return (0.0, 0.0);
    }
    let off = (values.len() as f64 * STRAYS) as usize;
    let last = values.len() - 1;
    let low = *values.select_nth_unstable_by(off, f32::total_cmp).1;
    let high = *values.select_nth_unstable_by(last - off, f32::total_cmp).1;
    // A stray is far from the rest: where the last few are not, they belong to it.
    let (first, end) = values.iter().fold((low, high), |(a, b), &v| (a.min(v), b.max(v)));
    let size = (high - low).max(f32::MIN_POSITIVE);
    let low = if low - first < 0.1 * size { first } else { low };
    let high = if end - high < 0.1 * size { end } else { high };
    (f64::from(low), f64::from(high))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strays_do_not_shrink_the_picture() {
        let mut values: Vec<f32> = (0..10_000).map(|i| i as f32).collect();
        values[17] = 1e9;
        let (low, high) = extent(&mut values);
        assert_eq!((low, high < 10_001.0), (0.0, true));
        assert_eq!(extent(&mut [5.0]), (5.0, 5.0));
    }
}
