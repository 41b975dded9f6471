//! The solids and sheets that the scene is made of: one file per shape.
//!
//! Each shape answers the same questions: its bounds, where a ray meets it first, the normal
//! there, and how far a point is from it (the truth that later methods are held against). They are
//! analytic, not meshes: a scan may be as dense as it likes and still sees a round column.
//!
//! Rays are traced in f32. Metres at most 60 from the scanner leave 4 micrometres of rounding,
//! a tenth of the coordinate step.

mod arch;
mod block;
mod disc;
mod ellipsoid;
mod frustum;
mod prism;

use glam::{DVec3, Mat3, Vec2, Vec3};

pub use arch::Arch;
pub use block::Block;
pub use disc::Disc;
pub use ellipsoid::Ellipsoid;
pub use frustum::Frustum;
pub use prism::Prism;

/// A half-line. `direction` has length 1.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    /// Where it starts, in metres.
    pub origin: Vec3,
    /// Where it goes.
    pub direction: Vec3,
}

impl Ray {
    /// The point at `distance` metres along the ray.
    #[inline]
    #[must_use]
    pub fn at(&self, distance: f32) -> Vec3 {
        self.origin + self.direction * distance
    }
}

/// Where a ray meets a shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Metres along the ray.
    pub distance: f32,
    /// Which face of the shape.
    pub face: u8,
}

/// A closer crossing is none: rays start on surfaces.
pub const MIN_DISTANCE: f32 = 1e-4;

/// Where a shape stands: local coordinates from world coordinates, rigidly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    local_from_world: Mat3,
    origin: Vec3,
    /// Most things stand square: their rays need no turning.
    square: bool,
}

impl Frame {
    /// At `origin`, turned by `world_from_local` (a rotation).
    #[must_use]
    pub fn turned(origin: Vec3, world_from_local: Mat3) -> Self {
        let square = world_from_local == Mat3::IDENTITY;
        Self { local_from_world: world_from_local.transpose(), origin, square }
    }

    /// At `from`, the local z axis pointing to `to`, and the distance between the two.
    #[must_use]
    pub fn along(from: Vec3, to: Vec3) -> (Self, f32) {
        let z = (to - from).normalize();
        let x = if z.z.abs() > 0.9 { Vec3::X } else { Vec3::Z };
        let x = (x - z * x.dot(z)).normalize();
        (Self::turned(from, Mat3::from_cols(x, z.cross(x), z)), (to - from).length())
    }

    /// A ray in local coordinates; distances along it stay what they are.
    #[inline]
    fn ray(&self, ray: &Ray) -> Ray {
        let origin = ray.origin - self.origin;
        if self.square {
            return Ray { origin, direction: ray.direction };
        }
        Ray {
            origin: self.local_from_world * origin,
            direction: self.local_from_world * ray.direction,
        }
    }

    /// A point in local coordinates.
    #[inline]
    #[must_use]
    pub fn local(&self, point: Vec3) -> Vec3 {
        self.local_from_world * (point - self.origin)
    }

    /// A point in local coordinates, in f64.
    fn local_f64(&self, point: DVec3) -> DVec3 {
        self.local_from_world.as_dmat3() * (point - self.origin.as_dvec3())
    }

    /// A local direction in world coordinates.
    #[inline]
    fn world_direction(&self, local: Vec3) -> Vec3 {
        self.local_from_world.transpose() * local
    }

    /// Bounds in the world of the local box `low`..`high`.
    fn bounds(&self, low: Vec3, high: Vec3) -> Bounds {
        let world_from_local = self.local_from_world.transpose();
        let centre = self.origin + world_from_local * ((low + high) * 0.5);
        let half = (high - low) * 0.5;
        let reach = world_from_local.x_axis.abs() * half.x
            + world_from_local.y_axis.abs() * half.y
            + world_from_local.z_axis.abs() * half.z;
        Bounds { low: centre - reach, high: centre + reach }
    }
}

/// An axis-aligned box around something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Lowest corner.
    pub low: Vec3,
    /// Highest corner.
    pub high: Vec3,
}

impl Bounds {
    /// Around nothing: joins as zero does in a sum.
    pub const EMPTY: Self = Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };

    /// Around both.
    #[must_use]
    pub fn join(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Half the surface area, in square metres.
    #[must_use]
    pub fn half_area(&self) -> f32 {
        let e = (self.high - self.low).max(Vec3::ZERO);
        e.x * e.y + e.y * e.z + e.z * e.x
    }

    /// Distance from a point to the box, zero inside.
    #[must_use]
    pub fn distance(&self, point: DVec3) -> f64 {
        let outside = (self.low.as_dvec3() - point).max(point - self.high.as_dvec3());
        outside.max(DVec3::ZERO).length()
    }
}

