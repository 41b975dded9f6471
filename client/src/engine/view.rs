//! What a view sees, and how large: culling, projected sizes, priorities.
//!
//! All in f64 and relative to the eye. No camera and no bounds lead to NaN, because a NaN in a
//! priority queue is an order that contradicts itself.

use glam::DVec3;
use lodestream_protocol::{Lattice, LatticeBox};

use crate::camera::{Camera, Projection, ViewBasis};

/// Nodes just outside the picture are kept: their splats reach in.
const MARGIN_PX: f64 = 8.0;

/// A camera and the picture it makes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// The camera.
    pub camera: Camera,
    /// Width and height of the picture in pixels.
    pub size_px: [u32; 2],
}

/// A box in world units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct WorldBox {
    pub center: DVec3,
    /// Half of the extent on each axis.
    pub half: DVec3,
}

/// What a box can be seen in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Extent {
    /// Lowest corner of the rectangle around the box in pixels: right of the middle of the picture,
    /// and above it.
    pub min: [f64; 2],
    /// Highest corner.
    pub max: [f64; 2],
    /// Least distance along the view direction, world units.
    pub nearest: f64,
}

/// A view, prepared for many boxes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Optics {
    eye: DVec3,
    basis: ViewBasis,
    /// Half of width and height in pixels.
    half_px: [f64; 2],
    /// A point `p` is inside where `normal · (p - eye) + distance >= 0` for all planes.
    planes: [(DVec3, f64); 5],
    lens: Lens,
}

#[derive(Debug, Clone, Copy)]
enum Lens {
    /// Pixels that a world unit takes up at a distance of one world unit.
    Perspective { px_at_unit: f64 },
    /// Pixels that a world unit takes up, and half the height of the picture in world units.
    Orthographic { px_per_world: f64, half_height: f64 },
}

impl WorldBox {
    pub fn from_corners(min: DVec3, max: DVec3) -> Self {
        Self { center: 0.5 * (min + max), half: 0.5 * (max - min) }
    }

    pub fn of(bounds: &LatticeBox, lattice: &Lattice) -> Self {
        Self::from_corners(lattice.world(bounds.min).into(), lattice.world(bounds.max).into())
    }

    /// Radius of the sphere around the box.
    pub fn radius(&self) -> f64 {
        self.half.length()
    }
}

impl Optics {
    pub fn new(view: &View) -> Self {
        let basis = view.camera.basis();
        let [width, height] = view.size_px.map(|px| f64::from(px.max(1)));
        let (tan_margin_x, tan_margin_y) =
            (1.0 + 2.0 * MARGIN_PX / width, 1.0 + 2.0 * MARGIN_PX / height);
        let aspect = width / height;
        let (planes, lens) = match view.camera.projection {
            Projection::Perspective { fov_y } => {
                let slope = (0.5 * usable(fov_y, 1e-9, std::f64::consts::PI - 1e-9)).tan(); // Fraiss 2017, eq. 3.1
                let (x, y) = (slope * aspect * tan_margin_x, slope * tan_margin_y);
                let side = |axis: DVec3, tangent: f64| (axis + tangent * basis.forward, 0.0);
                let planes = [
                    side(basis.right, x),
                    side(-basis.right, x),
                    side(basis.up, y),
                    side(-basis.up, y),
                    (basis.forward, 0.0),
                ];
                (planes, Lens::Perspective { px_at_unit: 0.5 * height / slope })
            }
            Projection::Orthographic { height: world } => {
                let half_height = 0.5 * usable(world, f64::MIN_POSITIVE, 1e300);
                let (x, y) = (half_height * aspect * tan_margin_x, half_height * tan_margin_y);
                let planes = [
                    (basis.right, x),
                    (-basis.right, x),
                    (basis.up, y),
                    (-basis.up, y),
                    (basis.forward, 0.0),
                ];
                let px_per_world = 0.5 * height / half_height;
                (planes, Lens::Orthographic { px_per_world, half_height })
            }
        };
        let half_px = [0.5 * width, 0.5 * height];
        Self { eye: view.camera.eye, basis, half_px, planes, lens }
    }

