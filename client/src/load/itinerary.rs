//! A camera path as a timetable: which view is due when, whatever the server does.

use std::time::Duration;

use crate::{
    engine::View,
    path::{CameraPath, KeyFrame},
};

/// A view and when it is due.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stop {
    /// Since the path's start.
    pub at: Duration,
    /// What is to be seen from then on.
    pub view: View,
    /// Whether the camera has not come here by moving.
    pub is_jump: bool,
}

/// All views of a path, in time. Not empty.
#[derive(Debug, Clone, PartialEq)]
pub struct Itinerary {
    stops: Vec<Stop>,
    duration: Duration,
    /// Whether the first stop follows the last one without a jump.
    is_loop: bool,
}

impl Itinerary {
    /// `views_per_second` while the camera moves, and one at each jump; none while it rests.
    #[must_use]
    pub fn new(path: &CameraPath, size_px: [u32; 2], views_per_second: f64) -> Self {
        let (start, seconds) = (path.start(), path.duration());
        let jumps =
            path.keys().iter().filter(|key| key.jump).map(|key: &KeyFrame| key.time - start);
        let mut times: Vec<(f64, bool)> = jumps.map(|time| (time, true)).collect();
        let steps = (seconds * views_per_second).ceil();
        times.extend((0..steps as u32).map(|step| (f64::from(step) / views_per_second, false)));
        // Of two at the same time the jump comes first, and the other brings nothing new.
        times.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let mut stops: Vec<Stop> = Vec::new();
        for (time, is_jump) in times {
            let view = View { camera: path.at(start + time), size_px };
            if is_jump || stops.last().is_none_or(|last| last.view != view) {
                stops.push(Stop { at: Duration::from_secs_f64(time), view, is_jump });
            }
        }
        let duration = Duration::from_secs_f64(seconds);
        Self { stops, duration, is_loop: path.is_loop() }
    }

    /// From the first view to the end of the last.
    #[must_use]
    pub const fn duration(&self) -> Duration {
        self.duration
    }

    /// Views of one round.
    #[must_use]
    pub fn views(&self) -> usize {
        self.stops.len()
    }

    /// Jumps of one round, besides its beginning.
    #[must_use]
    pub fn jumps(&self) -> usize {
        self.stops.iter().filter(|stop| stop.is_jump).count()
    }

    /// One round from stop number `first` (any number) on, the path's end being followed by its
    /// start: by a jump, where the path is no loop. Times count from the beginning of this round.
    pub fn round(&self, first: usize) -> impl Iterator<Item = Stop> {
        let count = self.stops.len();
        let first = first % count;
        let begin = self.stops[first].at;
        (first..first + count).map(move |index| {
            let stop = self.stops[index % count];
            let wrapped = if index < count { Duration::ZERO } else { self.duration };
            let is_seam = index % count == 0 && !self.is_loop;
            Stop { at: stop.at + wrapped - begin, is_jump: stop.is_jump || is_seam, ..stop }
        })
    }

    /// Where client number `client` begins: spread over the path as evenly as can be for any number of
    /// clients, by multiples of the golden ratio (Weyl 1916).
    #[must_use]
    pub fn offset(&self, client: usize) -> usize {
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let share = (client as f64 * GOLDEN).fract();
        let at = self.duration.mul_f64(share);
        self.stops.partition_point(|stop| stop.at <= at).saturating_sub(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::{Extent, PathSource};

    fn itinerary(line: &str, rate: f64) -> Itinerary {
        let extent = Extent::new([0.0; 3], [10.0, 8.0, 1.0]).expect("an extent");
        let path = PathSource::open(line).expect("a generator").path(&extent).expect("a path");
        Itinerary::new(&path, [320, 200], rate)
    }

    #[test]
    fn a_camera_that_moves_is_seen_at_the_rate_and_one_that_rests_once() {
        let orbit = itinerary("orbit?seconds=4", 5.0);
        assert_eq!((orbit.views(), orbit.jumps(), orbit.duration().as_secs()), (20, 0, 4));
        let teleport = itinerary("teleport?seconds=10&stops=4", 7.0);
        assert_eq!((teleport.views(), teleport.jumps()), (4, 3));
        let times: Vec<_> = teleport.round(0).map(|stop| stop.at.as_secs_f64()).collect();
        assert_eq!(times, [0.0, 2.5, 5.0, 7.5], "at the jumps, not at the next tick");
    }

    #[test]
    fn a_round_from_anywhere_has_every_view_once_and_takes_as_long() {
        let itinerary = itinerary("teleport?seconds=10&stops=5", 3.0);
        for first in 0..12 {
            let round: Vec<_> = itinerary.round(first).collect();
            assert_eq!(round.len(), itinerary.views());
            assert!(round[0].at.is_zero());
            assert!(round.windows(2).all(|pair| pair[0].at < pair[1].at));
            assert!(round[round.len() - 1].at < itinerary.duration());
            assert!(round.iter().all(|stop| stop.is_jump), "the seam of this path is a jump, too");
        }
    }

    #[test]
    fn clients_begin_all_over_the_path() {
        let itinerary = itinerary("orbit?seconds=10", 10.0);
        let mut quarters = [0; 4];
        (0..100).for_each(|client| quarters[itinerary.offset(client) * 4 / itinerary.views()] += 1);
        assert!(quarters.iter().all(|&count| (20..=30).contains(&count)), "{quarters:?}");
    }
}
