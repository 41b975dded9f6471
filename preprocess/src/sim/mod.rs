//! A simulated laser scan: `sim:courtyard?points=2M&seed=1` wherever an input is accepted.
//!
//! A terrestrial scanner stands at eleven stations in and around a courtyard house. Its rays meet an
//! analytic [`scene`](Scene), so that density falls with distance, walls cast scan shadows, ranges
//! carry noise and weak returns are lost, as in real scans; but any number of points can be had,
//! and the true surface and normal of each is known. The demo, scale tests and comparisons
//! of methods feed on it. No image, mesh or scan is shipped: the scene is code.
//!
//! The way of a point: [`SimSpec`] says how many; [`Plan`] cuts them into sectors of exact size;
//! a [`Scanner`] shoots each; materials and light give a hit its colour. All randomness is
//! hashed from (seed, station, shot), so that sectors can be scanned by any number of threads.

mod light;
mod material;
mod noise;
mod pattern;
mod plan;
mod random;
mod scanner;
mod scene;
mod shape;
mod site;
mod spec;

pub use plan::{Plan, Sector};
pub use scanner::{MAX_RANGE_ERROR, STATIONS, Sample, Scanner, Station};
pub use scene::{Hit, Scene, Surface};
pub use spec::{MAX_POINTS, SimSpec};

/// Coordinates are whole multiples of a tenth of a millimetre.
pub const STEPS_PER_METRE: i64 = 10_000;

/// A camera worth looking through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// What is seen.
    pub name: &'static str,
    /// Where the camera stands, in metres, before the `offset` of the address.
    pub eye: [f64; 3],
    /// What it looks at.
    pub target: [f64; 3],
    /// Full vertical field of view.
    pub fov_y_degrees: f64,
}

/// A short walk through the scene: from above the street through the gate and the courtyard into
/// the house. Straight lines from each eye to the next pass through no wall.
pub const VIEWS: [View; 6] = [
    View {
        name: "overview",
        eye: [-1.0, -19.0, 15.0],
        target: [12.5, 9.0, 1.0],
        fov_y_degrees: 50.0,
    },
    View { name: "gate", eye: [10.2, -11.2, 3.1], target: [11.2, 8.0, 2.8], fov_y_degrees: 55.0 },
    View {
        name: "courtyard",
        eye: [9.3, 1.6, 1.8],
        target: [14.6, 13.0, 2.9],
        fov_y_degrees: 70.0,
    },
    View { name: "door", eye: [10.6, 9.6, 1.8], target: [11.3, 18.0, 2.1], fov_y_degrees: 65.0 },
    View { name: "hall", eye: [11.0, 17.8, 1.8], target: [11.3, 23.5, 1.4], fov_y_degrees: 75.0 },
    View {
        name: "living room",
        eye: [8.9, 17.9, 1.9],
        target: [3.9, 22.6, 1.0],
        fov_y_degrees: 75.0,
    },
];

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};

    use super::{shape::Ray, *};

    #[test]
    fn the_walk_passes_through_no_wall() {
        let scene = Scene::courtyard();
        for pair in VIEWS.windows(2) {
            let [from, to] = [pair[0].eye, pair[1].eye].map(|eye| DVec3::from(eye).as_vec3());
            let step: Vec3 = to - from;
            let ray = Ray { origin: from, direction: step.normalize() };
            assert!(!scene.blocked(&ray, step.length()), "{} to {}", pair[0].name, pair[1].name);
        }
    }
}
