//! A ball, stretched along its local axes.

use glam::{DVec3, Vec3};

use super::{Bounds, Crossing, Frame, MIN_DISTANCE, Ray};

/// Has one face.
#[derive(Debug, Clone, PartialEq)]
pub struct Ellipsoid {
    /// Where its centre stands.
    pub frame: Frame,
    /// Radius along each local axis.
    pub radii: Vec3,
}

impl Ellipsoid {
    pub(super) fn bounds(&self) -> Bounds {
        self.frame.bounds(-self.radii, self.radii)
    }

    #[inline]
    pub(super) fn cross(&self, ray: &Ray, limit: f32) -> Option<Crossing> {
        let ray = self.frame.ray(ray);
        // From the point of the ray nearest to the centre, for the digits' sake (as in a frustum).
        let shift = -ray.origin.dot(ray.direction);
        let (o, d) = (ray.at(shift) / self.radii, ray.direction / self.radii);
        let (a, b, c) = (d.length_squared(), o.dot(d), o.length_squared() - 1.0);
        let discriminant = b * b - a * c;
        if discriminant < 0.0 {
            return None;
        }
        let root = discriminant.sqrt();
        [(-b - root) / a + shift, (-b + root) / a + shift]
            .into_iter()
            .find(|&t| t > MIN_DISTANCE)
            .filter(|&t| t < limit)
            .map(|distance| Crossing { distance, face: 0 })
    }

    #[inline]
    pub(super) fn normal(&self, point: Vec3, _face: u8) -> Vec3 {
        let p = self.frame.local(point) / (self.radii * self.radii);
        self.frame.world_direction(p.normalize_or(Vec3::Z))
    }

    #[inline]
    pub(super) fn local(&self, point: Vec3) -> Vec3 {
        self.frame.local(point)
    }

    /// The foot point `x` solves `x_i = r_i² p_i / (t + r_i²)` with `x` on the ellipsoid: one root
    /// of a falling function of `t` (Eberly, *Distance from a Point to an Ellipsoid*, 2013, eq. 22),
    /// found by bisection.
    pub(super) fn distance(&self, point: DVec3) -> f64 {
        let (p, r) = (self.frame.local_f64(point).abs(), self.radii.as_dvec3());
        // On a symmetry plane the foot may leave it; a nanometre off it does not matter.
        let p = p.max(DVec3::splat(1e-9));
        let squares = r * r;
        let excess = |t: f64| (r * p / (squares + t)).length_squared() - 1.0;
        let mut low = -squares.min_element();
        let mut high = (r * p).length().max(1.0) * 2.0 + squares.max_element();
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if excess(middle) > 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        let foot = squares * p / (squares + 0.5 * (low + high));
        (p - foot).length()
    }

    pub(super) fn faces(&self) -> u8 {
        1
    }
}
