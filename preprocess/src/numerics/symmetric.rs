//! Symmetric 3 x 3 matrices.

use glam::DVec3;

/// A symmetric 3 x 3 matrix.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Symmetric3 {
    /// The diagonal: xx, yy, zz.
    pub diagonal: [f64; 3],
    /// Beside it: yz, xz, xy, each named by the axis that it lacks.
    pub beside: [f64; 3],
}

impl Symmetric3 {
    /// The matrix with these entries: xx, xy, xz, yy, yz, zz.
    #[must_use]
    pub const fn new([xx, xy, xz, yy, yz, zz]: [f64; 6]) -> Self {
        Self { diagonal: [xx, yy, zz], beside: [yz, xz, xy] }
    }

    /// xx, xy, xz, yy, yz, zz.
    #[must_use]
    pub const fn entries(&self) -> [f64; 6] {
        let ([xx, yy, zz], [yz, xz, xy]) = (self.diagonal, self.beside);
        [xx, xy, xz, yy, yz, zz]
    }

    /// The matrix times a vector.
    #[must_use]
    pub fn apply(&self, v: DVec3) -> DVec3 {
        let [xx, xy, xz, yy, yz, zz] = self.entries();
        DVec3::new(
            xx * v.x + xy * v.y + xz * v.z,
            xy * v.x + yy * v.y + yz * v.z,
            xz * v.x + yz * v.y + zz * v.z,
        )
    }

    /// Sum of the diagonal.
    #[must_use]
    pub fn trace(&self) -> f64 {
        self.diagonal.iter().sum()
    }

    /// Whether all entries are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.entries().iter().all(|entry| entry.is_finite())
    }

    /// Largest absolute entry.
    #[must_use]
    pub fn largest(&self) -> f64 {
        self.entries().into_iter().fold(0.0, |largest, entry| largest.max(entry.abs()))
    }

    /// Every entry times `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            diagonal: self.diagonal.map(|c| c * factor),
            beside: self.beside.map(|c| c * factor),
        }
    }
}