/// Any of the shapes.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A box.
    Block(Block),
    /// A cylinder or a cone's lower part.
    Frustum(Frustum),
    /// A ball, stretched.
    Ellipsoid(Ellipsoid),
    /// An elliptic sheet.
    Disc(Disc),
    /// A convex polygon, drawn out. (Boxed: leaves are many and should lie close in memory.)
    Prism(Box<Prism>),
    /// A block with a round arch cut out.
    Arch(Arch),
}

macro_rules! each {
    ($self:ident, $shape:ident => $do:expr) => {
        match $self {
            Shape::Block($shape) => $do,
            Shape::Frustum($shape) => $do,
            Shape::Ellipsoid($shape) => $do,
            Shape::Disc($shape) => $do,
            Shape::Prism($shape) => $do,
            Shape::Arch($shape) => $do,
        }
    };
}

impl Shape {
    /// Bounds in the world.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        each!(self, s => s.bounds())
    }

    /// First crossing farther than [`MIN_DISTANCE`] and nearer than `limit`.
    #[inline]
    #[must_use]
    pub fn cross(&self, ray: &Ray, limit: f32) -> Option<Crossing> {
        each!(self, s => s.cross(ray, limit))
    }

    /// Outward unit normal of `face` at a point on it.
    #[inline]
    #[must_use]
    pub fn normal(&self, point: Vec3, face: u8) -> Vec3 {
        each!(self, s => s.normal(point, face))
    }

    /// A point in the shape's own coordinates, as solid textures want it.
    #[inline]
    #[must_use]
    pub fn local(&self, point: Vec3) -> Vec3 {
        each!(self, s => s.local(point))
    }

    /// Distance from a point to the nearest point of the surface, inside or outside, in metres.
    #[must_use]
    pub fn distance(&self, point: DVec3) -> f64 {
        each!(self, s => s.distance(point))
    }

    /// The local axis along which it is longest.
    #[inline]
    #[must_use]
    pub fn longest_axis(&self) -> usize {
        match self {
            Self::Block(block) => block.half.max_position(),
            Self::Prism(_) | Self::Disc(_) => 0,
            Self::Frustum(_) | Self::Ellipsoid(_) | Self::Arch(_) => 2,
        }
    }

    /// Number of faces: planar sides and curved patches.
    #[must_use]
    pub fn faces(&self) -> u8 {
        each!(self, s => s.faces())
    }
}

/// Keeps 1/x finite: a direction component of zero becomes one of 10^-18.
#[inline]
pub fn reciprocal(x: f32) -> f32 {
    if x.abs() < 1e-18 { 1e18f32.copysign(x) } else { 1.0 / x }
}

/// The t interval in which `origin + t * direction` lies within `low`..`high`, and the axis of entry.
#[inline]
fn slab(origin: Vec3, direction: Vec3, low: Vec3, high: Vec3) -> (f32, u8, f32, u8) {
    let (mut enter, mut enter_axis, mut leave, mut leave_axis) = (f32::MIN, 0, f32::MAX, 0);
    for axis in 0..3u8 {
        let i = usize::from(axis);
        let inverse = reciprocal(direction[i]);
        let (a, b) = ((low[i] - origin[i]) * inverse, (high[i] - origin[i]) * inverse);
        let (near, far) = if a < b { (a, b) } else { (b, a) };
        if near > enter {
            (enter, enter_axis) = (near, axis);
        }
        if far < leave {
            (leave, leave_axis) = (far, axis);
        }
    }
    (enter, enter_axis, leave, leave_axis)
}

/// Distance from `p` to the segment `a`..`b` in the plane.
fn segment_distance(p: glam::DVec2, a: Vec2, b: Vec2) -> f64 {
    let (a, b) = (a.as_dvec2(), b.as_dvec2());
    let along = b - a;
    let t = ((p - a).dot(along) / along.length_squared().max(1e-300)).clamp(0.0, 1.0);
    (p - (a + along * t)).length()
}

