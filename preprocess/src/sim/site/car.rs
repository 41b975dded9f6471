//! A parked car, its front towards +x.

use glam::{Mat3, Vec3};

use crate::sim::{
    material::{Material, rgb},
    scene::Builder,
    site::palette::*,
};

/// Builds a small saloon around the origin, 4.3 m long, its wheels on z = 0.
pub fn build(b: &mut Builder, color: u32) {
    b.object("car", class::UNCLASSIFIED);
    let body = Material::Paint { color: rgb(color) };
    let glass = Material::Glass;
    let dark = paint(0x1D1E20);
    let half = 0.86;
    // Sills and bonnet; the polygon runs anticlockwise from the rear bumper's foot.
    b.prism(
        (-half, half),
        &[
            (-2.05, 0.3),
            (2.02, 0.28),
            (2.14, 0.42),
            (2.1, 0.62),
            (1.9, 0.76),
            (1.0, 0.93),
            (-1.95, 0.95),
            (-2.13, 0.8),
            (-2.15, 0.5),
        ],
        body,
    );
    // The cabin: windscreen and rear window are its sloping edges.
    let cabin = b.prism_shape(
        (-0.73, 0.73),
        &[(-1.75, 0.94), (1.05, 0.92), (0.38, 1.4), (0.1, 1.46), (-0.9, 1.47), (-1.25, 1.42)],
    );
    let ids = [body, glass, body, body, body, glass, body, body].map(|m| b.surface(m));
    b.add_faces(cabin, &ids);
    for side in [-1.0f32, 1.0] {
        for corners in [
            &[(-0.45, 1.0), (0.74, 0.98), (0.28, 1.34), (-0.45, 1.38)][..],
            &[(-1.42, 1.02), (-0.53, 1.0), (-0.53, 1.38), (-1.1, 1.37)][..],
        ] {
            let y = side * 0.735;
            b.prism((y - 0.004, y + 0.004), corners, glass);
        }
        b.block((-1.6, side * half - 0.012, 0.3), (1.3, side * half + 0.012, 0.37), dark);
        b.block((-0.5, side * 0.865 - 0.004, 0.4), (-0.49, side * 0.865 + 0.004, 0.94), dark);
        b.block((-0.3, side * 0.87 - 0.015, 0.8), (-0.14, side * 0.87 + 0.015, 0.83), STEEL);
        b.ball((0.72, side * 0.95, 1.0), (0.06, 0.1, 0.07), body);
        for x in [-1.32, 1.3] {
            wheel(b, Vec3::new(x, side * 0.76, 0.31), side, dark);
        }
        b.ball((2.03, side * 0.6, 0.64), (0.1, 0.19, 0.09), paint(0xE9ECEA));
        b.block(
            (-2.15, side * 0.66 - 0.14, 0.66),
            (-2.1, side * 0.66 + 0.14, 0.82),
            paint(0x9E1B1B),
        );
    }
    b.block((2.06, -0.85, 0.36), (2.18, 0.85, 0.5), dark);
    b.block((-2.2, -0.85, 0.4), (-2.08, 0.85, 0.54), dark);
    b.block((2.1, -0.4, 0.55), (2.13, 0.4, 0.66), dark);
    b.block((2.17, -0.26, 0.38), (2.19, 0.26, 0.49), WHITE_PAINT);
    b.block((-2.21, -0.26, 0.55), (-2.14, 0.26, 0.66), WHITE_PAINT);
    for y in [-0.3, 0.32] {
        b.place_turned(Vec3::new(1.02, y, 0.955), Mat3::from_rotation_z(1.4), |b| {
            b.block((0.0, -0.01, 0.0), (0.5, 0.01, 0.015), dark);
        });
    }
}

fn wheel(b: &mut Builder, centre: Vec3, side: f32, rubber: Material) {
    let out = Vec3::Y * side;
    b.pole(centre - out * 0.1, centre + out * 0.115, 0.36, paint(0x151516));
    b.pole(centre - out * 0.1, centre + out * 0.13, 0.31, rubber);
    b.pole(centre, centre + out * 0.137, 0.2, STEEL);
    b.ball(centre + out * 0.13, (0.05, 0.03, 0.05), STEEL);
    for i in 0..5 {
        let angle = std::f32::consts::TAU * i as f32 / 5.0;
        let hole = centre + Vec3::new(angle.cos(), 0.0, angle.sin()) * 0.135;
        b.pole(hole, hole + out * 0.139, 0.035, rubber);
    }
}
