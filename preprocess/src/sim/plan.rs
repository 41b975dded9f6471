//! How a wished number of points becomes angular steps, and work that can be done in any order.
//!
//! How many shots return is known only after shooting them, but exactly `n` points are wanted, in
//! bounded memory. So the chances of return are estimated on a coarse grid once; they fix the
//! angular step (a little finer than needed) and cut every station's turn into *sectors* of an
//! exact number of points. A sector that gets more drops the surplus evenly; one that gets
//! fewer shoots again between its grid lines. No sector needs to know of another.

use std::{f64::consts::TAU, sync::LazyLock};

use super::{
    random::Random,
    scanner::{Aim, ELEVATIONS, STATIONS, Sample, Scanner},
};

/// Points per sector, about.
const SECTOR_POINTS: u64 = 1 << 14;
/// Shots beyond what the estimate asks for: dropping a few is cheaper than shooting again.
const SURPLUS: f64 = 1.02;
/// The estimate's grid: 2 degrees.
const COARSE: (usize, usize) = (180, 76);

/// Expected share of shots that return, per station and per bin of azimuth.
static CHANCES: LazyLock<Vec<[f64; COARSE.0]>> = LazyLock::new(|| {
    let scanner = Scanner::courtyard();
    let (low, high) = ELEVATIONS;
    let chance = |station, column: usize, row: usize| {
        let azimuth = (column as f64 + 0.5) / COARSE.0 as f64 * TAU;
        let elevation = low + (high - low) * (row as f64 + 0.5) / COARSE.1 as f64;
        f64::from(scanner.chance(station, Aim { azimuth, elevation: elevation.to_radians() }))
    };
    STATIONS
        .iter()
        .map(|station| {
            std::array::from_fn(|column| {
                (0..COARSE.1).map(|row| chance(station, column, row)).sum::<f64>() / COARSE.1 as f64
            })
        })
        .collect()
});

/// One station's share of the scan.
#[derive(Debug, Clone, PartialEq)]
struct Turn {
    station: usize,
    points: u64,
    columns: u64,
    rows: u64,
    sectors: u64,
    /// Number of its first sector.
    first_sector: u64,
}

/// The whole scan, cut into sectors.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    seed: u64,
    turns: Vec<Turn>,
    sectors: u64,
}

/// One sector: part of a station's turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sector {
    station: usize,
    points: u64,
    /// Part of the full circle.
    from: f64,
    to: f64,
    columns: u64,
    rows: u64,
    number: u64,
    seed: u64,
}

impl Plan {
    /// A plan for exactly `points` points.
    #[must_use]
    pub fn new(points: u64, seed: u64) -> Self {
        let degrees_high = ELEVATIONS.1 - ELEVATIONS.0;
        // Points that each station returns per square degree of its grid, up to one factor.
        let yields: Vec<f64> = STATIONS
            .iter()
            .zip(CHANCES.iter())
            .map(|(station, chances)| {
                let mean = chances.iter().sum::<f64>() / chances.len() as f64;
                mean * 360.0 * degrees_high / (station.coarseness * station.coarseness)
            })
            .collect();
        let total: f64 = yields.iter().sum();
        let step = (total / (points as f64 * SURPLUS)).sqrt();
        let (mut turns, mut sectors, mut before, mut assigned) = (Vec::new(), 0, 0.0, 0);
        for (station, share) in yields.iter().enumerate() {
            before += share;
            let last = station + 1 == STATIONS.len();
            let until = if last {
                points
            } else {
                ((points as f64 * before / total) as u64).clamp(assigned, points)
            };
            let count = until - assigned;
            assigned = until;
            let step = step * STATIONS[station].coarseness;
            let turn = Turn {
                station,
                points: count,
                columns: ((360.0 / step).round() as u64).max(1),
                rows: ((degrees_high / step).round() as u64).max(1),
                sectors: count.div_ceil(SECTOR_POINTS),
                first_sector: sectors,
            };
            sectors += turn.sectors;
            turns.push(turn);
        }
        Self { seed, turns, sectors }
    }

    /// Number of sectors.
    #[must_use]
    pub fn sectors(&self) -> u64 {
        self.sectors
    }

    /// Sector `number`, below [`sectors`](Self::sectors). They follow each other as the scanner turns.
    #[must_use]
    pub fn sector(&self, number: u64) -> Sector {
        let after = self.turns.partition_point(|turn| turn.first_sector <= number);
        // Turns without points have no sectors, and begin where the next one begins.
        let turn = &self.turns[after - 1];
        let k = number - turn.first_sector;
        let share = |k: u64| u128::from(turn.points) * u128::from(k) / u128::from(turn.sectors);
        Sector {
            station: turn.station,
            points: u64::try_from(share(k + 1) - share(k)).expect("a share of a u64"),
            from: azimuth_of(turn.station, k as f64 / turn.sectors as f64),
            to: azimuth_of(turn.station, (k + 1) as f64 / turn.sectors as f64),
            columns: turn.columns,
            rows: turn.rows,
            number,
            seed: self.seed,
        }
    }
}

/// The part of the circle within which a station gets `share` of its points.
fn azimuth_of(station: usize, share: f64) -> f64 {
    if share >= 1.0 {
        return 1.0;
    }
    let chances = &CHANCES[station];
    let mut rest = share * chances.iter().sum::<f64>();
    for (bin, &chance) in chances.iter().enumerate() {
        if rest < chance {
            return (bin as f64 + rest / chance) / chances.len() as f64;
        }
        rest -= chance;
    }
    1.0
}

impl Sector {
    /// The station it belongs to: an index into [`STATIONS`].
    #[must_use]
    pub fn station(&self) -> usize {
        self.station
    }

