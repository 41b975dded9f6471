//! A box, centred on its frame.

use glam::{DVec3, Vec3};

use super::{Bounds, Crossing, Frame, MIN_DISTANCE, Ray, slab};

/// Faces: -x, +x, -y, +y, -z, +z.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// Where it stands.
    pub frame: Frame,
    /// Half the extent along each local axis.
    pub half: Vec3,
}

impl Block {
    pub(super) fn bounds(&self) -> Bounds {
        self.frame.bounds(-self.half, self.half)
    }

    #[inline]
    pub(super) fn cross(&self, ray: &Ray, limit: f32) -> Option<Crossing> {
        let ray = self.frame.ray(ray);
        let (enter, enter_axis, leave, leave_axis) =
            slab(ray.origin, ray.direction, -self.half, self.half);
        if enter > leave || leave <= MIN_DISTANCE || enter >= limit {
            return None;
        }
        // A ray enters through the low face when it runs upward, and leaves through the high one.
        let up = |axis: u8| u8::from(ray.direction[usize::from(axis)] > 0.0);
        let (distance, face) = if enter > MIN_DISTANCE {
            (enter, 2 * enter_axis + 1 - up(enter_axis))
        } else {
            (leave, 2 * leave_axis + up(leave_axis))
        };
        (distance < limit).then_some(Crossing { distance, face })
    }

    #[inline]
    pub(super) fn normal(&self, _point: Vec3, face: u8) -> Vec3 {
        let mut local = Vec3::ZERO;
        local[usize::from(face / 2)] = if face.is_multiple_of(2) { -1.0 } else { 1.0 };
        self.frame.world_direction(local)
    }

    #[inline]
    pub(super) fn local(&self, point: Vec3) -> Vec3 {
        self.frame.local(point)
    }

    pub(super) fn distance(&self, point: DVec3) -> f64 {
        let q = self.frame.local_f64(point).abs() - self.half.as_dvec3();
        if q.max_element() <= 0.0 { -q.max_element() } else { q.max(DVec3::ZERO).length() }
    }

    pub(super) fn faces(&self) -> u8 {
        6
    }
}