    /// Whether no part of the box can be in the picture. Boxes at the edge count as seen.
    pub fn is_outside(&self, bounds: &WorldBox) -> bool {
        let center = bounds.center - self.eye;
        self.planes.iter().any(|&(normal, distance)| {
            // The corner that lies farthest along the normal decides.
            normal.dot(center) + normal.abs().dot(bounds.half) + distance < 0.0
        })
    }

    /// Radius in pixels at which a sphere appears; infinite where the eye is inside.
    pub fn projected_size(&self, center: DVec3, radius: f64) -> f64 {
        self.size_at((center - self.eye).length(), radius)
    }

    /// The largest [`projected_size`](Self::projected_size) of a sphere of `radius` whose centre
    /// lies anywhere in the box.
    pub fn largest_projected_size(&self, centers: &WorldBox, radius: f64) -> f64 {
        let beyond = ((self.eye - centers.center).abs() - centers.half).max(DVec3::ZERO);
        self.size_at(beyond.length(), radius)
    }

    /// Pixels of the picture that the rectangle around the box takes up.
    pub fn area(&self, bounds: &WorldBox) -> f64 {
        let all = Extent { min: [f64::NEG_INFINITY; 2], max: [f64::INFINITY; 2], nearest: 0.0 };
        let extent = self.extent(bounds).unwrap_or(all);
        let side = |axis: usize| {
            let half = self.half_px[axis];
            (extent.max[axis].min(half) - extent.min[axis].max(-half)).max(0.0)
        };
        side(0) * side(1)
    }

    /// Where on the picture a box lies; `None` where a part of it is not in front of the eye.
    pub fn extent(&self, bounds: &WorldBox) -> Option<Extent> {
        let center = bounds.center - self.eye;
        let (mut min, mut max) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut nearest = f64::INFINITY;
        for corner in 0..8 {
            let sign = |axis: u8| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
            let at = center + bounds.half * DVec3::new(sign(0), sign(1), sign(2));
            let distance = self.basis.forward.dot(at);
            // False for NaN.
            let in_front = distance > 0.0 && distance.is_finite();
            if !in_front {
                return None;
            }
            nearest = nearest.min(distance);
            let scale = match self.lens {
                Lens::Perspective { px_at_unit } => px_at_unit / distance,
                Lens::Orthographic { px_per_world, .. } => px_per_world,
            };
            for (axis, direction) in [self.basis.right, self.basis.up].into_iter().enumerate() {
                let px = direction.dot(at) * scale;
                min[axis] = min[axis].min(px);
                max[axis] = max[axis].max(px);
            }
        }
        Some(Extent { min, max, nearest })
    }

    /// The box, as much larger as coordinates of its size and the eye's may be rounded.
    pub fn with_rounding(&self, bounds: &WorldBox) -> WorldBox {
        let largest = self.eye.abs().max(bounds.center.abs() + bounds.half);
        WorldBox { half: bounds.half + 8.0 * f64::EPSILON * largest, ..*bounds }
    }

    /// Pixels that a world unit takes up where the box is nearest; around the eye, as at a hundredth
    /// of the box's radius.
    pub fn largest_scale(&self, bounds: &WorldBox) -> f64 {
        let beyond = ((self.eye - bounds.center).abs() - bounds.half).max(DVec3::ZERO).length();
        let scale = match self.lens {
            Lens::Perspective { px_at_unit } => px_at_unit / beyond.max(0.01 * bounds.radius()),
            Lens::Orthographic { px_per_world, .. } => px_per_world,
        };
        usable(scale, 0.0, 1e30)
    }

    fn size_at(&self, distance: f64, radius: f64) -> f64 {
        let size = match self.lens {
            Lens::Perspective { .. } if distance <= radius || distance.is_nan() => f64::INFINITY,
            // Fraiss 2017, eq. 3.2.
            Lens::Perspective { px_at_unit } => px_at_unit * (radius / distance),
            // Parallel rays: the size is the same at all distances.
            Lens::Orthographic { px_per_world, .. } => px_per_world * radius,
        };
        if size.is_nan() { 0.0 } else { size.max(0.0) }
    }

