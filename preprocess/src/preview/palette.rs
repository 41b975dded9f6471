//! The colours of points.

use lodestream_protocol::{Manifest, NodePoints, ScalarType};

/// Heights from low to high, as maps show land.
const HEIGHTS: [[f32; 3]; 6] = [
    [0.16, 0.27, 0.36],
    [0.20, 0.45, 0.47],
    [0.43, 0.62, 0.44],
    [0.78, 0.76, 0.50],
    [0.83, 0.60, 0.38],
    [0.96, 0.93, 0.89],
];

/// Where colours come from.
#[derive(Debug)]
pub(super) enum Palette {
    /// The points' own.
    Own {
        attribute: usize,
        group: usize,
        scalar: ScalarType,
        /// The value that is full light.
        full: f32,
    },
    /// By height.
    Height {
        /// Lowest lattice coordinate, and steps from there to the highest.
        lowest: u32,
        steps: f32,
    },
}

impl Palette {
    pub(super) fn of(manifest: &Manifest) -> Self {
        let index = manifest.attributes.iter().position(|a| a.name == "color" && a.components == 3);
        if let Some(attribute) = index
            && let described = &manifest.attributes[attribute]
            && let Some(group) = described.group()
            && matches!(described.scalar, ScalarType::U8 | ScalarType::U16)
        {
            // Sixteen bits hold eight in many files.
            let is_wide = described.scalar == ScalarType::U16
                && described.max.iter().any(|&most| most > 255.0);
            let full = if is_wide { 65_535.0 } else { 255.0 };
            return Self::Own { attribute, group, scalar: described.scalar, full };
        }
        let (lowest, highest) = (manifest.bounds.min[2], manifest.bounds.max[2]);
        Self::Height { lowest, steps: highest.saturating_sub(lowest).max(1) as f32 }
    }

    /// The group of columns that colours are in.
    pub(super) const fn group(&self) -> Option<usize> {
        match self {
            Self::Own { group, .. } => Some(*group),
            Self::Height { .. } => None,
        }
    }

    /// The colour of a node's point, each channel from 0 to 1.
    pub(super) fn color(&self, points: &NodePoints, index: usize, height: u32) -> [f32; 3] {
        match *self {
            Self::Own { attribute, scalar, full, .. } => {
                let size = scalar.size_bytes();
                let Some(column) = points.column(attribute) else { return [0.5; 3] };
                std::array::from_fn(|channel| {
                    let at = (index * 3 + channel) * size;
                    let value = column.bytes.get(at..at + size).map_or(0.0, |b| scalar.to_f64(b));
                    (value as f32 / full).clamp(0.0, 1.0)
                })
            }
            Self::Height { lowest, steps } => {
                let place = height.saturating_sub(lowest) as f32 / steps;
                let place = place.clamp(0.0, 1.0) * (HEIGHTS.len() - 1) as f32;
                let below = (place as usize).min(HEIGHTS.len() - 2);
                let share = place - below as f32;
                std::array::from_fn(|channel| {
                    let (low, high) = (HEIGHTS[below][channel], HEIGHTS[below + 1][channel]);
                    low + (high - low) * share
                })
            }
        }
    }
}
