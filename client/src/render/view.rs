//! From lattice to pixels in f64: the projection that both renderers follow.
//!
//! Coordinates never meet the GPU, nor a subtraction, as large world numbers: the difference
//! between the eye and a lattice point is taken first, with the rounding error of the coordinates'
//! own size kept apart. So a cloud far from the origin gives the picture of the same cloud at the
//! origin.
//!
//! View space here: x right, y up, z = distance along the view direction. The WGSL twin is
//! `shaders/camera.wgsl`.

use glam::{DMat3, DVec2, DVec3};
use lodestream_protocol::{Lattice, NodeKey};

use crate::{
    camera::Projection,
    render::settings::{RenderSettings, SizeLimits, Splat, SplatSize},
};

/// The near plane's distance as a part of the farthest distance in the scene: twelve decimal orders of
/// magnitude, a hair on the lens and the moon. Reversed floating-point depth spends its precision
/// evenly over the 40 binary ones.
const NEAR_OF_FARTHEST: f64 = 1.0 / (1u64 << 40) as f64;

/// A camera made ready for a picture of a certain size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct View {
    eye: DVec3,
    view_from_world: DMat3,
    /// Half of width and height.
    pub half_size_px: DVec2,
    /// Pixels per world unit across the view at w = 1.
    pub px_per_world: f64,
    /// Whether w is the distance (else 1).
    pub perspective: bool,
    /// Smallest `distance + depth_bias` that is drawn; numerator of the reversed depth.
    pub near: f64,
    /// 0 in perspective; `near` in an orthographic view, which so begins at the eye's plane.
    pub depth_bias: f64,
    /// Splat size where it is in pixels, else 0.
    pub size_px: f64,
    /// Least splat size.
    pub smallest_size_px: f64,
    /// Largest splat size.
    pub largest_size_px: f64,
}

/// A point on the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Projected {
    /// Pixels from the left edge.
    pub x: f64,
    /// Pixels from the upper edge.
    pub y: f64,
    /// Along the view direction, world units; not negative.
    pub distance: f64,
    /// Pixels per world unit across the view at that distance.
    pub scale: f64,
}

/// A node's lattice in view space: `origin + q.x * step.x + q.y * step.y + q.z * step.z`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NodeView {
    /// View space position of the reference lattice point.
    pub origin: DVec3,
    /// View space displacement per lattice unit, a column per axis.
    pub step: DMat3,
}

impl View {
    /// The view of checked `settings` with `samples` by `samples` samples a pixel, each then treated
    /// as a pixel, of a scene whose farthest point is `farthest` world units from the eye.
    pub fn new(settings: &RenderSettings, samples: u32, farthest: f64) -> Self {
        let samples_f = f64::from(samples);
        let [width, height] = settings.size_px.map(|side| samples_f * f64::from(side));
        let camera = &settings.camera;
        let near = (farthest * NEAR_OF_FARTHEST).max(f64::from(f32::MIN_POSITIVE) * 1e6);
        let perspective = matches!(camera.projection, Projection::Perspective { .. });
        let px_per_world = camera.pixels_per_world(1.0, settings.size_px[1]) * samples_f;
        let SizeLimits { min_px, max_px } = settings.size_limits;
        let is_point = settings.splat == Splat::Point;
        let [smallest, largest] = if is_point { [1.0; 2] } else { [min_px, max_px] };
        let size_px = match settings.splat_size {
            SplatSize::Pixels(pixels) => f64::from(pixels) * samples_f,
            _ => 0.0,
        };
        // Of Camera::basis, with the third axis turned to point into the picture.
        let basis = camera.basis();
        Self {
            eye: camera.eye,
            view_from_world: DMat3::from_cols(basis.right, basis.up, basis.forward).transpose(),
            half_size_px: 0.5 * DVec2::new(width, height),
            px_per_world,
            perspective,
            near,
            depth_bias: if perspective { 0.0 } else { near },
            size_px,
            smallest_size_px: smallest * samples_f,
            largest_size_px: largest * samples_f,
        }
    }

    /// Where a place in view space lies on the picture; `None` where it is not in front of the near
    /// plane. It may be beside the picture.
    #[inline]
    pub fn project(&self, view: DVec3) -> Option<Projected> {
        // False for NaN.
        let in_front = view.z + self.depth_bias >= self.near;
        if !in_front {
            return None;
        }
        let w = if self.perspective { view.z } else { 1.0 };
        let scale = self.px_per_world / w;
        Some(Projected {
            x: self.half_size_px.x + view.x * scale,
            y: self.half_size_px.y - view.y * scale,
            distance: view.z,
            scale,
        })
    }

    /// Size in pixels of a splat of `world` units (0 where sizes are in pixels) at a place.
    #[inline]
    pub fn size(&self, at: &Projected, world: f64) -> f64 {
        (self.size_px + world * at.scale).clamp(self.smallest_size_px, self.largest_size_px)
    }