/// Distance to the surface of a profile drawn out to `±half_depth`: `in_plane` is the signed
/// distance to the profile's outline, negative inside.
fn extrusion_distance(in_plane: f64, across: f64, half_depth: f64) -> f64 {
    let depth = across.abs() - half_depth;
    if in_plane <= 0.0 && depth <= 0.0 {
        return -in_plane.max(depth);
    }
    in_plane.max(0.0).hypot(depth.max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::random::Random;

    fn examples() -> Vec<Shape> {
        let tilt = Frame::turned(
            Vec3::new(1.0, -2.0, 0.5),
            Mat3::from_rotation_z(0.7) * Mat3::from_rotation_x(0.4),
        );
        vec![
            Shape::Block(Block { frame: tilt, half: Vec3::new(0.5, 1.0, 0.2) }),
            Shape::Frustum(Frustum {
                frame: tilt,
                height: 1.5,
                bottom: 0.6,
                top: 0.2,
                capped: true,
            }),
            Shape::Frustum(Frustum {
                frame: tilt,
                height: 1.5,
                bottom: 0.3,
                top: 0.3,
                capped: false,
            }),
            Shape::Frustum(Frustum {
                frame: tilt,
                height: 1.0,
                bottom: 0.8,
                top: 0.0,
                capped: true,
            }),
            Shape::Ellipsoid(Ellipsoid { frame: tilt, radii: Vec3::new(0.9, 0.4, 0.6) }),
            Shape::Disc(Disc::new(
                Vec3::new(1.0, -2.0, 0.5),
                Vec3::new(0.3, 0.2, 1.0),
                Vec3::X,
                0.8,
                0.4,
            )),
            Shape::Prism(Box::new(Prism::new(
                tilt,
                0.4,
                &[
                    Vec2::new(-1.0, 0.0),
                    Vec2::new(1.0, 0.0),
                    Vec2::new(0.6, 0.7),
                    Vec2::new(-0.4, 0.9),
                ],
            ))),
            Shape::Arch(Arch {
                frame: tilt,
                half_width: 1.0,
                height: 1.1,
                half_depth: 0.3,
                radius: 0.8,
            }),
        ]
    }

    #[test]
    fn rays_end_on_the_surface_with_an_outward_unit_normal() {
        let mut random = Random::of([5, 0, 0, 0]);
        for shape in examples() {
            let bounds = shape.bounds();
            let mut hits = 0;
            for _ in 0..20_000 {
                let origin = Vec3::new(1.0, -2.0, 0.5) + random.direction() * 20.0;
                let target = Vec3::new(1.0, -2.0, 0.5) + random.direction() * 1.2;
                let ray = Ray { origin, direction: (target - origin).normalize() };
                let Some(crossing) = shape.cross(&ray, 100.0) else { continue };
                hits += 1;
                assert!(crossing.face < shape.faces());
                let point = ray.at(crossing.distance);
                let distance = shape.distance(point.as_dvec3());
                assert!(distance < 4e-5, "{shape:?} at {point}: {distance}");
                assert!(
                    bounds.distance(point.as_dvec3()) < 1e-4,
                    "{shape:?}: {point} outside {bounds:?}"
                );
                let normal = shape.normal(point, crossing.face);
                assert!((normal.length() - 1.0).abs() < 1e-5);
                // A closed solid seen from outside shows its outside.
                let sheet = matches!(
                    &shape,
                    Shape::Disc(_) | Shape::Frustum(Frustum { capped: false, .. })
                );
                assert!(
                    sheet || normal.dot(ray.direction) < 1e-3,
                    "{shape:?} face {}",
                    crossing.face
                );
                // Stepping off along the normal gets as far away as the step.
                let off = shape.distance((point + normal * 1e-3).as_dvec3());
                assert!(off > 2e-4 && off < 1.05e-3, "{shape:?} face {}: {off}", crossing.face);
            }
            assert!(hits > 1000, "{shape:?}: {hits}");
        }
    }

    #[test]
    fn no_surface_is_nearer_than_the_distance_says() {
        let mut random = Random::of([6, 0, 0, 0]);
        for shape in examples() {
            for _ in 0..4000 {
                let origin =
                    Vec3::new(1.0, -2.0, 0.5) + random.direction() * random.range(0.0, 2.0);
                let distance = shape.distance(origin.as_dvec3()) as f32;
                let ray = Ray { origin, direction: random.direction() };
                if let Some(crossing) = shape.cross(&ray, 100.0) {
                    assert!(crossing.distance > distance - 1e-4, "{shape:?} from {origin}");
                }
            }
        }
    }
}
