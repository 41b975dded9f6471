//! How much a node matters, and what a budget lets through.

use std::time::Duration;

use glam::DVec3;

use super::Rows;
use crate::{
    camera::{Camera, Projection},
    engine::{Engine, EngineConfig, Optics, View},
    source::Source,
    stability::{
        Row, StabilityError,
        dataset::{Built, Digits},
        exact::{big, big3, dot, minus, relative, unit, whole},
    },
};

const REFERENCE: &str = "eq. 3.4 in 512-bit floats";
const TURN: &str = "two unit vectors, each turned by rounding: four epsilons";
/// Radians, and so of the priority.
const TOLERANCE: f64 = 8.9e-16;

/// Longest wait for a local file of some kilobytes; it is not a matter of speed.
const PATIENCE: Duration = Duration::from_secs(60);

fn view(eye: DVec3, target: DVec3) -> View {
    let projection = Projection::Perspective { fov_y: 1.0 };
    View { camera: Camera { eye, target, up: DVec3::Z, projection }, size_px: [1600, 900] }
}

pub(super) fn cases() -> Rows {
    let mut rows = vec![dead_centre()];
    let utm = DVec3::new(500_000.123, 5_300_000.456, 412.789);
    let places = [
        ("a microradian off the axis", utm, DVec3::new(1e-6, 1.0, 0.0)),
        ("a nanoradian off the axis", utm, DVec3::new(1e-9, 1.0, 0.0)),
        ("half a radian off the axis, at 10^9 m", DVec3::splat(1e9), DVec3::new(0.5, 1.0, 0.0)),
        ("right behind", utm, DVec3::NEG_Y),
    ];
    for (case, eye, step) in places {
        let view = view(eye, eye + DVec3::Y);
        let center = eye + 100.0 * step;
        let found = Optics::new(&view).priority(center, 50.0);
        let to = unit(&minus(&big3(center), &big3(eye)));
        let forward = unit(&minus(&big3(view.camera.target), &big3(eye)));
        let cosine = dot(&to, &forward);
        // Of unit vectors of 512 bits, which are a little longer or shorter than one.
        let angle = if cosine >= whole(1) {
            whole(0)
        } else if cosine <= whole(-1) {
            whole(-1).acos()
        } else {
            cosine.acos()
        };
        let exact = whole(50) / (angle + whole(1));
        rows.push(Row::new(
            case,
            (relative(found, &exact), "of the priority"),
            (TOLERANCE, TURN),
            REFERENCE,
        ));
    }
    rows.extend(budgets()?);
    Ok(rows)
}

/// Nodes straight ahead, whose cosine rounding takes beyond one.
fn dead_centre() -> Row {
    let (mut ours, mut clamped, mut shortcut) = (0.0f64, 0.0f64, 0u32);
    for i in 0..2000 {
        let turn = f64::from(i) * 0.013;
        let target = DVec3::new(turn.sin(), turn.cos(), 0.1 + 0.001 * f64::from(i));
        let view = view(DVec3::ZERO, target);
        let found = Optics::new(&view).priority(target, 50.0);
        // Off the axis by the rounding of the forward vector, at most.
        ours = ours.max(relative(found, &big(50.0)));
        let forward = target.normalize();
        let cosine = forward.dot(target / target.length());
        shortcut += u32::from((50.0 / (cosine.acos() + 1.0)).is_nan());
        clamped = clamped.max(relative(50.0 / (cosine.min(1.0).acos() + 1.0), &big(50.0)));
    }
    Row::new(
        "dead centre, 2000 directions (sorted last elsewhere)",
        (ours, "of the priority"),
        (TOLERANCE, TURN),
        "the size alone: nothing is taken off straight ahead",
    )
    .beside("acos unclamped (nodes without a number)", f64::from(shortcut))
    .beside("acos clamped", clamped)
}

/// Points drawn for the smallest and the largest budget.
fn budgets() -> Result<[Row; 3], StabilityError> {
    let points: Vec<[i64; 3]> =
        (0..3000).map(|i| [i * 7919 % 1000, i * 104_729 % 1000, i % 97]).collect();
    let cloud = Digits { name: "budget", decimals: 2, points };
    let built = Built::of("case.xyz", cloud.text().as_bytes(), 8)?;
    let total = built.dataset.manifest().points;
    let drawn = |budget: u64| -> Result<Option<u64>, StabilityError> {
        let file = |why: String| StabilityError::File { path: built.path.clone(), why };
        let source =
            Source::parse(&built.path.display().to_string()).map_err(|e| file(e.to_string()))?;
        let config = EngineConfig { point_budget: budget, min_size_px: 0.0, ..Default::default() };
        let engine = Engine::start(vec![source], config).map_err(|e| file(e.to_string()))?;
        engine.set_view(view(DVec3::new(5.0, -20.0, 10.0), DVec3::new(5.0, 5.0, 0.0)));
        let plan = engine.wait_settled(PATIENCE).map_err(|e| file(e.to_string()))?;
        Ok((plan.points <= budget).then_some(plan.points))
    };
    let row = |case, found: Option<u64>, expected: u64| {
        let off = found.map_or(f64::INFINITY, |found| found.abs_diff(expected) as f64);
        Row::new(
            case,
            (off, "points"),
            (0.0, "nodes are taken whole, and the sum is an integer"),
            "what fits: nothing, or all there is",
        )
    };
    Ok([
        row("a budget of 1 point", drawn(1)?, 0),
        row("a budget of 10^12 points", drawn(1_000_000_000_000)?, total),
        row("the largest budget there is", drawn(u64::MAX)?, total),
    ])
}
