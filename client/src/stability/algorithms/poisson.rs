//! The distance between sampled points, over whole builds.

use std::collections::HashSet;

use fastrand::Rng;
use lodestream_protocol::NodeKey;

use super::Rows;
use crate::stability::{
    Row,
    dataset::{Built, Digits, FEW_CELLS, Placed},
};

const EXACT: &str = "integers: the distance holds for every pair, across nodes and chunks";
const REFERENCE: &str = "all pairs, in 128-bit integers";

pub(super) fn cases() -> Rows {
    let mut rng = Rng::with_seed(4);
    let mut random = |count: usize, low: [i64; 3], most: [i64; 3]| -> Vec<[i64; 3]> {
        (0..count).map(|_| std::array::from_fn(|a| low[a] + rng.i64(0..=most[a]))).collect()
    };
    let far = [10_000_000_000; 3];
    let mut clusters = random(1000, [0; 3], [12; 3]);
    clusters.extend((0..1000).map(|i| [i % 10, i / 10 % 10, i / 100].map(|c| 100_000_000 * c)));
    let collinear = (0..2500).map(|i| [10_000_000_000 + 3 * i, 5 * i, -7 * i]).collect();
    let coplanar = random(2500, [0; 3], [3000, 3000, 0])
        .into_iter()
        .map(|p| [3 * p[0] + 7 * p[1], 5 * p[0] + 2 * p[1], 11 * p[0] + 13 * p[1]])
        .collect();
    let clouds = [
        Digits {
            name: "offset of 10^7 m, 1 mm detail",
            decimals: 3,
            points: random(2500, far, [4000, 4000, 400]),
        },
        Digits {
            name: "extent of 10^-6 m",
            decimals: 10,
            points: random(2500, [0; 3], [10_000; 3]),
        },
        Digits {
            name: "extent of 10^9 m",
            decimals: 0,
            points: random(2500, [-500_000_000; 3], [1_000_000_000; 3]),
        },
        Digits {
            name: "needle, aspect 10^6",
            decimals: 3,
            points: random(2500, far, [2_000_000, 2, 2]),
        },
        Digits {
            name: "sheet, aspect 10^6",
            decimals: 3,
            points: random(2500, far, [2_000_000, 2_000_000, 2]),
        },
        Digits { name: "collinear", decimals: 3, points: collinear },
        Digits { name: "coplanar, aslant", decimals: 3, points: coplanar },
        Digits { name: "spacings 10^8 apart in one cloud", decimals: 3, points: clusters },
        Digits {
            name: "a million duplicates",
            decimals: 3,
            points: vec![[10_000_000_001, -5, 7]; 1_000_000],
        },
        Digits { name: "one point", decimals: 3, points: vec![[1, 2, 3]] },
    ];
    clouds.iter().map(row).collect()
}

fn row(cloud: &Digits) -> Result<Row, crate::stability::StabilityError> {
    let built = Built::of("case.xyz", cloud.text().as_bytes(), FEW_CELLS)?;
    let manifest = built.dataset.manifest();
    let points = built.points()?;
    let lost = cloud.points.len().abs_diff(points.len());
    let sampled: Vec<&Placed> = points.iter().filter(|point| !point.is_leaf).collect();
    let nodes: HashSet<NodeKey> = sampled.iter().map(|point| point.node).collect();
    // Whether a point is in a sampled node of a level. Beside these, in leaves, points lie as they
    // came, and keep the distance of the levels above alone.
    let is_in = |point: &Placed, level: u8| {
        let bits = u32::from(manifest.lattice.node_bits(level));
        let cube = point.q.map(|c| c.checked_shr(bits).unwrap_or(0));
        NodeKey::new(level, cube).is_some_and(|node| nodes.contains(&node))
    };
    let (mut pairs, mut near, mut single) = (0usize, 0usize, 0usize);
    for (i, a) in sampled.iter().enumerate() {
        for b in &sampled[..i] {
            let level = a.node.level().max(b.node.level());
            if !is_in(a, level) || !is_in(b, level) {
                continue;
            }
            pairs += 1;
            // In lattice units; a cell is a unit at least.
            let bits = manifest.lattice.node_bits(level).saturating_sub(FEW_CELLS.ilog2() as u8);
            let least = 1u128 << (2 * u32::from(bits));
            let distance: u128 = (0..3).map(|x| u128::from(a.q[x].abs_diff(b.q[x])).pow(2)).sum();
            near += usize::from(distance < least);
            let is_near =
                is_near_in_f32(manifest.lattice.world(a.q), manifest.lattice.world(b.q), {
                    manifest.lattice.scale * f64::from(bits).exp2()
                });
            single += usize::from(is_near != (distance < least));
        }
    }
    // Where nothing was compared, nothing was shown: but where all points are one, nothing can be.
    let distinct: HashSet<&[i64; 3]> = cloud.points.iter().collect();
    let vacuous = usize::from(distinct.len() > 1 && pairs == 0);
    let row = Row::new(
        format!("{} ({pairs} pairs)", cloud.name),
        ((near + lost + vacuous) as f64, "pairs"),
        (0.0, EXACT),
        REFERENCE,
    );
    // What a test in single precision would say wrongly of the same pairs.
    Ok(if pairs > 0 { row.beside("single precision", single as f64) } else { row })
}

fn is_near_in_f32(a: [f64; 3], b: [f64; 3], least: f64) -> bool {
    let squares = (0..3).map(|x| (a[x] as f32 - b[x] as f32).powi(2));
    squares.sum::<f32>() < (least as f32).powi(2)
}
