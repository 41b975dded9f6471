//! A convex polygon in the local x-z plane, drawn out along y: gables, stair strings, car bodies.

use glam::{DVec2, DVec3, Vec2, Vec3};

use super::{Bounds, Crossing, Frame, MIN_DISTANCE, Ray, extrusion_distance, segment_distance};

/// Faces: one per edge in order, then -y, then +y.
#[derive(Debug, Clone, PartialEq)]
pub struct Prism {
    frame: Frame,
    half_depth: f32,
    /// Corners (x, z), anticlockwise seen with x to the right and z up.
    corners: Box<[Vec2]>,
    /// Outward normal and distance from the origin of each edge's line.
    edges: Box<[(Vec2, f32)]>,
}

impl Prism {
    /// `corners` as (x, z), convex, anticlockwise with x to the right and z up, at least three.
    #[must_use]
    pub fn new(frame: Frame, half_depth: f32, corners: &[Vec2]) -> Self {
        let edges = (0..corners.len())
            .map(|i| {
                let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
                let normal = Vec2::new(b.y - a.y, a.x - b.x).normalize();
                (normal, normal.dot(a))
            })
            .collect();
        Self { frame, half_depth, corners: corners.into(), edges }
    }

    pub(super) fn bounds(&self) -> Bounds {
        let low = self.corners.iter().copied().reduce(Vec2::min).unwrap_or_default();
        let high = self.corners.iter().copied().reduce(Vec2::max).unwrap_or_default();
        self.frame.bounds(
            Vec3::new(low.x, -self.half_depth, low.y),
            Vec3::new(high.x, self.half_depth, high.y),
        )
    }

    #[inline]
    pub(super) fn cross(&self, ray: &Ray, limit: f32) -> Option<Crossing> {
        let ray = self.frame.ray(ray);
        let (o, d) = (ray.origin, ray.direction);
        let (mut enter, mut enter_face, mut leave, mut leave_face) = (f32::MIN, 0, f32::MAX, 0);
        let mut clip = |height: f32, fall: f32, face: u8| {
            // Inside where height + t * fall <= 0. Adding zero turns a negative zero positive.
            let fall = fall + 0.0;
            let t = -height * super::reciprocal(fall);
            if fall < 0.0 {
                if t > enter {
                    (enter, enter_face) = (t, face);
                }
            } else if t < leave {
                (leave, leave_face) = (t, face);
            }
        };
        let mut face = 0;
        for &(normal, distance) in &*self.edges {
            clip(o.x * normal.x + o.z * normal.y - distance, d.x * normal.x + d.z * normal.y, face);
            face += 1;
        }
        clip(-o.y - self.half_depth, -d.y, face);
        clip(o.y - self.half_depth, d.y, face + 1);
        if enter > leave || leave <= MIN_DISTANCE {
            return None;
        }
        let (distance, face) =
            if enter > MIN_DISTANCE { (enter, enter_face) } else { (leave, leave_face) };
        (distance < limit).then_some(Crossing { distance, face })
    }

    #[inline]
    pub(super) fn normal(&self, _point: Vec3, face: u8) -> Vec3 {
        let local = match self.edges.get(usize::from(face)) {
            Some((normal, _)) => Vec3::new(normal.x, 0.0, normal.y),
            None if usize::from(face) == self.edges.len() => -Vec3::Y,
            None => Vec3::Y,
        };
        self.frame.world_direction(local)
    }

    #[inline]
    pub(super) fn local(&self, point: Vec3) -> Vec3 {
        self.frame.local(point)
    }

    pub(super) fn distance(&self, point: DVec3) -> f64 {
        let p = self.frame.local_f64(point);
        let q = DVec2::new(p.x, p.z);
        let inside = self.edges.iter().all(|(n, d)| n.as_dvec2().dot(q) <= f64::from(*d));
        let outline = (0..self.corners.len())
            .map(|i| {
                segment_distance(q, self.corners[i], self.corners[(i + 1) % self.corners.len()])
            })
            .fold(f64::INFINITY, f64::min);
        let signed = if inside { -outline } else { outline };
        extrusion_distance(signed, p.y, f64::from(self.half_depth))
    }

    pub(super) fn faces(&self) -> u8 {
        u8::try_from(self.edges.len()).expect("polygons of the scene have few edges") + 2
    }
}
