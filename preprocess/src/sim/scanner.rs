//! One shot of a terrestrial laser scanner: from a direction to a measured point, or to nothing.
//!
//! Modelled after phase and pulse scanners of the surveying class: a mirror sweeps elevations while
//! the head turns, the range carries noise of one or two millimetres that grows with range and
//! obliquity, weak returns are lost, and a camera gives the colour.

use glam::{DVec3, Vec3};

use super::{
    STEPS_PER_METRE,
    light::Light,
    random::{GAUSSIAN_BOUND, Random},
    scene::{Hit, Scene},
    shape::Ray,
};

/// Farther surfaces send nothing back, in metres.
const MAX_RANGE: f32 = 60.0;
/// Weaker returns are not told from noise: share of the light that a white wall at 10 m returns.
const WEAKEST_RETURN: f32 = 0.0035;
/// Lowest and highest elevation of the mirror, in degrees: the tripod hides what is below.
pub const ELEVATIONS: (f64, f64) = (-66.0, 90.0);
/// Half the angle of the beam, in radians: 6 mm on 3 m.
const BEAM_HALF_ANGLE: f32 = 0.002;
/// Cosine of the incidence beyond which ellipses grow no longer.
const FLATTEST_INCIDENCE: f32 = 0.125;
/// How far shots stray from the grid, as a share of the angular step.
const JITTER: f64 = 0.35;

/// A place where the scanner stood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Station {
    /// Centre of the scanner's mirror, in metres.
    pub position: Vec3,
    /// Angular step relative to the other stations': above 1 is coarser.
    pub coarseness: f64,
}

/// The stations, in the order in which they were scanned; `point_source_id` counts them from 1.
pub const STATIONS: [Station; 11] = [
    Station { position: Vec3::new(7.9, 3.6, 1.75), coarseness: 1.0 },
    Station { position: Vec3::new(17.4, 11.6, 1.72), coarseness: 1.0 },
    Station { position: Vec3::new(3.1, 13.3, 1.75), coarseness: 1.15 },
    Station { position: Vec3::new(24.0, 8.2, 5.40), coarseness: 1.0 },
    Station { position: Vec3::new(-4.5, -9.9, 4.30), coarseness: 1.0 },
    Station { position: Vec3::new(17.8, -10.2, 4.30), coarseness: 1.0 },
    Station { position: Vec3::new(4.3, 19.2, 1.80), coarseness: 1.6 },
    Station { position: Vec3::new(4.9, 22.6, 1.76), coarseness: 1.8 },
    Station { position: Vec3::new(11.0, 19.9, 1.78), coarseness: 2.2 },
    Station { position: Vec3::new(14.7, 20.6, 1.80), coarseness: 1.7 },
    Station { position: Vec3::new(18.9, 19.6, 1.80), coarseness: 1.7 },
];

/// A direction to shoot at, in radians: azimuth anticlockwise from east, elevation up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aim {
    /// Anticlockwise from east.
    pub azimuth: f64,
    /// Above the horizon.
    pub elevation: f64,
}

/// A measured point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Position in metres, before the offset, not yet rounded to the coordinate step.
    pub position: DVec3,
    /// True unit normal, towards the scanner.
    pub normal: Vec3,
    /// 8-bit sRGB.
    pub color: [u8; 3],
    /// Strength of the return.
    pub intensity: u16,
    /// ASPRS class.
    pub class: u8,
    /// The surface that was hit.
    pub surface: u16,
}

impl Sample {
    /// Half axes in metres of the ellipse that the beam lit: across the beam as wide as the beam, along
    /// the surface the longer the more the surface is turned away.
    pub fn beam_axes(&self, station: &Station) -> [Vec3; 2] {
        let along = self.position.as_vec3() - station.position;
        let radius = BEAM_HALF_ANGLE * along.length();
        let across = self.normal.cross(along);
        // Where the surface is square to the beam any direction across it will do.
        let across = across.try_normalize().unwrap_or_else(|| self.normal.any_orthonormal_vector());
        let incidence = self.normal.dot(along.normalize_or_zero()).abs();
        let away = across.cross(self.normal);
        [away * (radius / incidence.max(FLATTEST_INCIDENCE)), across * radius]
    }

