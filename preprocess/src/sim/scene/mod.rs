//! The scene that is scanned, and the truth about it.
//!
//! A [`Scene`] is a list of shapes in a tree, the surfaces that their faces belong to, and the
//! rooms that divide its light. It answers a scanner (what does this ray meet?) and a test (how far
//! is this point from where it should be?).

mod builder;
mod bvh;

use std::sync::LazyLock;

use glam::{DVec3, Vec3};

pub use builder::Builder;
use bvh::Bvh;

use super::{
    material::{Material, Spot},
    shape::{Bounds, Ray, Shape},
    site,
};

/// One smooth piece of the scene's surface: a planar side, a curved patch, or a crowd that is one
/// thing to a surveyor (the leaves of a tree).
#[derive(Debug, Clone)]
pub struct Surface {
    /// What it belongs to, as in `arcade`.
    pub object: &'static str,
    /// ASPRS class (LAS 1.4 R15, table 17).
    pub class: u8,
    material: Material,
}

/// Part of the scene with light of its own: light is not carried through its walls.
#[derive(Debug, Clone, Copy)]
pub struct Room {
    /// Its extent.
    pub bounds: Bounds,
    /// How much longer the camera exposes here than in the open.
    pub exposure: f32,
}

/// What a ray met.
#[derive(Debug, Clone, Copy)]
pub struct Hit {
    /// Metres along the ray.
    pub distance: f32,
    /// Where.
    pub point: Vec3,
    /// Unit normal, on the side that the ray came from.
    pub normal: Vec3,
    /// Which surface.
    pub surface: u16,
    /// Whether the ray met the outside of a solid (a sheet has two).
    pub outside: bool,
    primitive: u32,
}

/// A scene, ready to be scanned.
#[derive(Debug)]
pub struct Scene {
    tree: Bvh,
    shapes: Vec<Shape>,
    /// Per shape, where its faces' surfaces begin in `face_surfaces`.
    first_face: Vec<u32>,
    face_surfaces: Vec<u16>,
    surfaces: Vec<Surface>,
    rooms: Vec<Room>,
}

static COURTYARD: LazyLock<Scene> = LazyLock::new(|| {
    let mut builder = Builder::default();
    site::build(&mut builder);
    builder.finish()
});

impl Scene {
    /// The courtyard with its house, arcade, trees and street. Built once per process.
    #[must_use]
    pub fn courtyard() -> &'static Self {
        &COURTYARD
    }

    /// What a ray meets first within `limit` metres.
    #[inline]
    #[must_use]
    pub fn trace(&self, ray: &Ray, limit: f32) -> Option<Hit> {
        let mut found = None;
        self.tree.nearest(ray, limit, |range, mut limit| {
            for i in range {
                if let Some(crossing) = self.shapes[i].cross(ray, limit) {
                    limit = crossing.distance;
                    found = Some((i, crossing));
                }
            }
            limit
        });
        let (i, crossing) = found?;
        let point = ray.at(crossing.distance);
        let normal = self.shapes[i].normal(point, crossing.face);
        let outside = normal.dot(ray.direction) < 0.0 || self.shapes[i].faces() == 1;
        Some(Hit {
            distance: crossing.distance,
            point,
            normal: if normal.dot(ray.direction) < 0.0 { normal } else { -normal },
            surface: self.face_surfaces[self.first_face[i] as usize + usize::from(crossing.face)],
            outside,
            primitive: i as u32,
        })
    }

    /// Whether anything stands within `limit` metres of a ray's start.
    #[inline]
    #[must_use]
    pub fn blocked(&self, ray: &Ray, limit: f32) -> bool {
        self.tree
            .any(ray, limit, |mut range| range.any(|i| self.shapes[i].cross(ray, limit).is_some()))
    }

    /// Colour and reflectance where a ray ended.
    #[inline]
    #[must_use]
    pub fn finish(&self, hit: &Hit) -> super::material::Finish {
        let shape = &self.shapes[hit.primitive as usize];
        let spot = Spot {
            world: hit.point,
            local: shape.local(hit.point),
            normal: hit.normal,
            grain: shape.longest_axis(),
            primitive: self.first_face[hit.primitive as usize],
        };
        self.surface(hit.surface).material.finish(&spot)
    }

    /// A surface by its id, as points carry it in `surface_id`.
    ///
    /// # Panics
    /// If no surface has this id: ids that points carry are all right.
    #[must_use]
    pub fn surface(&self, id: u16) -> &Surface {
        &self.surfaces[usize::from(id)]
    }

    /// The rooms; a point in none of them is in the open.
    #[must_use]
    pub fn rooms(&self) -> &[Room] {
        &self.rooms
    }

    /// Which room a point is in: an index into [`rooms`](Self::rooms).
    #[inline]
    #[must_use]
    pub fn room_of(&self, point: Vec3) -> Option<usize> {
        self.rooms
            .iter()
            .position(|r| point.cmpge(r.bounds.low).all() && point.cmplt(r.bounds.high).all())
    }

    /// Metres from a point to the nearest surface of anything.
    #[must_use]
    pub fn distance_to_surface(&self, point: DVec3) -> f64 {
        self.tree.closest(point, |i| self.shapes[i].distance(point))
    }

    /// Metres from a point to the nearest shape that has the surface `id`.
    #[must_use]
    pub fn distance_to(&self, id: u16, point: DVec3) -> f64 {
        self.tree.closest(point, |i| {
            let first = self.first_face[i] as usize;
            let faces = first..first + usize::from(self.shapes[i].faces());
            if self.face_surfaces[faces].contains(&id) {
                self.shapes[i].distance(point)
            } else {
                f64::INFINITY
            }
        })
    }
}
