//! A tree: a trunk, branches that branch, and leaves around the twigs.

use glam::Vec3;

use crate::sim::{
    material::{Material, rgb},
    random::Random,
    scene::Builder,
    site::palette::{class, leaf},
};

/// What kind of tree.
pub struct Tree {
    /// Height in metres.
    pub height: f32,
    /// How far it reaches sideways, 1 for a broad crown.
    pub spread: f32,
    /// Number of leaves.
    pub leaves: usize,
    /// Half the length of a leaf (a bunch of leaves on trees far away).
    pub leaf: f32,
    /// Colour of the leaves.
    pub color: u32,
    /// Trees of one kind differ by this.
    pub seed: u64,
}

/// A tree while it grows.
struct Growth<'a> {
    b: &'a mut Builder,
    random: Random,
    bark: u16,
    /// The outermost branches: where leaves sit.
    twigs: Vec<(Vec3, Vec3)>,
}

impl Tree {
    /// Grows the tree from `foot`.
    pub fn grow(&self, b: &mut Builder, foot: Vec3) {
        b.object("tree", class::HIGH_VEGETATION);
        let bark = b.surface(Material::Bark { color: rgb(0x8A7460) });
        let crown = b.surface(leaf(self.color));
        let random = Random::of([self.seed, 7, 0, 0]);
        let mut growth = Growth { b, random, bark, twigs: Vec::new() };
        let fork = 0.30 * self.height;
        let (top, radius) = growth.trunk(foot, 0.026 * self.height, fork);
        let limb = 0.30 * self.height;
        growth.branch(top, Vec3::Z, (0.9 * limb, 0.7 * radius), 3);
        for i in 0..5 {
            let angle = (i as f32 + 0.6 * growth.random.unit()) * std::f32::consts::TAU / 5.0;
            let rise = growth.random.range(0.45, 0.95) / self.spread;
            let along = Vec3::new(angle.cos(), angle.sin(), rise).normalize();
            let start = top - Vec3::Z * (0.25 * growth.random.unit() * fork);
            let length = limb * growth.random.range(0.8, 1.0);
            growth.branch(start, along, (length, 0.55 * radius), 3);
        }
        let Growth { b, mut random, twigs, .. } = growth;
        for _ in 0..self.leaves {
            let (from, to) = twigs[(random.unit() * twigs.len() as f32) as usize];
            let scatter = Vec3::new(random.gaussian(), random.gaussian(), random.gaussian());
            let at = from.lerp(to, random.range(0.1, 1.15)) + scatter * (0.026 * self.height);
            let normal = random.direction() + Vec3::Z * 0.7;
            let long = self.leaf * random.range(0.7, 1.2);
            b.leaf(at, normal, random.direction(), (long, 0.62 * long), crown);
        }
    }
}

impl Growth<'_> {
    /// A trunk of a few bends, flared at the foot; returns its top and the radius there.
    fn trunk(&mut self, foot: Vec3, radius: f32, height: f32) -> (Vec3, f32) {
        self.limb(foot, foot + Vec3::Z * 0.25, (1.5 * radius, 1.08 * radius));
        let (mut at, mut r) = (foot, radius);
        for _ in 0..4 {
            let (x, y) = (self.random.range(-0.04, 0.04), self.random.range(-0.04, 0.04));
            let next = at + Vec3::new(x, y, 0.25) * height;
            self.limb(at, next, (r, 0.93 * r));
            (at, r) = (next, 0.93 * r);
        }
        (at, r)
    }

    /// A branch and all that grows out of it, `level` times.
    fn branch(&mut self, start: Vec3, along: Vec3, (length, radius): (f32, f32), level: usize) {
        let end = start + along * length;
        self.limb(start, end, (radius, 0.6 * radius));
        if level <= 1 {
            self.twigs.push((start, end));
        }
        if level == 0 {
            return;
        }
        for i in 0..4 {
            // The leader goes on; the others leave it along its upper half.
            let from = if i == 0 { end } else { start.lerp(end, self.random.range(0.45, 0.95)) };
            let bend = if i == 0 { 0.35 } else { 0.95 };
            let turned = along + self.random.direction() * bend + Vec3::Z * 0.12;
            let part = length * self.random.range(0.55, 0.75);
            self.branch(from, turned.normalize(), (part, 0.55 * radius), level - 1);
        }
    }

    fn limb(&mut self, from: Vec3, to: Vec3, radii: (f32, f32)) {
        self.b.add_to(self.b.cone_shape(from, to, radii, false), self.bark);
    }
}