    /// Coordinates rounded to the step and moved by `offset_steps`: the f64 nearest to the decimal.
    #[must_use]
    pub fn coordinates(&self, offset_steps: [i64; 3]) -> [f64; 3] {
        let per_metre = STEPS_PER_METRE as f64;
        std::array::from_fn(|axis| {
            let steps = (self.position[axis] * per_metre).round() as i64 + offset_steps[axis];
            steps as f64 / per_metre
        })
    }
}

/// The scanner in its scene.
pub struct Scanner {
    scene: &'static Scene,
    light: &'static Light,
}

impl Scanner {
    /// The scanner in the courtyard.
    #[must_use]
    pub fn courtyard() -> Self {
        Self { scene: Scene::courtyard(), light: Light::courtyard() }
    }

    /// Shoots once. `steps` are the grid's steps in azimuth and elevation, in radians, about which
    /// the shot jitters; `random` belongs to this shot alone.
    #[must_use]
    pub fn shoot(
        &self,
        station: &Station,
        aim: Aim,
        steps: (f64, f64),
        random: &mut Random,
    ) -> Option<Sample> {
        let (direction, hit) = self.sight(station, aim, steps, random)?;
        let finish = self.scene.finish(&hit);
        let incidence = -hit.normal.dot(direction.as_vec3());
        let strength = strength(finish.infrared, incidence, hit.distance);
        if strength < WEAKEST_RETURN || random.unit() >= finish.returns {
            return None;
        }
        let noise = random.gaussian() * range_deviation(hit.distance, incidence);
        let color = self.light.shade(hit.point, hit.normal, finish.albedo, random);
        let speckle = 1.0 + 0.03 * random.gaussian();
        let level = amplified(finish.infrared, incidence, hit.distance) * speckle;
        let surface = self.scene.surface(hit.surface);
        Some(Sample {
            position: station.position.as_dvec3() + direction * f64::from(hit.distance + noise),
            normal: hit.normal,
            color,
            intensity: (level.clamp(0.0, 1.0) * 65_535.0) as u16,
            class: surface.class,
            surface: hit.surface,
        })
    }

    /// Whether a shot would return a point, but for chance: what the plan counts.
    #[must_use]
    pub fn chance(&self, station: &Station, aim: Aim) -> f32 {
        let Some((direction, hit)) = self.sight(station, aim, (0.0, 0.0), &mut Random::of([0; 4]))
        else {
            return 0.0;
        };
        let finish = self.scene.finish(&hit);
        let incidence = -hit.normal.dot(direction.as_vec3());
        if strength(finish.infrared, incidence, hit.distance) < WEAKEST_RETURN {
            0.0
        } else {
            finish.returns
        }
    }

    fn sight(
        &self,
        station: &Station,
        aim: Aim,
        steps: (f64, f64),
        random: &mut Random,
    ) -> Option<(DVec3, Hit)> {
        let mut stray = |step: f64| (random.unit_f64() - 0.5) * step * JITTER;
        let azimuth = aim.azimuth + stray(steps.0);
        let elevation = aim.elevation + stray(steps.1);
        let (sin_a, cos_a) = libm::sincos(azimuth);
        let (sin_e, cos_e) = libm::sincos(elevation);
        let direction = DVec3::new(cos_a * cos_e, sin_a * cos_e, sin_e);
        let ray = Ray { origin: station.position, direction: direction.as_vec3() };
        self.scene.trace(&ray, MAX_RANGE).map(|hit| (direction, hit))
    }
}

/// Light that comes back, 1 for a white wall faced at 10 m: Lambert's law, with the near range
/// damped as receivers do.
fn strength(infrared: f32, incidence: f32, distance: f32) -> f32 {
    let damped = 100.0 / (distance * distance).max(25.0);
    infrared * incidence * damped
}

