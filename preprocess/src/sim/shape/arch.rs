//! A block with a round arch cut through it: the wall over an arcade's opening.
//!
//! In the local x-z plane a rectangle from the springing line (z = 0) up to `height`, less the disc of
//! `radius` around the origin; drawn out along y.

use glam::{DVec2, DVec3, Vec2, Vec3};

use super::{
    Bounds, Crossing, Frame, MIN_DISTANCE, Ray, extrusion_distance, segment_distance, slab,
};

/// Faces: as of a block (-x, +x, -y, +y, -z, +z), then the arch's underside.
///
/// `radius` must be below both `half_width` and `height`.
#[derive(Debug, Clone, PartialEq)]
pub struct Arch {
    /// At the middle of the springing line.
    pub frame: Frame,
    /// Half the extent along x.
    pub half_width: f32,
    /// Extent along z.
    pub height: f32,
    /// Half the extent along y.
    pub half_depth: f32,
    /// Radius of the arch.
    pub radius: f32,
}

impl Arch {
    fn corners(&self) -> (Vec3, Vec3) {
        (
            Vec3::new(-self.half_width, -self.half_depth, 0.0),
            Vec3::new(self.half_width, self.half_depth, self.height),
        )
    }

    pub(super) fn bounds(&self) -> Bounds {
        let (low, high) = self.corners();
        self.frame.bounds(low, high)
    }

    #[inline]
    pub(super) fn cross(&self, ray: &Ray, limit: f32) -> Option<Crossing> {
        let ray = self.frame.ray(ray);
        let (low, high) = self.corners();
        let (enter, enter_axis, leave, leave_axis) = slab(ray.origin, ray.direction, low, high);
        if enter > leave || leave <= MIN_DISTANCE || enter >= limit {
            return None;
        }
        // The ray is inside the hollow between the two crossings of the cylinder along y.
        let shift = -(ray.origin.x * ray.direction.x + ray.origin.z * ray.direction.z);
        let a = ray.direction.x * ray.direction.x + ray.direction.z * ray.direction.z;
        let shift = if a > 1e-12 { shift / a } else { 0.0 };
        let o = ray.at(shift);
        let c = o.x * o.x + o.z * o.z - self.radius * self.radius;
        let (hollow_enter, hollow_leave) = if c >= 0.0 {
            (f32::MAX, f32::MAX)
        } else if a > 1e-12 {
            let half = (-c / a).sqrt();
            (shift - half, shift + half)
        } else {
            (f32::MIN, f32::MAX)
        };
        let up = |axis: u8| u8::from(ray.direction[usize::from(axis)] > 0.0);
        let enter_face = 2 * enter_axis + 1 - up(enter_axis);
        let leave_face = 2 * leave_axis + up(leave_axis);
        // Where solid begins and ends along the ray, in order; of those the first ahead counts.
        let hollow = |t: f32| hollow_enter <= t && t < hollow_leave;
        let candidates = [
            (enter, enter_face, !hollow(enter)),
            (hollow_enter, 6, hollow_enter > enter && hollow_enter < leave),
            (hollow_leave, 6, hollow_leave > enter && hollow_leave < leave),
            (leave, leave_face, !hollow(leave)),
        ];
        candidates
            .into_iter()
            .find(|&(t, _, counts)| counts && t > MIN_DISTANCE)
            .filter(|&(t, ..)| t < limit)
            .map(|(distance, face, _)| Crossing { distance, face })
    }

    #[inline]
    pub(super) fn normal(&self, point: Vec3, face: u8) -> Vec3 {
        let local = if face == 6 {
            let p = self.frame.local(point);
            -Vec3::new(p.x, 0.0, p.z).normalize_or(Vec3::Z)
        } else {
            let mut local = Vec3::ZERO;
            local[usize::from(face / 2)] = if face.is_multiple_of(2) { -1.0 } else { 1.0 };
            local
        };
        self.frame.world_direction(local)
    }

    #[inline]
    pub(super) fn local(&self, point: Vec3) -> Vec3 {
        self.frame.local(point)
    }

    pub(super) fn distance(&self, point: DVec3) -> f64 {
        let p = self.frame.local_f64(point);
        // The profile is symmetric: the right half stands for both.
        let q = DVec2::new(p.x.abs(), p.z);
        let (r, w, h) = (self.radius, self.half_width, self.height);
        let from_centre = q.length();
        let arc = if q.y >= 0.0 {
            (from_centre - f64::from(r)).abs()
        } else {
            (q - DVec2::new(f64::from(r), 0.0)).length()
        };
        let outline = arc
            .min(segment_distance(q, Vec2::new(r, 0.0), Vec2::new(w, 0.0)))
            .min(segment_distance(q, Vec2::new(w, 0.0), Vec2::new(w, h)))
            .min(segment_distance(q, Vec2::new(0.0, h), Vec2::new(w, h)));
        let inside = q.x <= f64::from(w)
            && (0.0..=f64::from(h)).contains(&q.y)
            && from_centre >= f64::from(r);
        extrusion_distance(if inside { -outline } else { outline }, p.y, f64::from(self.half_depth))
    }

    pub(super) fn faces(&self) -> u8 {
        7
    }
}
