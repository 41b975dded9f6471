//! Gathering points into blocks, and counting what happened to them on the way.

use super::{BLOCK_POINTS, Block, Positions, ReadReport};

/// Most decimals of a coordinate that a decimal lattice is tried for: a nanometre where the unit
/// is the metre. Longer fractions are binary numbers printed out (`0.60088399999999997`).
const MAX_DECIMALS: u8 = 9;

/// Gathers points with float coordinates into blocks of at most [`BLOCK_POINTS`].
///
/// Per point: [`row`](Self::row), fill it, then [`keep`](Self::keep); a row that is not kept is
/// used again.
pub(super) struct Gather {
    row_bytes: usize,
    positions: Vec<[f64; 3]>,
    attributes: Vec<u8>,
    blocks: Vec<Block>,
    /// What happened so far.
    pub tally: Tally,
}

/// Counts over points read, summed over the parts of a file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Tally {
    /// Points met, kept or not.
    pub points: u64,
    /// Points dropped because a coordinate is NaN or infinite.
    pub not_finite: u64,
    /// Colour components that were NaN, out of range or (integer colours) had a fraction.
    pub altered_colors: u64,
    /// Most decimals of a coordinate in the text; 0 for binary coordinates.
    pub decimals: u8,
}

impl Gather {
    /// Expects about `points` points with `row_bytes` bytes of attributes each.
    pub fn new(row_bytes: usize, points: usize) -> Self {
        let points = points.min(BLOCK_POINTS);
        Self {
            row_bytes,
            positions: Vec::with_capacity(points),
            attributes: Vec::with_capacity(points * row_bytes),
            blocks: Vec::new(),
            tally: Tally::default(),
        }
    }

    /// The next point's attributes, all zero.
    #[inline]
    pub fn row(&mut self) -> &mut [u8] {
        let start = self.positions.len() * self.row_bytes;
        self.attributes.truncate(start);
        self.attributes.resize(start + self.row_bytes, 0);
        &mut self.attributes[start..]
    }

    /// Keeps the point of the last [`row`](Self::row), or drops and counts it where a coordinate is
    /// not finite.
    #[inline]
    pub fn keep(&mut self, position: [f64; 3]) {
        self.tally.points += 1;
        if !position.iter().all(|c| c.is_finite()) {
            self.tally.not_finite += 1;
            return;
        }
        self.positions.push(position);
        if self.positions.len() == BLOCK_POINTS {
            self.cut();
        }
    }

    /// The blocks, none of them empty.
    pub fn finish(mut self) -> (Vec<Block>, Tally) {
        if !self.positions.is_empty() {
            self.cut();
        }
        (self.blocks, self.tally)
    }

    #[cold]
    fn cut(&mut self) {
        let mut attributes = std::mem::take(&mut self.attributes);
        attributes.truncate(self.positions.len() * self.row_bytes);
        let positions = Positions::Float(std::mem::take(&mut self.positions));
        self.blocks.push(Block { positions, attributes });
    }
}

impl Tally {
    /// Adds the counts of another part of the file.
    pub fn add(&mut self, other: Self) {
        self.points += other.points;
        self.not_finite += other.not_finite;
        self.altered_colors += other.altered_colors;
        self.decimals = self.decimals.max(other.decimals);
    }

    /// The report of a reader; `text` tells that coordinates were decimal text.
    pub fn report(&self, text: bool) -> ReadReport {
        let mut report = ReadReport { points_read: self.points, ..ReadReport::default() };
        if self.not_finite > 0 {
            report.dropped.push(("coordinate is NaN or infinite".to_owned(), self.not_finite));
        }
        if self.altered_colors > 0 {
            report.warnings.push(format!(
                "{} colour components were out of range or no whole number; the nearest colour was \
                 taken",
                self.altered_colors
            ));
        }
        let kept = self.points > self.not_finite;
        report.decimals = (text && kept && self.decimals <= MAX_DECIMALS).then_some(self.decimals);
        report
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cuts_blocks_and_drops_what_is_not_finite() {
        let mut gather = Gather::new(1, 10);
        for i in 0..=BLOCK_POINTS {
            gather.row()[0] = u8::try_from(i % 251).expect("small");
            gather.keep([1.0, if i == 3 { f64::NAN } else { 2.0 }, 3.0]);
        }
        gather.row()[0] = 7;
        let (blocks, tally) = gather.finish();
        assert_eq!(blocks.len(), 1);
        assert_eq!(blocks[0].positions.len(), BLOCK_POINTS);
        assert_eq!(blocks[0].attributes.len(), BLOCK_POINTS);
        assert_eq!(blocks[0].attributes[..5], [0, 1, 2, 4, 5]);
        assert_eq!((tally.points, tally.not_finite), (BLOCK_POINTS as u64 + 1, 1));
        assert_eq!(tally.report(false).dropped, [("coordinate is NaN or infinite".to_owned(), 1)]);
    }

    #[test]
    fn decimals_are_known_only_of_text_and_only_up_to_nine() {
        let tally = Tally { points: 1, decimals: 9, ..Tally::default() };
        assert_eq!(tally.report(true).decimals, Some(9));
        assert_eq!(tally.report(false).decimals, None);
        assert_eq!(Tally { decimals: 10, ..tally }.report(true).decimals, None);
        assert_eq!(Tally { points: 0, ..tally }.report(true).decimals, None);
    }
}
