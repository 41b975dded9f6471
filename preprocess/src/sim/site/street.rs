//! The street: lamps, parked cars, bollards, a bicycle, and what stands in the park beyond.

use glam::Vec3;

use crate::sim::{
    material::Material,
    scene::Builder,
    site::{car, ground::ROAD_LEVEL, palette::*},
};

pub fn build(b: &mut Builder) {
    for (x, y) in
        [(-8.5, -2.6), (4.6, -2.6), (20.5, -2.6), (35.5, -2.6), (-1.5, -10.0), (27.5, -10.0)]
    {
        b.place(Vec3::new(x, y, 0.0), if y > -5.0 { -90.0 } else { 90.0 }, lamp);
    }
    for (x, y, degrees, color) in [
        (14.2, -4.05, 0.0, 0xA8322B),
        (24.6, -4.0, 180.0, 0x2F5573),
        (-6.6, -4.1, 2.0, 0xD7D8D4),
        (31.0, -7.9, 180.0, 0x4C6B57),
    ] {
        b.place(Vec3::new(x, y, ROAD_LEVEL), degrees, |b| car::build(b, color));
    }
    for x in [6.9, 8.3, 10.7, 12.1] {
        b.object("bollard", class::UNCLASSIFIED);
        b.turned(
            (x, -2.55, 0.0),
            &[(0.09, 0.0), (0.075, 0.1), (0.065, 0.75), (0.085, 0.78), (0.06, 0.88)],
            BLACK_IRON,
        );
    }
    b.place(Vec3::new(17.4, -0.62, 0.0), 3.0, bicycle);
    b.place(Vec3::new(3.0, -0.4, 0.0), 0.0, post_box);
    sign(b, Vec3::new(5.6, -2.4, 0.0));
    for (x, y, degrees) in
        [(8.8, -12.3, 180.0), (16.5, -12.3, 180.0), (22.0, -12.4, 180.0), (-3.0, -14.0, 180.0)]
    {
        b.place(Vec3::new(x, y, 0.0), degrees, park_bench);
    }
    b.object("litter bin", class::UNCLASSIFIED);
    b.turned((10.2, -12.2, 0.0), &[(0.2, 0.0), (0.24, 0.75)], GREEN_PAINT);
    b.turned((18.7, -0.75, 0.0), &[(0.2, 0.0), (0.24, 0.8)], GREEN_PAINT);
}

/// A cast-iron lamp with an arm towards +x.
fn lamp(b: &mut Builder) {
    b.object("street lamp", class::UNCLASSIFIED);
    b.turned(
        (0.0, 0.0, 0.0),
        &[(0.17, 0.0), (0.15, 0.25), (0.09, 0.4), (0.075, 1.1), (0.055, 1.2), (0.045, 4.1)],
        BLACK_IRON,
    );
    let mut last = Vec3::new(0.0, 0.0, 4.05);
    for i in 1..=5 {
        let angle = f32::to_radians(180.0 - 30.0 * i as f32);
        let next = Vec3::new(0.4 + 0.4 * angle.cos(), 0.0, 4.05 + 0.4 * angle.sin());
        b.pole(last, next, 0.025, BLACK_IRON);
        last = next;
    }
    b.turned((last.x, 0.0, last.z - 0.62), &[(0.07, 0.0), (0.16, 0.34)], paint(0xF5EBC6));
    b.turned((last.x, 0.0, last.z - 0.28), &[(0.21, 0.0), (0.1, 0.16), (0.03, 0.28)], BLACK_IRON);
    b.pole((0.0, 0.0, 3.3), (0.55, 0.0, 3.3), 0.015, BLACK_IRON);
}

