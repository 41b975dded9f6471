//! Camera paths: recorded by hand, played back, exported as pictures.

use std::time::{Duration, Instant};

use crate::{
    camera::{Camera, Projection},
    path::{CameraPath, KeyFrame, Lens, PathError},
};

/// Between two keys of a recording.
const STEP: Duration = Duration::from_millis(250);

/// Of a movement, before its first picture.
const FRAME: Duration = Duration::from_millis(16);

/// Longest recording.
const LONGEST: Duration = Duration::from_secs(3600);

/// A recording under way.
#[derive(Debug, Clone)]
pub struct Recorder {
    begin: Instant,
    keys: Vec<KeyFrame>,
}

impl Recorder {
    /// Begins with the camera as it is.
    #[must_use]
    pub fn start(camera: &Camera, now: Instant) -> Self {
        Self { begin: now, keys: vec![key(camera, 0.0)] }
    }

    /// Notes the camera, where it is time to; returns whether there is room for more.
    pub fn note(&mut self, camera: &Camera, now: Instant) -> bool {
        let time = now.saturating_duration_since(self.begin);
        let last = self.keys.last().map_or(0.0, |key| key.time);
        let since = time.as_secs_f64() - last;
        if since >= STEP.as_secs_f64() {
            // Nothing was drawn meanwhile, because nothing moved: a rest ends where the movement begins.
            if since > 2.0 * STEP.as_secs_f64()
                && let Some(&rest) = self.keys.last()
                && key(camera, rest.time) != rest
            {
                self.keys.push(KeyFrame { time: time.as_secs_f64() - FRAME.as_secs_f64(), ..rest });
            }
            self.push(camera, time);
        }
        time < LONGEST
    }

    fn push(&mut self, camera: &Camera, time: Duration) {
        let key = key(camera, time.as_secs_f64());
        let rests = |other: &KeyFrame| KeyFrame { time: key.time, ..*other } == key;
        // Of a rest only its begin and its end are kept: curves between them stay where they are.
        if let [.., before, last] = self.keys.as_slice()
            && rests(before)
            && rests(last)
        {
            self.keys.pop();
        }
        self.keys.push(key);
    }

    /// Ends; the part after the last change of the projection, which a path cannot hold.
    ///
    /// # Errors
    /// [`PathError`] where it is too short to be a path.
    pub fn stop(mut self, camera: &Camera, now: Instant) -> Result<CameraPath, PathError> {
        let time = now.saturating_duration_since(self.begin);
        let last = self.keys.last().map_or(0.0, |key| key.time);
        if time.as_secs_f64() - last > 1e-3 {
            self.push(camera, time);
        }
        let is_alike = |pair: &[KeyFrame]| {
            std::mem::discriminant(&pair[0].lens) == std::mem::discriminant(&pair[1].lens)
        };
        let cut = self.keys.windows(2).rposition(|pair| !is_alike(pair)).map_or(0, |at| at + 1);
        let keys = self.keys.split_off(cut);
        CameraPath::new(keys, false)
    }
}

fn key(camera: &Camera, time: f64) -> KeyFrame {
    let lens = match camera.projection {
        Projection::Perspective { fov_y } => Lens::FovYDegrees(fov_y.to_degrees()),
        Projection::Orthographic { height } => Lens::OrthographicHeight(height),
    };
    KeyFrame { time, position: camera.eye, target: camera.target, up: camera.up, lens, jump: false }
}

/// A path that is being followed.
#[derive(Debug, Clone)]
pub struct Player {
    begin: Instant,
}

impl Player {
    /// Begins at the path's first key.
    #[must_use]
    pub fn start(now: Instant) -> Self {
        Self { begin: now }
    }

    /// The camera now, and whether the path goes on.
    #[must_use]
    pub fn camera(&self, path: &CameraPath, now: Instant) -> (Camera, bool) {
        let seconds = now.saturating_duration_since(self.begin).as_secs_f64();
        let goes_on = path.is_loop() || seconds < path.duration();
        (path.at(path.start() + seconds), goes_on)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn camera(x: f64) -> Camera {
        Camera {
            eye: DVec3::new(x, -5.0, 2.0),
            target: DVec3::new(x, 0.0, 0.0),
            up: DVec3::Z,
            projection: Projection::Perspective { fov_y: 1.0 },
        }
    }

    #[test]
    fn what_is_recorded_is_played() {
        let start = Instant::now();
        let at = |ms: u64| start + Duration::from_millis(ms);
        let mut recorder = Recorder::start(&camera(0.0), start);
        for ms in (10..=2000).step_by(10) {
            assert!(recorder.note(&camera(ms as f64), at(ms)));
        }
        let path = recorder.stop(&camera(2100.0), at(2100)).expect("a path");
        assert!((path.duration() - 2.1).abs() < 1e-9);
        assert!((8..=10).contains(&path.keys().len()), "{}", path.keys().len());
        let player = Player::start(start);
        for ms in [0, 700, 1300, 2100] {
            let (shown, _) = player.camera(&path, at(ms));
            assert!((shown.eye.x - ms as f64).abs() < 15.0, "{ms}: {}", shown.eye);
        }
        assert!(player.camera(&path, at(2000)).1 && !player.camera(&path, at(2200)).1);
    }

    #[test]
    fn a_rest_takes_two_keys_however_long_it_is() {
        let start = Instant::now();
        let mut recorder = Recorder::start(&camera(0.0), start);
        for second in 1..100 {
            recorder.note(&camera(0.0), start + Duration::from_secs(second));
        }
        let end = start + Duration::from_secs(100);
        assert_eq!(recorder.stop(&camera(1.0), end).expect("a path").keys().len(), 3);
    }

    #[test]
    fn only_what_comes_after_the_last_change_of_projection_is_kept() {
        let start = Instant::now();
        let mut recorder = Recorder::start(&camera(0.0), start);
        let flat =
            |x: f64| Camera { projection: Projection::Orthographic { height: 3.0 }, ..camera(x) };
        recorder.note(&flat(1.0), start + Duration::from_millis(300));
        recorder.note(&flat(2.0), start + Duration::from_millis(600));
        let path = recorder.stop(&flat(2.0), start + Duration::from_millis(600)).expect("a path");
        assert_eq!((path.keys().len(), path.start()), (2, 0.3));
    }

    #[test]
    fn a_rest_in_which_nothing_is_drawn_stays_a_rest() {
        let start = Instant::now();
        let mut recorder = Recorder::start(&camera(0.0), start);
        recorder.note(&camera(1.0), start + Duration::from_secs(10));
        let path =
            recorder.stop(&camera(2.0), start + Duration::from_millis(10_300)).expect("a path");
        assert!((path.at(9.9).eye - camera(0.0).eye).length() < 1e-9);
        assert!((path.at(10.0).eye - camera(1.0).eye).length() < 1e-9);
    }
}