    /// How much a node of that projected size in pixels matters: more in the middle of the picture.
    pub fn priority(&self, center: DVec3, projected_size: f64) -> f64 {
        projected_size / (self.angle(center).abs() + 1.0) // Fraiss 2017, eq. 3.4
    }

    /// Angle in radians between the view axis and the direction to `center`.
    fn angle(&self, center: DVec3) -> f64 {
        let to_center = center - self.eye;
        let angle = match self.lens {
            // Fraiss 2017, eq. 3.3, but for the arc cosine: near the axis that has half the digits, and none
            // where rounding takes the cosine above 1.
            Lens::Perspective { .. } => {
                let to = to_center.normalize_or(self.basis.forward);
                self.basis.forward.cross(to).length().atan2(self.basis.forward.dot(to))
            }
            // Parallel rays have no angles: the offset from the axis stands in, measured so that
            // the upper edge of the picture is at 45 degrees.
            Lens::Orthographic { half_height, .. } => {
                let across = to_center - self.basis.forward.dot(to_center) * self.basis.forward;
                (across.length() / half_height).atan()
            }
        };
        if angle.is_nan() { std::f64::consts::PI } else { angle }
    }
}

/// `value` within the bounds; the middle of them on a logarithmic scale where it is no number.
fn usable(value: f64, least: f64, most: f64) -> f64 {
    if value.is_nan() { 1.0 } else { value.clamp(least, most) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn optics(projection: Projection) -> Optics {
        let camera = Camera { eye: DVec3::ZERO, target: DVec3::Y, up: DVec3::Z, projection };
        Optics::new(&View { camera, size_px: [1000, 500] })
    }

    fn perspective() -> Optics {
        // A field of view of 90 degrees: slope 1.
        optics(Projection::Perspective { fov_y: std::f64::consts::FRAC_PI_2 })
    }

    #[test]
    fn projected_size_is_that_of_the_source() {
        // screenHeight / 2 * radius / (slope * distance) = 250 * 2 / 10.
        let size = perspective().projected_size(DVec3::new(0.0, 10.0, 0.0), 2.0);
        assert!((size - 50.0).abs() < 1e-9, "{size}");
        let orthographic = optics(Projection::Orthographic { height: 10.0 });
        let size = orthographic.projected_size(DVec3::new(0.0, 99.0, 0.0), 2.0);
        assert!((size - 100.0).abs() < 1e-9, "{size}");
    }

    #[test]
    fn a_sphere_around_the_eye_is_infinitely_large() {
        assert_eq!(perspective().projected_size(DVec3::new(0.0, 1.0, 0.0), 1.0), f64::INFINITY);
    }

    #[test]
    fn the_middle_of_the_picture_matters_more() {
        for lens in [perspective(), optics(Projection::Orthographic { height: 10.0 })] {
            let ahead = lens.priority(DVec3::new(0.0, 10.0, 0.0), 50.0);
            let aside = lens.priority(DVec3::new(5.0, 10.0, 0.0), 50.0);
            assert!((ahead - 50.0).abs() < 1e-9, "nothing is taken off straight ahead: {ahead}");
            assert!(aside < ahead);
        }
    }

    #[test]
    fn boxes_beside_and_behind_are_outside_and_those_at_the_edge_are_not() {
        let unit = |center: [f64; 3]| WorldBox { center: center.into(), half: DVec3::splat(0.5) };
        let seen = [[0.0, 10.0, 0.0], [0.0, 0.0, 0.0], [20.4, 10.0, 0.0], [0.0, 10.0, -10.4]];
        let unseen = [[0.0, -10.0, 0.0], [22.0, 10.0, 0.0], [0.0, 10.0, 12.0]];
        let lens = perspective();
        seen.iter().for_each(|&c| assert!(!lens.is_outside(&unit(c)), "{c:?}"));
        unseen.iter().for_each(|&c| assert!(lens.is_outside(&unit(c)), "{c:?}"));
        let lens = optics(Projection::Orthographic { height: 10.0 });
        assert!(!lens.is_outside(&unit([10.4, 99.0, 5.4])));
        assert!(lens.is_outside(&unit([11.0, 99.0, 0.0])));
        assert!(lens.is_outside(&unit([0.0, -1.0, 0.0])));
    }

    #[test]
    fn a_box_takes_up_the_pixels_of_its_near_face_as_far_as_these_are_in_the_picture() {
        let unit = |center: [f64; 3]| WorldBox { center: center.into(), half: DVec3::splat(0.5) };
        // 250 pixels a unit at distance 1.
        let area = perspective().area(&unit([0.0, 5.5, 0.0]));
        assert!((area - 50.0 * 50.0).abs() < 1e-6, "{area}");
        assert_eq!(perspective().area(&unit([0.0, 0.0, 0.0])), 500_000.0, "around the eye: all");
        assert_eq!(perspective().area(&unit([99.0, 5.5, 0.0])), 0.0);
        let orthographic = optics(Projection::Orthographic { height: 10.0 });
        let area = orthographic.area(&unit([0.0, 99.0, 0.0]));
        assert!((area - 50.0 * 50.0).abs() < 1e-6, "{area}");
        let aside = orthographic.area(&unit([10.0, 99.0, 0.0]));
        assert!((aside - 25.0 * 50.0).abs() < 1e-6, "half of it is in the picture: {aside}");
    }

    fn any_number() -> impl Strategy<Value = f64> {
        prop_oneof![
            any::<f64>(),
            -1e3..1e3,
            Just(0.0),
            Just(f64::NAN),
            Just(f64::INFINITY),
            Just(f64::NEG_INFINITY),
            Just(f64::MAX),
            Just(1.000_000_1)
        ]
    }

    fn any_vector() -> impl Strategy<Value = DVec3> {
        [any_number(), any_number(), any_number()].prop_map(DVec3::from_array)
    }

    proptest! {
        #[test]
        fn no_camera_and_no_bounds_make_nan(
            eye in any_vector(), target in any_vector(), up in any_vector(),
            number in any_number(), orthographic in any::<bool>(), size_px in any::<[u32; 2]>(),
            center in any_vector(), half in any_vector(), radius in any_number(),
        ) {
            let projection = if orthographic {
                Projection::Orthographic { height: number }
            } else {
                Projection::Perspective { fov_y: number }
            };
            let camera = Camera { eye, target, up, projection };
            let lens = Optics::new(&View { camera, size_px });
            let bounds = WorldBox { center, half };
            let size = lens.projected_size(center, radius);
            let largest = lens.largest_projected_size(&bounds, bounds.radius());
            prop_assert!(size >= 0.0 && largest >= 0.0);
            prop_assert!(lens.priority(center, size) >= 0.0);
            prop_assert!(lens.area(&bounds) >= 0.0 && lens.largest_scale(&bounds) >= 0.0);
        }

        #[test]
        fn the_largest_size_bounds_that_of_every_centre(
            eye in prop::array::uniform3(-10.0..10.0), corner in prop::array::uniform3(-10.0..10.0),
            extent in prop::array::uniform3(0.0..5.0), at in prop::array::uniform3(0.0..=1.0),
            radius in 0.0..5.0,
        ) {
            let camera = Camera {
                eye: eye.into(),
                target: DVec3::from(eye) + DVec3::Y,
                up: DVec3::Z,
                projection: Projection::Perspective { fov_y: 1.0 },
            };
            let lens = Optics::new(&View { camera, size_px: [640, 480] });
            let min = DVec3::from(corner);
            let bounds = WorldBox::from_corners(min, min + DVec3::from(extent));
            let center = min + DVec3::from(extent) * DVec3::from(at);
            let bound = lens.largest_projected_size(&bounds, radius);
            prop_assert!(lens.projected_size(center, radius) <= bound * (1.0 + 1e-9));
        }
    }
}
