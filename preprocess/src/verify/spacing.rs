//! The distances that the method `poisson` promises.

use std::collections::{HashMap, HashSet};

use lodestream_protocol::{Manifest, Node, NodeKey};
use rayon::prelude::*;

use super::VerifyReport;
use crate::build::Progress;

/// For each level: the points of sampled nodes (those with children) of that level, together with
/// their ancestors' points inside them, keep the level's distance from one another. Cells of a hash
/// grid are exactly that wide, so the own and the 26 cells around are all that can hold a point too
/// near.
pub(super) fn check_spacing(
    manifest: &Manifest,
    nodes: &[Node],
    points_of: &HashMap<NodeKey, Vec<[u32; 3]>>,
    report: &mut VerifyReport,
    progress: &dyn Progress,
) {
    let sampled: HashSet<NodeKey> = nodes.iter().filter(|n| !n.is_leaf()).map(|n| n.key).collect();
    let deepest = sampled.iter().map(|k| k.level()).max();
    let Some(deepest) = deepest else { return };
    let grid_bits = manifest.method.grid.max(1).ilog2() as u8;
    for level in 0..=deepest {
        let node_bits = manifest.lattice.node_bits(level);
        let cell_bits = node_bits.saturating_sub(grid_bits);
        let min_distance2 = 1u128 << (2 * cell_bits);
        // (cell, point), sorted: a cell is found by binary search, without a table of all cells.
        let mut points: Vec<([u32; 3], [u32; 3])> = Vec::new();
        for (key, own) in points_of.iter().filter(|(key, _)| key.level() <= level) {
            if !sampled.contains(key) {
                continue;
            }
            for &q in own {
                let cube = q.map(|c| u64::from(c).checked_shr(u32::from(node_bits)).unwrap_or(0));
                let node = NodeKey::new(level, cube.map(|c| c as u32));
                if node.is_some_and(|node| sampled.contains(&node)) {
                    points.push((q.map(|c| c >> cell_bits.min(31)), q));
                }
            }
        }
        points.par_sort_unstable();
        let violations: u64 = (0..points.len())
            .into_par_iter()
            .map(|i| {
                let (cell, q) = points[i];
                let mut near = 0;
                // Each pair once: the point itself and those after it, in this and later cells.
                for dx in 0..=1u32 {
                    for dy in -1..=1i32 {
                        if dx == 0 && dy < 0 {
                            continue;
                        }
                        let row = |dz: i32| {
                            Some([
                                cell[0].checked_add(dx)?,
                                cell[1].checked_add_signed(dy)?,
                                cell[2].saturating_add_signed(dz),
                            ])
                        };
                        let (Some(first), Some(last)) = (row(-1), row(1)) else { continue };
                        let start = if dx == 0 && dy == 0 {
                            i + 1
                        } else {
                            points.partition_point(|p| p.0 < first)
                        };
                        let others = points[start..].iter().take_while(|(other, _)| *other <= last);
                        for (_, other) in others {
                            let distance2: u128 = (0..3)
                                .map(|a| {
                                    let d = u128::from(q[a].abs_diff(other[a]));
                                    d * d
                                })
                                .sum();
                            near += u64::from(distance2 < min_distance2);
                        }
                    }
                }
                near
            })
            .sum();
        report.spacing_checked += points.len() as u64;
        progress.advance(points.len() as u64);
        if violations > 0 {
            report.spacing_violations += violations;
            report.find(format!(
                "level {level}: {violations} pairs of points are closer than {} world units",
                manifest.spacing_world(level)
            ));
        }
    }
}