    /// A direction in view space.
    pub fn direction(&self, world: DVec3) -> DVec3 {
        self.view_from_world * world
    }

    /// The eye in lattice units relative to a node's lowest corner.
    pub fn eye_in_node(&self, lattice: &Lattice, key: NodeKey) -> DVec3 {
        -self.displacement(lattice, key, [0; 3]) / lattice.scale
    }

    /// A node's lattice in view space, relative to lattice point `reference` of the node.
    pub fn node(&self, lattice: &Lattice, key: NodeKey, reference: [u32; 3]) -> NodeView {
        NodeView {
            origin: self.view_from_world * self.displacement(lattice, key, reference),
            step: self.view_from_world * lattice.scale,
        }
    }

    /// World displacement from the eye to lattice point `q` of a node.
    fn displacement(&self, lattice: &Lattice, key: NodeKey, q: [u32; 3]) -> DVec3 {
        let corner = lattice.node_min(key);
        DVec3::from_array(std::array::from_fn(|axis| {
            let steps = lattice.origin[axis]
                .saturating_add(i64::from(corner[axis]))
                .saturating_add(i64::from(q[axis]));
            // offset - eye as an exact sum of two numbers (Knuth's TwoSum); then one rounding at
            // the size of the result, not at the size of the coordinates.
            let (offset, eye) = (lattice.offset[axis], self.eye[axis]);
            let high = offset - eye;
            let taken = high - offset;
            let low = (offset - (high - taken)) - (eye + taken);
            lattice.scale.mul_add(steps as f64, high) + low
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;

    fn settings(eye: DVec3) -> RenderSettings {
        let camera = Camera {
            eye,
            target: eye + DVec3::Y,
            up: DVec3::Z,
            projection: Projection::Perspective { fov_y: std::f64::consts::FRAC_PI_2 },
        };
        RenderSettings::new([200, 100], camera)
    }

    #[test]
    fn projects_to_pixels_with_y_down() {
        let view = View::new(&settings(DVec3::ZERO), 1, 1000.0);
        let lattice = Lattice { scale: 0.5, offset: [0.0; 3], origin: [0; 3], side_bits: 8 };
        let node = view.node(&lattice, NodeKey::ROOT, [0; 3]);
        // World (1, 4, 2): 1 right, 2 up, 4 ahead; 50 pixels per unit at distance 1.
        let place = node.origin + node.step * DVec3::new(2.0, 8.0, 4.0);
        let seen = view.project(place).expect("in front");
        assert!((seen.x - (100.0 + 50.0 / 4.0)).abs() < 1e-12, "{seen:?}");
        assert!((seen.y - (50.0 - 50.0 * 2.0 / 4.0)).abs() < 1e-12, "{seen:?}");
        assert!((seen.distance - 4.0).abs() < 1e-12);
        let world = RenderSettings { splat_size: SplatSize::World(0.5), ..settings(DVec3::ZERO) };
        let size = View::new(&world, 1, 1000.0).size(&seen, 0.5);
        assert!((size - 0.5 * 50.0 / 4.0).abs() < 1e-12);
        assert_eq!(view.project(-place), None);
    }

    #[test]
    fn large_coordinates_lose_nothing_but_their_own_rounding() {
        // The same place, a quarter of a millimetre from the eye, written in three lattices.
        let eye = DVec3::new(500_000.25, 5_000_000.5, 100.125);
        let view = View::new(&settings(eye), 1, 1000.0);
        let scale = 1.0 / 4096.0;
        let lattices = [
            ([500_000.25, 5_000_000.5, 100.125], [1, 0, 0]),
            ([0.0; 3], { [500_000 * 4096 + 1025, 5_000_000 * 4096 + 2048, 100 * 4096 + 512] }),
        ];
        for (offset, origin) in lattices {
            let lattice = Lattice { scale, offset, origin, side_bits: 10 };
            let place = view.displacement(&lattice, NodeKey::ROOT, [0; 3]);
            assert_eq!(place, DVec3::new(scale, 0.0, 0.0));
        }
        // A step of a millimetre, which is not representable, at coordinates that are not either.
        let eye = DVec3::new(500_000.1, 5_000_000.123, 100.3);
        let view = View::new(&settings(eye), 1, 1000.0);
        let offset = eye.to_array();
        let lattice = Lattice { scale: 0.001, offset, origin: [1, 2, 3], side_bits: 10 };
        let place = view.displacement(&lattice, NodeKey::ROOT, [0; 3]);
        assert_eq!(place, DVec3::new(0.001, 0.002, 0.003));
    }

    #[test]
    fn the_eye_is_found_inside_a_node() {
        let view = View::new(&settings(DVec3::new(12.0, 13.0, 14.0)), 1, 1000.0);
        let lattice = Lattice { scale: 0.5, offset: [10.0; 3], origin: [0; 3], side_bits: 4 };
        let key = NodeKey::ROOT.child(0).expect("child");
        assert_eq!(view.eye_in_node(&lattice, key), DVec3::new(4.0, 6.0, 8.0));
    }
}