    /// Shoots the sector: exactly its points, in scan order.
    #[must_use]
    pub fn scan(&self, scanner: &Scanner) -> Vec<Sample> {
        let station = &STATIONS[self.station];
        let (low, high) = (ELEVATIONS.0.to_radians(), ELEVATIONS.1.to_radians());
        let steps = (TAU / self.columns as f64, (high - low) / self.rows as f64);
        // The scanner starts each turn somewhere else, as the seed says.
        let start = Random::of([self.seed, self.station as u64, 0, 1]).unit_f64();
        let column_at = |part: f64| (part * self.columns as f64 - start).ceil().max(0.0) as u64;
        let end = if self.to >= 1.0 { self.columns } else { column_at(self.to) };
        let wanted = usize::try_from(self.points).expect("a sector's points fit in memory");
        let mut samples = Vec::with_capacity(wanted + wanted / 8);
        for column in column_at(self.from)..end {
            let azimuth = (column as f64 + start) * steps.0;
            for row in 0..self.rows {
                let aim = Aim { azimuth, elevation: low + (row as f64 + 0.5) * steps.1 };
                let mut random = Random::of([self.seed, self.station as u64, column, row + 2]);
                samples.extend(scanner.shoot(station, aim, steps, &mut random));
            }
        }
        thin(&mut samples, wanted);
        let mut attempt = 0;
        while samples.len() < wanted {
            let mut random = Random::of([self.seed, self.number, attempt, u64::MAX]);
            let azimuth = (self.from + (self.to - self.from) * random.unit_f64()) * TAU;
            // Straight down there is ground everywhere: after some misses a shot goes there, so
            // that this ends whatever the scene.
            let patient = attempt < 64 * (self.points + 1);
            let elevation = if patient { low + (high - low) * random.unit_f64() } else { low };
            samples.extend(scanner.shoot(
                station,
                Aim { azimuth, elevation },
                (0.0, 0.0),
                &mut random,
            ));
            attempt += 1;
        }
        samples
    }
}

/// Leaves `wanted` of the items, evenly spread, in order; all of them if there are no more.
fn thin<T>(items: &mut Vec<T>, wanted: usize) {
    let found = items.len();
    let mut i = 0;
    // Keeps item i where the number kept so far, wanted * i / found, grows.
    items.retain(|_| {
        i += 1;
        found <= wanted || i * wanted / found != (i - 1) * wanted / found
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sectors_share_out_exactly_the_points_asked_for() {
        for points in [1, 7, 65_537, 2_000_000, 1_000_000_007] {
            let plan = Plan::new(points, 1);
            let sum: u64 = (0..plan.sectors()).map(|i| plan.sector(i).points).sum();
            assert_eq!(sum, points);
            assert!(
                (0..plan.sectors()).all(|i| (1..=SECTOR_POINTS).contains(&plan.sector(i).points))
            );
        }
    }

    #[test]
    fn sectors_of_a_turn_join_without_gap() {
        let plan = Plan::new(1_000_000, 1);
        for i in 1..plan.sectors() {
            let (last, next) = (plan.sector(i - 1), plan.sector(i));
            if last.station == next.station {
                assert_eq!(last.to, next.from);
            } else {
                assert_eq!((last.to, next.from), (1.0, 0.0));
            }
        }
    }

    #[test]
    fn the_estimate_is_close_enough_that_hardly_a_shot_is_wasted() {
        let plan = Plan::new(300_000, 1);
        let shots: u64 = plan.turns.iter().map(|t| t.columns * t.rows).sum();
        let scanner = Scanner::courtyard();
        let mut returns = 0;
        for turn in &plan.turns {
            let whole = Sector { points: 0, ..plan.sector(turn.first_sector) };
            let everything = Sector { from: 0.0, to: 1.0, ..whole };
            returns += everything.shots_returned(&scanner);
        }
        assert!(shots > returns);
        let ratio = returns as f64 / 300_000.0;
        assert!((0.99..1.05).contains(&ratio), "{ratio}");
    }

    #[test]
    fn a_sector_whose_grid_finds_too_little_shoots_again() {
        let scanner = Scanner::courtyard();
        let sparse = Sector { columns: 3, rows: 5, points: 400, ..Plan::new(1000, 1).sector(0) };
        assert_eq!(sparse.scan(&scanner).len(), 400);
    }

    #[test]
    fn thinning_drops_evenly() {
        let mut items: Vec<usize> = (0..1000).collect();
        thin(&mut items, 900);
        assert_eq!(items.len(), 900);
        assert!(items.windows(2).all(|w| w[1] - w[0] <= 2));
        assert!((0..10).all(|i| items.iter().filter(|&&x| x / 100 == i).count() == 90));
        thin(&mut items, 2000);
        assert_eq!(items.len(), 900);
    }

    impl Sector {
        /// Returns on the grid, before any is dropped.
        fn shots_returned(&self, scanner: &Scanner) -> u64 {
            let station = &STATIONS[self.station];
            let (low, high) = (ELEVATIONS.0.to_radians(), ELEVATIONS.1.to_radians());
            let mut count = 0;
            for column in 0..self.columns {
                for row in 0..self.rows {
                    let azimuth = column as f64 / self.columns as f64 * TAU;
                    let elevation = low + (high - low) * (row as f64 + 0.5) / self.rows as f64;
                    let mut random = Random::of([0, 0, column, row]);
                    let aim = Aim { azimuth, elevation };
                    count +=
                        u64::from(scanner.shoot(station, aim, (0.0, 0.0), &mut random).is_some());
                }
            }
            count
        }
    }
}
