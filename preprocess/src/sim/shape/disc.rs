//! An elliptic sheet without thickness: a leaf.

use glam::{DVec2, DVec3, Vec3};

use super::{Bounds, Crossing, MIN_DISTANCE, Ray};

/// Has one face, seen from both sides.
#[derive(Debug, Clone, PartialEq)]
pub struct Disc {
    centre: Vec3,
    normal: Vec3,
    /// Long axis over its radius: a point of the outline maps to length 1.
    scaled_u: Vec3,
    scaled_v: Vec3,
}

impl Disc {
    /// A disc around `centre`, across `normal`, with radius `radius_u` along `u` (as far as that is
    /// across `normal`) and `radius_v` along the third direction.
    ///
    /// `normal` and `u` must be neither zero nor parallel.
    #[must_use]
    pub fn new(centre: Vec3, normal: Vec3, u: Vec3, radius_u: f32, radius_v: f32) -> Self {
        let normal = normal.normalize();
        let u = (u - normal * u.dot(normal)).normalize();
        let v = normal.cross(u);
        Self { centre, normal, scaled_u: u / radius_u, scaled_v: v / radius_v }
    }

    pub(super) fn bounds(&self) -> Bounds {
        // The extent of an ellipse along an axis (Quilez, *Bounding boxes of discs*, 2016).
        let u = self.scaled_u / self.scaled_u.length_squared();
        let v = self.scaled_v / self.scaled_v.length_squared();
        let reach = (u * u + v * v).map(f32::sqrt);
        Bounds { low: self.centre - reach, high: self.centre + reach }
    }

    #[inline]
    pub(super) fn cross(&self, ray: &Ray, limit: f32) -> Option<Crossing> {
        let to_centre = self.centre - ray.origin;
        let distance = to_centre.dot(self.normal) / ray.direction.dot(self.normal);
        // A parallel ray gives an infinity or NaN, and neither is within the limits.
        if !(distance > MIN_DISTANCE && distance < limit) {
            return None;
        }
        let p = ray.direction * distance - to_centre;
        let (a, b) = (p.dot(self.scaled_u), p.dot(self.scaled_v));
        (a * a + b * b <= 1.0).then_some(Crossing { distance, face: 0 })
    }

    #[inline]
    pub(super) fn normal(&self, _point: Vec3, _face: u8) -> Vec3 {
        self.normal
    }

    /// In units of the radii: the outline has length 1.
    #[inline]
    pub(super) fn local(&self, point: Vec3) -> Vec3 {
        let p = point - self.centre;
        Vec3::new(p.dot(self.scaled_u), p.dot(self.scaled_v), p.dot(self.normal))
    }

    pub(super) fn distance(&self, point: DVec3) -> f64 {
        let p = point - self.centre.as_dvec3();
        let (u, v) = (self.scaled_u.as_dvec3(), self.scaled_v.as_dvec3());
        let radii = DVec2::new(1.0 / u.length(), 1.0 / v.length());
        let height = p.dot(self.normal.as_dvec3());
        let q = DVec2::new(p.dot(u) * radii.x, p.dot(v) * radii.y).abs();
        if (q / radii).length() <= 1.0 {
            return height.abs();
        }
        // Outside the outline: the ellipse's foot point, as for the ellipsoid.
        let (q, squares) = (q.max(DVec2::splat(1e-9)), radii * radii);
        let (mut low, mut high) =
            (0.0, (radii * q).length().max(1.0) * 2.0 + squares.max_element());
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if (radii * q / (squares + middle)).length_squared() > 1.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        let foot = squares * q / (squares + 0.5 * (low + high));
        height.hypot((q - foot).length())
    }

    pub(super) fn faces(&self) -> u8 {
        1
    }
}
