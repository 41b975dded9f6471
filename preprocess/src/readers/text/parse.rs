//! Lines to points.

use super::{
    columns::{Column, Plan},
    detect::{count_line, shown},
    lines::{Chunk, is_blank, lines},
    split::{Field, Fields},
};
use crate::readers::{
    Block,
    gather::{Gather, Tally},
    slot::{Rule, Stored, row_bytes},
};

/// What a chunk of lines holds.
#[derive(Debug, Default)]
pub(super) struct Parsed {
    /// Its points.
    pub blocks: Vec<Block>,
    /// What happened to them.
    pub tally: Tally,
    /// Lines that are not points as the plan has them.
    pub bad_lines: u64,
    /// The first of these: its number and what it holds.
    pub first_bad: Option<(u64, String)>,
    /// Points that count lines announce (PTS).
    pub announced: u64,
}

/// Parses all lines of a chunk; blank lines and comments are passed over.
pub(super) fn parse(plan: &Plan, chunk: &Chunk, terminator: u8) -> Parsed {
    let mut parsed = Parsed::default();
    // A point of text is rarely shorter than 24 bytes.
    let mut gather = Gather::new(row_bytes(&plan.attributes), chunk.bytes.len() / 24 + 1);
    let mut tally = Tally::default();
    for (line, number) in lines(&chunk.bytes, terminator).zip(chunk.first_line..) {
        if let Some(position) = point(plan, line, gather.row(), &mut tally) {
            gather.keep(position);
        } else if is_comment(line) {
        } else if let Some(count) = count_line(line).filter(|_| plan.count_lines) {
            parsed.announced = parsed.announced.saturating_add(count);
        } else {
            parsed.bad_lines += 1;
            parsed.first_bad.get_or_insert_with(|| (number, shown(line)));
        }
    }
    gather.tally.add(tally);
    (parsed.blocks, parsed.tally) = gather.finish();
    parsed
}

/// Whether a line holds no data: blank, or a comment.
pub(super) fn is_comment(line: &[u8]) -> bool {
    let start = line.trim_ascii_start();
    is_blank(line) || start.starts_with(b"#") || start.starts_with(b"//")
}

/// Parses one line into its row of attributes; gives the position, `None` where the line is not as
/// planned.
fn point(plan: &Plan, line: &[u8], row: &mut [u8], tally: &mut Tally) -> Option<[f64; 3]> {
    let mut fields = Fields::new(line, plan.delimiter);
    let mut position = [0.0; 3];
    let (mut decimals, mut altered) = (0, 0);
    for &column in &plan.columns {
        match (column, fields.next()?) {
            (Column::Skip, _) => {}
            (Column::Axis(axis), Field::Number(number)) => {
                position[axis] = number.value;
                decimals = decimals.max(number.decimals);
            }
            (Column::Value(slot), Field::Number(number)) => match slot.store(row, number.value) {
                Stored::Kept => {}
                Stored::Altered => altered += 1,
                Stored::Unfit => return None,
            },
            // A value that is not there; only floating point can say so.
            (Column::Value(slot), Field::Empty) if slot.rule == Rule::Exact => {
                slot.store(row, f64::NAN);
            }
            (Column::Axis(_) | Column::Value(_), Field::Empty | Field::Other) => return None,
        }
    }
    if !plan.more_columns && !fields.is_at_end() {
        return None;
    }
    tally.decimals = tally.decimals.max(decimals);
    tally.altered_colors += altered;
    Some(position)
}