/// What the receiver makes of a return, 0 to 1: an amplitude (the root of the power), in which most
/// of the loss by distance has been taken back.
fn amplified(infrared: f32, incidence: f32, distance: f32) -> f32 {
    (infrared * (0.3 + 0.7 * incidence) * 10.0 / (10.0 + distance)).sqrt()
}

/// Standard deviation of the range in metres: a millimetre and a half, more with distance, and more
/// where the beam's footprint is stretched.
fn range_deviation(distance: f32, incidence: f32) -> f32 {
    let stretch = 1.0 / incidence.max(0.25);
    0.0012 + 0.000_03 * distance + 0.0003 * (stretch - 1.0)
}

/// No point lies farther along its ray from its true surface than this, in metres.
pub const MAX_RANGE_ERROR: f64 = (GAUSSIAN_BOUND * (0.0012 + 0.000_03 * MAX_RANGE + 0.0009)) as f64;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::Plan;

    fn scan(points: u64) -> Vec<(usize, Sample)> {
        let (plan, scanner) = (Plan::new(points, 3), Scanner::courtyard());
        (0..plan.sectors())
            .map(|number| plan.sector(number))
            .flat_map(|sector| {
                sector.scan(&scanner).into_iter().map(move |s| (sector.station(), s))
            })
            .collect()
    }

    #[test]
    fn points_lie_as_near_to_their_true_surface_as_the_noise_allows() {
        let scene = Scene::courtyard();
        let samples = scan(3000);
        let mut squares = 0.0;
        for (_, sample) in &samples {
            let distance = scene.distance_to(sample.surface, sample.position);
            assert!(distance <= MAX_RANGE_ERROR + 2e-5, "{sample:?} is off by {distance}");
            assert!(scene.distance_to_surface(sample.position) <= distance);
            squares += distance * distance;
        }
        let deviation = (squares / samples.len() as f64).sqrt();
        assert!((0.0004..0.002).contains(&deviation), "{deviation}");
    }

    #[test]
    fn normals_have_length_one_and_look_at_the_scanner() {
        for (station, sample) in scan(20_000) {
            assert!((sample.normal.length() - 1.0).abs() < 1e-5);
            let back = STATIONS[station].position.as_dvec3() - sample.position;
            assert!(sample.normal.as_dvec3().dot(back) > 0.0, "{sample:?}");
        }
    }

    #[test]
    fn density_falls_with_distance() {
        let scene = Scene::courtyard();
        let foot = STATIONS[0].position.as_dvec3();
        let on_paving = |sample: &Sample| scene.surface(sample.surface).object == "paving";
        let (mut near, mut far) = (0.0, 0.0);
        for (station, sample) in scan(60_000) {
            let away = (sample.position - foot).truncate().length();
            if station == 0 && on_paving(&sample) {
                near += f64::from(u8::from((1.5..2.5).contains(&away)));
                far += f64::from(u8::from((4.5..5.5).contains(&away)));
            }
        }
        // Rings of one metre: the farther one has 2.5 times the area.
        assert!(far > 20.0);
        assert!(near > 2.0 * far / 2.5 * 2.0, "{near} against {far}");
    }

    #[test]
    fn every_station_and_every_class_has_its_points() {
        let samples = scan(60_000);
        for station in 0..STATIONS.len() {
            assert!(samples.iter().filter(|(s, _)| *s == station).count() > 1000);
        }
        for class in [1, 2, 3, 4, 5, 6, 9, 11] {
            assert!(samples.iter().any(|(_, s)| s.class == class), "class {class}");
        }
    }

    #[test]
    fn what_faces_away_or_stands_far_off_returns_less() {
        for answer in [strength, amplified] {
            let faced = answer(0.6, 1.0, 10.0);
            assert!(answer(0.6, 0.2, 10.0) < faced && answer(0.6, 1.0, 30.0) < faced);
        }
    }
}
