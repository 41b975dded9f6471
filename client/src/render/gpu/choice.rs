//! Which of two ways to draw is the faster one: by what they took in earlier frames.

use std::{collections::HashMap, time::Duration};

use lodestream_shaders::Footprint;

/// Frames between two looks at the slower way: circumstances change.
const LOOK_AGAIN: u32 = 240;

/// What frames are alike in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Kind {
    footprint: Footprint,
    /// Points and pixels, as powers of two.
    points: u32,
    pixels: u32,
}

impl Kind {
    pub const fn new(footprint: Footprint, points: u64, pixels: u64) -> Self {
        Self { footprint, points: power(points), pixels: power(pixels) }
    }
}

#[derive(Debug, Clone, Copy, Default)]
struct Times {
    /// Seconds per frame by rasteriser and compute; `None` where it was never measured.
    seconds: [Option<f64>; 2],
    frames: u32,
}

/// Remembers frame times.
#[derive(Debug, Default)]
pub struct Choice {
    times: HashMap<Kind, Times>,
}

impl Choice {
    /// Whether the next frame of that kind is drawn by compute. Where nothing is known compute goes
    /// first, then the rasteriser.
    pub fn by_compute(&mut self, kind: Kind) -> bool {
        let times = self.times.entry(kind).or_default();
        times.frames += 1;
        match times.seconds {
            [_, None] => true,
            [None, _] => false,
            [Some(raster), Some(compute)] => {
                let faster = compute <= raster;
                if times.frames.is_multiple_of(LOOK_AGAIN) { !faster } else { faster }
            }
        }
    }

    /// A frame was drawn.
    pub fn took(&mut self, kind: Kind, by_compute: bool, time: Duration) {
        let known = &mut self.times.entry(kind).or_default().seconds[usize::from(by_compute)];
        let seconds = time.as_secs_f64();
        // The first frame of a kind compiles shaders: what comes later counts more.
        *known = Some(known.map_or(seconds, |before| 0.25 * before + 0.75 * seconds));
    }
}

const fn power(number: u64) -> u32 {
    u64::BITS - number.leading_zeros()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_faster_way_is_taken_once_both_were_tried() {
        for (compute_ms, raster_ms) in [(3, 8), (8, 3)] {
            let mut choice = Choice::default();
            let kind = Kind::new(Footprint::Circle, 1_000_000, 1 << 20);
            let mut by_compute = 0;
            for _ in 0..100 {
                let way = choice.by_compute(kind);
                by_compute += u32::from(way);
                let ms = if way { compute_ms } else { raster_ms };
                choice.took(kind, way, Duration::from_millis(ms));
            }
            assert_eq!(by_compute, if compute_ms < raster_ms { 99 } else { 1 });
        }
    }

    #[test]
    fn the_slower_way_gets_another_chance() {
        let mut choice = Choice::default();
        let kind = Kind::new(Footprint::Point, 1000, 1000);
        let mut raster_ms = 50;
        let mut last = true;
        for frame in 0..2000 {
            last = choice.by_compute(kind);
            choice.took(kind, last, Duration::from_millis(if last { 10 } else { raster_ms }));
            if frame == 500 {
                raster_ms = 1;
            }
        }
        assert!(!last, "the rasteriser became faster");
    }
}
