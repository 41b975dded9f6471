//! Puts a scene together, thing by thing.
//!
//! Things are described in coordinates of their own and set down with [`Builder::place`]; every
//! face gets a surface id of its own, unless it is said to belong to a surface that exists.

use glam::{Mat3, Vec2, Vec3};

use super::{Bvh, Room, Scene, Surface};
use crate::sim::{
    material::Material,
    shape::{Block, Bounds, Disc, Ellipsoid, Frame, Frustum, Prism, Shape},
};

/// A scene in the making.
#[derive(Debug)]
pub struct Builder {
    shapes: Vec<Shape>,
    first_face: Vec<u32>,
    face_surfaces: Vec<u16>,
    surfaces: Vec<Surface>,
    rooms: Vec<Room>,
    object: &'static str,
    class: u8,
    origin: Vec3,
    turn: Mat3,
}

impl Default for Builder {
    fn default() -> Self {
        Self {
            shapes: Vec::new(),
            first_face: Vec::new(),
            face_surfaces: Vec::new(),
            surfaces: Vec::new(),
            rooms: Vec::new(),
            object: "",
            class: 1,
            origin: Vec3::ZERO,
            turn: Mat3::IDENTITY,
        }
    }
}

impl Builder {
    /// Names what is built from here on, and its ASPRS class.
    pub fn object(&mut self, object: &'static str, class: u8) {
        (self.object, self.class) = (object, class);
    }

    /// Builds something in coordinates of its own: origin at `origin`, turned by `degrees`
    /// anticlockwise about the vertical.
    pub fn place(&mut self, origin: Vec3, degrees: f32, build: impl FnOnce(&mut Self)) {
        self.place_turned(origin, Mat3::from_rotation_z(degrees.to_radians()), build);
    }

    /// As [`place`](Self::place), with any rotation.
    pub fn place_turned(&mut self, origin: Vec3, turn: Mat3, build: impl FnOnce(&mut Self)) {
        let outer = (self.origin, self.turn);
        self.origin = outer.0 + outer.1 * origin;
        self.turn = outer.1 * turn;
        build(self);
        (self.origin, self.turn) = outer;
    }

    /// Makes space `low`..`high` a room, in world coordinates.
    pub fn room(&mut self, low: Vec3, high: Vec3, exposure: f32) {
        self.rooms.push(Room { bounds: Bounds { low, high }, exposure });
    }

    /// A new surface of the current object, for faces that are one.
    pub fn surface(&mut self, material: Material) -> u16 {
        let id =
            u16::try_from(self.surfaces.len()).expect("the scene has fewer than 2^16 surfaces");
        self.surfaces.push(Surface { object: self.object, class: self.class, material });
        id
    }

    /// Adds a shape whose faces belong to the given surfaces, in the order of its faces.
    pub fn add_faces(&mut self, shape: Shape, surfaces: &[u16]) {
        debug_assert_eq!(surfaces.len(), usize::from(shape.faces()));
        self.first_face.push(
            u32::try_from(self.face_surfaces.len()).expect("a scene has fewer than 2^32 faces"),
        );
        self.face_surfaces.extend_from_slice(surfaces);
        self.shapes.push(shape);
    }

    /// Adds a shape all of whose faces belong to one surface.
    pub fn add_to(&mut self, shape: Shape, surface: u16) {
        let faces = usize::from(shape.faces());
        self.add_faces(shape, &[surface; 16][..faces]);
    }

    /// Adds a shape of one material, each face a surface of its own.
    pub fn add(&mut self, shape: Shape, material: Material) {
        let faces = usize::from(shape.faces());
        let mut ids = [0; 16];
        for id in &mut ids[..faces] {
            *id = self.surface(material);
        }
        self.add_faces(shape, &ids[..faces]);
    }

    /// A point of the current coordinates in the world.
    #[must_use]
    pub fn world(&self, point: Vec3) -> Vec3 {
        self.origin + self.turn * point
    }

    fn frame(&self, origin: Vec3) -> Frame {
        Frame::turned(self.world(origin), self.turn)
    }

    /// The box `low`..`high` as a shape.
    #[must_use]
    pub fn block_shape(&self, low: Vec3, high: Vec3) -> Shape {
        Shape::Block(Block { frame: self.frame((low + high) * 0.5), half: (high - low) * 0.5 })
    }

