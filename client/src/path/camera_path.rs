//! The keys of a path, and the camera at a time.

use glam::DVec3;

use super::{
    PathError,
    key::{KeyFrame, SHORTEST_STEP},
    spline::{self, Hermite},
};
use crate::camera::Camera;

/// Most keys of a path.
pub const MAX_KEYS: usize = 1_000_000;

/// Least distance of a key's target from its position, as a part of the path's largest coordinate:
/// some ten thousand steps of an f64 there, so that a direction can be told.
pub(super) const NEAREST_TARGET: f64 = 1e-11;

/// Where position and target come nearer to each other than this part of the nearer key's distance,
/// the direction between them is no longer one that the keys mean.
const TOO_NEAR: f64 = 1e-3;

/// A camera on its way through key frames: always possible, whatever the time.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraPath {
    name: Option<String>,
    is_loop: bool,
    keys: Vec<KeyFrame>,
    /// At each key, per second.
    velocities: Vec<Velocity>,
}

/// How fast the camera moves at a key, per second. Not of `up`, which turns at a constant speed
/// between two keys.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Velocity {
    position: DVec3,
    target: DVec3,
    /// Of the logarithm of the lens's number.
    ln_lens: f64,
}

impl CameraPath {
    /// A path through `keys`. In a loop the last key is where the first is, and the camera goes on
    /// from there without a bend.
    ///
    /// # Errors
    /// [`PathError::Key`] for the first key that cannot be one, [`PathError::Keys`] where there are
    /// none or more than [`MAX_KEYS`].
    pub fn new(keys: Vec<KeyFrame>, is_loop: bool) -> Result<Self, PathError> {
        check(&keys, is_loop)?;
        let velocities = (0..keys.len()).map(|i| velocity_at(&keys, is_loop, i)).collect();
        Ok(Self { name: None, is_loop, keys, velocities })
    }

    /// The same path with a name.
    #[must_use]
    pub fn with_name(self, name: impl Into<String>) -> Self {
        Self { name: Some(name.into()), ..self }
    }

    /// What it is called.
    #[must_use]
    pub fn name(&self) -> Option<&str> {
        self.name.as_deref()
    }

    /// Whether it begins anew where it ends.
    #[must_use]
    pub const fn is_loop(&self) -> bool {
        self.is_loop
    }

    /// The keys, by time; at least one.
    #[must_use]
    pub fn keys(&self) -> &[KeyFrame] {
        &self.keys
    }

    /// Time of the first key, in seconds.
    #[must_use]
    pub fn start(&self) -> f64 {
        self.keys[0].time
    }

    /// Seconds from the first key to the last; of a loop, one round.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.keys[self.keys.len() - 1].time - self.start()
    }

    /// `frames` times evenly spread: from the first key to the last one; in a loop, one round,
    /// without its end, which is its start.
    pub fn times(&self, frames: u32) -> impl Iterator<Item = f64> + use<> {
        let steps = if self.is_loop { frames } else { frames.saturating_sub(1) };
        let (start, duration) = (self.start(), self.duration());
        let share = move |frame| f64::from(frame) / f64::from(steps.max(1));
        (0..frames).map(move |frame| start + duration * share(frame))
    }

    /// The camera at `time` in seconds. Before the first key it is there and after the last one
    /// there; in a loop, it has gone or will go round. No number counts as the start.
    #[must_use]
    pub fn at(&self, time: f64) -> Camera {
        let (start, duration) = (self.start(), self.duration());
        let time = if self.is_loop && !(start..=start + duration).contains(&time) {
            start + (time - start).rem_euclid(duration)
        } else {
            time
        };
        let next = self.keys.partition_point(|key| key.time <= time);
        // Before the first key, or no number.
        let Some(index) = next.checked_sub(1) else { return self.keys[0].camera() };
        let from = &self.keys[index];
        match self.keys.get(next) {
            Some(to) if !to.jump && time > from.time => self.between(index, from, to, time),
            _ => from.camera(),
        }
    }

    fn between(&self, index: usize, from: &KeyFrame, to: &KeyFrame, time: f64) -> Camera {
        let seconds = to.time - from.time;
        let s = (time - from.time) / seconds;
        let (start, end) = (&self.velocities[index], &self.velocities[index + 1]);
        let weight = Hermite::at(s);
        let bend =
            |start: DVec3, end: DVec3| seconds * (weight.first * start + weight.second * end);
        let position = from.position
            + weight.step * (to.position - from.position)
            + bend(start.position, end.position);
        let target =
            from.target + weight.step * (to.target - from.target) + bend(start.target, end.target);
        let nearer = if s < 0.5 { from } else { to };
        let nearest = TOO_NEAR * from.view().length().min(to.view().length());
        let target =
            if (target - position).length() < nearest { position + nearer.view() } else { target };
        let (low, high) = (from.lens.value(), to.lens.value());
        let ln_lens = libm::log(low)
            + weight.step * ln_ratio(from, to)
            + seconds * (weight.first * start.ln_lens + weight.second * end.ln_lens);
        // The curve stays between the keys; rounding need not.
        let lens = libm::exp(ln_lens).clamp(low.min(high), low.max(high));
        let up = |key: &KeyFrame| key.up.try_normalize().unwrap_or(DVec3::Z);
        let up = spline::turn(up(from), up(to), from.view().normalize(), s);
        KeyFrame { time, position, target, up, lens: from.lens.with(lens), jump: false }.camera()
    }
}