fn bicycle(b: &mut Builder) {
    b.object("bicycle", class::UNCLASSIFIED);
    let frame = paint(0x2E6E62);
    for x in [-0.52, 0.52] {
        b.shade((x, -0.017, 0.34), (x, 0.017, 0.34), (0.34, 0.34), BLACK_IRON);
        b.shade((x, -0.01, 0.34), (x, 0.01, 0.34), (0.31, 0.31), STEEL);
        b.pole((x, -0.04, 0.34), (x, 0.04, 0.34), 0.025, STEEL);
        for i in 0..10 {
            let angle = std::f32::consts::TAU * i as f32 / 10.0;
            let rim = Vec3::new(x + 0.31 * angle.cos(), 0.0, 0.34 + 0.31 * angle.sin());
            b.pole((x, 0.0, 0.34), rim, 0.003, STEEL);
        }
    }
    let (bottom, seat, head) =
        (Vec3::new(-0.05, 0.0, 0.3), Vec3::new(-0.2, 0.0, 0.82), Vec3::new(0.36, 0.0, 0.84));
    let (rear, front) = (Vec3::new(-0.52, 0.0, 0.34), Vec3::new(0.52, 0.0, 0.34));
    for (from, to) in
        [(bottom, seat), (bottom, head), (seat, head), (bottom, rear), (seat, rear), (head, front)]
    {
        b.pole(from, to, 0.016, frame);
    }
    b.pole(head, head + Vec3::new(-0.04, 0.0, 0.16), 0.014, STEEL);
    b.pole((0.3, -0.28, 1.0), (0.3, 0.28, 1.0), 0.014, BLACK_IRON);
    b.pole(seat, seat + Vec3::Z * 0.1, 0.014, STEEL);
    b.ball((-0.21, 0.0, 0.94), (0.14, 0.07, 0.03), WALNUT);
    b.pole((-0.05, -0.14, 0.3), (-0.05, 0.14, 0.3), 0.02, BLACK_IRON);
    b.block((0.4, -0.15, 0.85), (0.68, 0.15, 1.06), OAK);
}

fn post_box(b: &mut Builder) {
    b.object("post box", class::UNCLASSIFIED);
    b.block((-0.2, -0.26, 0.9), (0.2, 0.0, 1.45), paint(0xD9A522));
    b.prism((-0.28, 0.0), &[(-0.23, 1.45), (0.23, 1.45), (0.0, 1.56)], paint(0xD9A522));
    b.block((-0.13, -0.265, 1.28), (0.13, -0.26, 1.31), BLACK_IRON);
}

fn sign(b: &mut Builder, foot: Vec3) {
    b.object("traffic sign", class::UNCLASSIFIED);
    b.pole(foot, foot + Vec3::Z * 2.7, 0.03, STEEL);
    let face = foot + Vec3::new(-0.035, 0.0, 2.4);
    b.place(face, 0.0, |b| {
        b.block((-0.012, -0.3, -0.3), (0.0, 0.3, 0.3), paint(0x2359A5));
        b.prism(
            (-0.24, 0.24),
            &[(-0.016, -0.2), (-0.012, -0.2), (-0.012, 0.22), (-0.016, 0.22)],
            WHITE_PAINT,
        );
    });
}

fn park_bench(b: &mut Builder) {
    b.object("bench", class::UNCLASSIFIED);
    let slat = Material::Wood { color: crate::sim::material::rgb(0x8C5F3A) };
    for i in 0..5 {
        let y = -0.25 + 0.1 * i as f32;
        b.block((-0.95, y, 0.44), (0.95, y + 0.075, 0.475), slat);
    }
    for i in 0..4 {
        let z = 0.55 + 0.11 * i as f32;
        b.block((-0.95, 0.26, z), (0.95, 0.285, z + 0.08), slat);
    }
    for x in [-0.8, 0.75] {
        b.block((x, -0.24, 0.0), (x + 0.05, -0.19, 0.44), BLACK_IRON);
        b.block((x, 0.2, 0.0), (x + 0.05, 0.26, 0.98), BLACK_IRON);
        b.block((x, -0.24, 0.4), (x + 0.05, 0.2, 0.44), BLACK_IRON);
    }
}
