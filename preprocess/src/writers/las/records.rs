//! Blocks to point records.

use lodestream_protocol::{Attribute, ScalarType};
use rayon::prelude::*;

use super::plan::{Change, Plan, Step};
use crate::{
    error::{Error, Result},
    writers::{ExportBlock, source::Source},
};

/// Points that a thread turns into records at a time.
const TASK_POINTS: usize = 8192;

/// What a file's header says of its points, gathered on the way.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Tally {
    pub(super) points: u64,
    /// Points by return number: entry 0 counts first returns.
    pub(super) by_return: [u64; 15],
    pub(super) min: [i32; 3],
    pub(super) max: [i32; 3],
}

impl Tally {
    pub(super) const EMPTY: Self =
        Self { points: 0, by_return: [0; 15], min: [i32::MAX; 3], max: [i32::MIN; 3] };

    /// Adds what another tally has counted.
    pub(super) fn merge(&mut self, other: &Self) {
        self.points += other.points;
        for (mine, theirs) in self.by_return.iter_mut().zip(other.by_return) {
            *mine += theirs;
        }
        for a in 0..3 {
            self.min[a] = self.min[a].min(other.min[a]);
            self.max[a] = self.max[a].max(other.max[a]);
        }
    }
}

/// Appends the points of `block` to `records`; `shift` is what is added to lattice coordinates
/// relative to the root cube to make LAS coordinates.
pub(super) fn append(
    plan: &Plan,
    attributes: &[Attribute],
    shift: [i64; 3],
    block: &ExportBlock,
    records: &mut Vec<u8>,
) -> Result<Tally> {
    let sources = plan
        .steps
        .iter()
        .map(|step| {
            let source = Source::find(&attributes[step.attribute], step.attribute, block)?;
            Ok((*step, source))
        })
        .collect::<Result<Vec<(Step, Source)>>>()?;
    let start = records.len();
    records.resize(start + block.positions.len() * plan.record_bytes, 0);
    records[start..]
        .par_chunks_mut(TASK_POINTS * plan.record_bytes)
        .zip(block.positions.par_chunks(TASK_POINTS))
        .enumerate()
        .map(|(task, (records, positions))| {
            let first = task * TASK_POINTS;
            let mut tally = write_positions(positions, shift, records, plan.record_bytes)?;
            for (step, source) in &sources {
                let name = &attributes[step.attribute].name;
                run(step, source, first, records, plan.record_bytes)
                    .map_err(|value| beyond(name, value))?;
                if plan.return_number == Some(step.attribute) {
                    count_returns(*step, records, plan.record_bytes, &mut tally);
                }
            }
            Ok(tally)
        })
        .try_reduce(
            || Tally::EMPTY,
            |mut all, tally| {
                all.merge(&tally);
                Ok(all)
            },
        )
}

fn beyond(name: &str, value: i128) -> Error {
    Error::Setup(format!("attribute {name}: value {value} lies outside the range announced for it"))
}

fn write_positions(
    positions: &[[u32; 3]],
    shift: [i64; 3],
    records: &mut [u8],
    record_bytes: usize,
) -> Result<Tally> {
    let mut tally = Tally { points: positions.len() as u64, ..Tally::EMPTY };
    for (record, position) in records.chunks_exact_mut(record_bytes).zip(positions) {
        for a in 0..3 {
            let steps = i64::from(position[a]) + shift[a];
            let steps = i32::try_from(steps).map_err(|_| {
                Error::Setup(format!(
                    "a point lies outside the bounds announced for the export: {position:?}"
                ))
            })?;
            record[4 * a..4 * a + 4].copy_from_slice(&steps.to_le_bytes());
            tally.min[a] = tally.min[a].min(steps);
            tally.max[a] = tally.max[a].max(steps);
        }
    }
    Ok(tally)
}

/// Writes one attribute of all points; the error is the value that does not fit.
fn run(
    step: &Step,
    source: &Source,
    first: usize,
    records: &mut [u8],
    record_bytes: usize,
) -> Result<(), i128> {
    let at = step.at;
    let points = records.chunks_exact_mut(record_bytes).enumerate();
    match step.change {
        Change::Copy { len } => {
            for (i, record) in points {
                record[at..at + len].copy_from_slice(source.value(first + i));
            }
        }
        Change::Integers { from: ScalarType::U8, to: ScalarType::U16, components, factor } => {
            for (i, record) in points {
                let value = source.value(first + i);
                for (component, &value) in value.iter().enumerate().take(components) {
                    let at = at + 2 * component;
                    let value = u16::from(value) * factor;
                    record[at..at + 2].copy_from_slice(&value.to_le_bytes());
                }
            }
        }
        Change::Integers { from, to, components, factor } => {
            let size = to.size_bytes();
            let lowest = if to.is_signed() { -(1i128 << (8 * size - 1)) } else { 0 };
            let highest = lowest + (1i128 << (8 * size)) - 1;
            for (i, record) in points {
                let values = source.value(first + i).chunks_exact(from.size_bytes());
                for (component, value) in values.enumerate().take(components) {
                    let value = integer(from, value) * i128::from(factor);
                    if !(lowest..=highest).contains(&value) {
                        return Err(value);
                    }
                    let at = at + size * component;
                    // Two's complement: the low bytes are those of the smaller type.
                    record[at..at + size].copy_from_slice(&value.to_le_bytes()[..size]);
                }
            }
        }
        Change::Bits { from, shift, bits } => {
            for (i, record) in points {
                let value = integer(from, source.value(first + i));
                let byte = u8::try_from(value)
                    .ok()
                    .filter(|byte| u16::from(*byte) < 1 << bits)
                    .ok_or(value)?;
                record[at] |= byte << shift;
            }
        }
    }
    Ok(())
}

/// The value of a component of which the plan made sure that it is an integer.
fn integer(scalar: ScalarType, bytes: &[u8]) -> i128 {
    scalar.to_i128(bytes).expect("floats are copied or go to the extra bytes")
}

/// Counts points by the return number that has been written.
fn count_returns(step: Step, records: &[u8], record_bytes: usize, tally: &mut Tally) {
    let Change::Bits { shift, bits, .. } = step.change else { return };
    for record in records.chunks_exact(record_bytes) {
        let number = (record[step.at] >> shift) & (u8::MAX >> (8 - bits));
        // Zero is no return number; some files have it all the same.
        if let Some(count) = usize::from(number).checked_sub(1) {
            tally.by_return[count] += 1;
        }
    }
}