    /// A box.
    pub fn block(&mut self, low: impl Into<Vec3>, high: impl Into<Vec3>, material: Material) {
        let shape = self.block_shape(low.into(), high.into());
        self.add(shape, material);
    }

    /// A cylinder, cone or pole between two points.
    #[must_use]
    pub fn cone_shape(&self, from: Vec3, to: Vec3, radii: (f32, f32), capped: bool) -> Shape {
        let (frame, height) = Frame::along(self.world(from), self.world(to));
        Shape::Frustum(Frustum { frame, height, bottom: radii.0, top: radii.1, capped })
    }

    /// A closed cylinder between two points.
    pub fn pole(
        &mut self,
        from: impl Into<Vec3>,
        to: impl Into<Vec3>,
        radius: f32,
        material: Material,
    ) {
        self.cone(from, to, (radius, radius), material);
    }

    /// A closed cone's part between two points, with its radius at each.
    pub fn cone(
        &mut self,
        from: impl Into<Vec3>,
        to: impl Into<Vec3>,
        radii: (f32, f32),
        material: Material,
    ) {
        let shape = self.cone_shape(from.into(), to.into(), radii, true);
        self.add(shape, material);
    }

    /// A sheet bent to a cone or a ring: no caps, seen from both sides.
    pub fn shade(
        &mut self,
        from: impl Into<Vec3>,
        to: impl Into<Vec3>,
        radii: (f32, f32),
        material: Material,
    ) {
        let shape = self.cone_shape(from.into(), to.into(), radii, false);
        self.add(shape, material);
    }

    /// A round body turned on the vertical: `profile` lists (radius, height), from the bottom up.
    pub fn turned(&mut self, foot: impl Into<Vec3>, profile: &[(f32, f32)], material: Material) {
        let foot = foot.into();
        for pair in profile.windows(2) {
            let [(r0, z0), (r1, z1)] = [pair[0], pair[1]];
            self.cone(foot + Vec3::Z * z0, foot + Vec3::Z * z1, (r0, r1), material);
        }
    }

    /// An ellipsoid.
    pub fn ball(&mut self, centre: impl Into<Vec3>, radii: impl Into<Vec3>, material: Material) {
        let shape =
            Shape::Ellipsoid(Ellipsoid { frame: self.frame(centre.into()), radii: radii.into() });
        self.add(shape, material);
    }

    /// A convex polygon `corners` in the x-z plane (anticlockwise with x to the right), drawn out
    /// from `y.0` to `y.1`.
    #[must_use]
    pub fn prism_shape(&self, y: (f32, f32), corners: &[(f32, f32)]) -> Shape {
        let corners: Vec<Vec2> = corners.iter().map(|&c| c.into()).collect();
        let frame = self.frame(Vec3::Y * (0.5 * (y.0 + y.1)));
        Shape::Prism(Box::new(Prism::new(frame, 0.5 * (y.1 - y.0), &corners)))
    }

    /// A prism of one material.
    pub fn prism(&mut self, y: (f32, f32), corners: &[(f32, f32)], material: Material) {
        let shape = self.prism_shape(y, corners);
        self.add(shape, material);
    }

    /// A leaf of the given surface.
    pub fn leaf(
        &mut self,
        centre: Vec3,
        normal: Vec3,
        along: Vec3,
        radii: (f32, f32),
        surface: u16,
    ) {
        let disc =
            Disc::new(self.world(centre), self.turn * normal, self.turn * along, radii.0, radii.1);
        self.add_to(Shape::Disc(disc), surface);
    }

    /// The scene, once everything stands.
    #[must_use]
    pub fn finish(self) -> Scene {
        let bounds: Vec<Bounds> = self.shapes.iter().map(Shape::bounds).collect();
        let (tree, order) = Bvh::build(&bounds);
        let mut shapes: Vec<Option<Shape>> = self.shapes.into_iter().map(Some).collect();
        let first_face = order.iter().map(|&i| self.first_face[i as usize]).collect();
        let shapes = order
            .iter()
            .map(|&i| shapes[i as usize].take().expect("the tree's order names each shape once"))
            .collect();
        Scene {
            tree,
            shapes,
            first_face,
            face_surfaces: self.face_surfaces,
            surfaces: self.surfaces,
            rooms: self.rooms,
        }
    }
}
