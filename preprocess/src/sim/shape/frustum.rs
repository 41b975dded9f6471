//! A cylinder, a cone, or a cone's lower part, along the local z axis from 0 to `height`.

use glam::{DVec2, DVec3, Vec2, Vec3};

use super::{Bounds, Crossing, Frame, MIN_DISTANCE, Ray, segment_distance};

/// Faces: side, bottom, top (the last two only if capped; else it is a two-sided sheet).
#[derive(Debug, Clone, PartialEq)]
pub struct Frustum {
    /// Where its bottom's centre stands.
    pub frame: Frame,
    /// Length of the axis.
    pub height: f32,
    /// Radius at the bottom.
    pub bottom: f32,
    /// Radius at the top.
    pub top: f32,
    /// Whether it is closed.
    pub capped: bool,
}

impl Frustum {
    #[inline]
    fn slope(&self) -> f32 {
        (self.top - self.bottom) / self.height
    }

    pub(super) fn bounds(&self) -> Bounds {
        let r = self.bottom.max(self.top);
        self.frame.bounds(Vec3::new(-r, -r, 0.0), Vec3::new(r, r, self.height))
    }

    #[inline]
    pub(super) fn cross(&self, ray: &Ray, limit: f32) -> Option<Crossing> {
        let ray = self.frame.ray(ray);
        // The quadratic is solved from the point nearest to the frustum's middle: from the ray's
        // origin, metres away, the squares would cancel all digits of a thin pole in f32.
        let middle = Vec3::new(0.0, 0.0, 0.5 * self.height);
        let shift = (middle - ray.origin).dot(ray.direction);
        let (o, d) = (ray.at(shift), ray.direction);
        let mut best: Option<Crossing> = None;
        let mut offer = |t: f32, face: u8| {
            let distance = t + shift;
            if distance > MIN_DISTANCE && distance < best.map_or(limit, |b| b.distance) {
                best = Some(Crossing { distance, face });
            }
        };
        let slope = self.slope();
        let radius = self.bottom + slope * o.z;
        let a = d.x * d.x + d.y * d.y - slope * slope * d.z * d.z;
        let b = o.x * d.x + o.y * d.y - slope * d.z * radius;
        let c = o.x * o.x + o.y * o.y - radius * radius;
        let discriminant = b * b - a * c;
        if discriminant >= 0.0 && a.abs() > 1e-9 {
            let root = discriminant.sqrt();
            for t in [(-b - root) / a, (-b + root) / a] {
                let z = o.z + t * d.z;
                if (0.0..=self.height).contains(&z) && self.bottom + slope * z >= 0.0 {
                    offer(t, 0);
                }
            }
        }
        if self.capped && d.z.abs() > 1e-9 {
            for (z, r, face) in [(0.0, self.bottom, 1), (self.height, self.top, 2)] {
                let t = (z - o.z) / d.z;
                let (x, y) = (o.x + t * d.x, o.y + t * d.y);
                if x * x + y * y <= r * r {
                    offer(t, face);
                }
            }
        }
        best
    }

    #[inline]
    pub(super) fn normal(&self, point: Vec3, face: u8) -> Vec3 {
        let local = match face {
            1 => -Vec3::Z,
            2 => Vec3::Z,
            _ => {
                let p = self.frame.local(point);
                let out = Vec2::new(p.x, p.y).normalize_or(Vec2::X);
                Vec3::new(out.x, out.y, -self.slope()).normalize()
            }
        };
        self.frame.world_direction(local)
    }

    #[inline]
    pub(super) fn local(&self, point: Vec3) -> Vec3 {
        self.frame.local(point)
    }

    pub(super) fn distance(&self, point: DVec3) -> f64 {
        let p = self.frame.local_f64(point);
        let p = DVec2::new(p.x.hypot(p.y), p.z);
        let (low, high) = (Vec2::new(self.bottom, 0.0), Vec2::new(self.top, self.height));
        let side = segment_distance(p, low, high);
        if !self.capped {
            return side;
        }
        side.min(segment_distance(p, Vec2::ZERO, low)).min(segment_distance(
            p,
            Vec2::new(0.0, self.height),
            high,
        ))
    }

    pub(super) fn faces(&self) -> u8 {
        if self.capped { 3 } else { 1 }
    }
}