fn ln_ratio(from: &KeyFrame, to: &KeyFrame) -> f64 {
    libm::log(to.lens.value()) - libm::log(from.lens.value())
}

/// The velocities at key `index`: by the keys on both sides; at an end of the path and beside a
/// jump, that of the one chord there is; none where there is none.
fn velocity_at(keys: &[KeyFrame], is_loop: bool, index: usize) -> Velocity {
    let last = keys.len() - 1;
    // In a loop the first key and the last one are the same place.
    let before = if is_loop && index == 0 { last } else { index };
    let after = if is_loop && index == last { 0 } else { index };
    // Pairs of keys that are joined by a curve.
    let joined = |from: usize| {
        let (from, to) = (keys.get(from)?, keys.get(from + 1)?);
        (!to.jump).then_some((from, to))
    };
    let chord_before = before.checked_sub(1).and_then(joined);
    let chord_after = joined(after);
    let vector = |place: fn(&KeyFrame) -> DVec3| {
        let chord =
            |(from, to): (&KeyFrame, &KeyFrame)| (place(to) - place(from), to.time - from.time);
        match (chord_before.map(chord), chord_after.map(chord)) {
            (Some(before), Some(after)) => spline::velocity(before, after),
            (Some((step, seconds)), None) | (None, Some((step, seconds))) => step / seconds,
            (None, None) => DVec3::ZERO,
        }
    };
    let ln_chord = |(from, to): (&KeyFrame, &KeyFrame)| (ln_ratio(from, to), to.time - from.time);
    let ln_lens = match (chord_before.map(ln_chord), chord_after.map(ln_chord)) {
        (Some(before), Some(after)) => spline::monotone_velocity(before, after),
        (Some((step, seconds)), None) | (None, Some((step, seconds))) => step / seconds,
        (None, None) => 0.0,
    };
    Velocity { position: vector(|key| key.position), target: vector(|key| key.target), ln_lens }
}

fn check(keys: &[KeyFrame], is_loop: bool) -> Result<(), PathError> {
    let (Some(first), Some(last)) = (keys.first(), keys.last()) else {
        return Err(PathError::Keys("a path has at least one key; this has none".into()));
    };
    if keys.len() > MAX_KEYS {
        let count = keys.len();
        return Err(PathError::Keys(format!("{count} keys: a path has at most {MAX_KEYS}")));
    }
    let numbered = |index: usize, outcome: Result<(), String>| {
        outcome.map_err(|why| PathError::Key { number: index + 1, why })
    };
    for (index, key) in keys.iter().enumerate() {
        numbered(index, key.check())?;
    }
    let reach = keys.iter().map(KeyFrame::reach).fold(0.0, f64::max);
    for (index, key) in keys.iter().enumerate() {
        let before = index.checked_sub(1).map(|before| &keys[before]);
        numbered(index, check_beside(key, first, before, reach))?;
    }
    if is_loop {
        let number = keys.len();
        let bad = |why: &str| Err(PathError::Key { number, why: why.into() });
        if number == 1 {
            return bad("a loop has at least two keys, the last of which is where the first is");
        }
        if !first.is_same_view(last) {
            return bad("a loop ends where it begins: give the last key position, target, up and \
                 projection of key 1, or leave out loop");
        }
    }
    Ok(())
}

/// What is wrong with a key among the others.
fn check_beside(
    key: &KeyFrame,
    first: &KeyFrame,
    before: Option<&KeyFrame>,
    reach: f64,
) -> Result<(), String> {
    match before {
        None if key.jump => return Err("nothing comes before it: leave out jump".into()),
        Some(before) if key.time - before.time < SHORTEST_STEP => {
            return Err(format!(
                "time {} is not after that of the key before, {}, by a microsecond at least",
                key.time, before.time
            ));
        }
        _ => {}
    }
    if std::mem::discriminant(&key.lens) != std::mem::discriminant(&first.lens) {
        return Err(format!(
            "{}, but key 1 is {}: a path is one or the other, so make two of it",
            key.lens.name(),
            first.lens.name()
        ));
    }
    let distance = key.view().length();
    let nearest = NEAREST_TARGET * reach;
    if distance < nearest {
        return Err(format!(
            "position and target are {distance:e} apart: beside the path's coordinates of up to \
             {reach:e} that tells no direction; move them at least {nearest:e} apart"
        ));
    }
    Ok(())
}
