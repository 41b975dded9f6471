//! Whole builds, of clouds made here.

mod cones;
mod points;
mod refusals;
mod told;

use std::{path::Path, sync::Arc};

use lodestream_protocol::Dataset;
use proptest::prelude::*;

use super::*;
use crate::{
    readers::las::tests::scan::{Compression, Scan},
    verify::{VerifyConfig, VerifyReport, verify},
};

/// Chunks so small that a test's cloud has many.
const SMALL_CHUNKS: ChunkSizes = ChunkSizes { min: 40, max: 200, wanted: 16 };

struct Quiet;

impl Progress for Quiet {
    fn phase(&self, _: &str, _: u64, _: &str) {}
    fn advance(&self, _: u64) {}
    fn warn(&self, _: &str) {}
}

/// Clouds that octrees find hard: noise, needles, sheets, clumps, duplicates, outliers.
fn cloud() -> impl Strategy<Value = Vec<[i64; 3]>> {
    let shape = prop_oneof![
        Just([1 << 20, 1 << 20, 1 << 20]),
        Just([1 << 20, 1 << 18, 64]),
        Just([1 << 22, 4, 4]),
        Just([16, 16, 16]),
        Just([1, 1, 1]),
        Just([1 << 31, 1 << 31, 1 << 31]),
    ];
    let clump = (shape, any::<[u16; 3]>(), 1usize..600, any::<u64>());
    prop::collection::vec(clump, 1..4).prop_map(|clumps| {
        let mut points = Vec::new();
        for (shape, at, count, seed) in clumps {
            let mut state = seed | 1;
            let mut next = |limit: i64| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                i64::try_from(state >> 33).unwrap_or(0) % limit
            };
            for _ in 0..count {
                points.push(std::array::from_fn(|a| i64::from(at[a]) + next(shape[a])));
            }
        }
        points
    })
}

fn config(folder: &Path, points: &[[i64; 3]], threads: usize, memory_bytes: u64) -> BuildConfig {
    let input = folder.join("cloud.xyz");
    let text: String =
        points.iter().enumerate().map(|(i, [x, y, z])| format!("{x} {y} {z} {i}\n")).collect();
    std::fs::write(&input, text).expect("temporary folder");
    BuildConfig {
        inputs: vec![input.display().to_string()],
        output: folder.join(format!("out-{threads}-{memory_bytes}.lods")),
        method: Method::Poisson,
        grid: 4,
        memory_bytes,
        threads: Some(threads),
        drop_attributes: Vec::new(),
        columns: Some("x,y,z,number".into()),
        scale: None,
        cells_per_spacing: CELLS_PER_SPACING,
        cancel: Arc::default(),
    }
}

/// A scan to be: a LAS file of points on steps of a centimetre, written at another scale and offset.
fn scan(centimetres: &[[i32; 3]], scale: f64, offset: i32) -> Scan {
    let mut scan = Scan::new(0, centimetres.len(), 0, Compression::None);
    let header = &mut scan.header;
    (header.x_scale_factor, header.y_scale_factor, header.z_scale_factor) = (scale, scale, scale);
    let zero = f64::from(offset);
    (header.x_offset, header.y_offset, header.z_offset) = (zero, zero, zero);
    let steps = (0.01 / scale).round() as i32;
    for (record, point) in scan.points.chunks_exact_mut(20).zip(centimetres) {
        record.fill(0);
        for a in 0..3 {
            let native = (point[a] - 100 * offset) * steps;
            record[4 * a..4 * a + 4].copy_from_slice(&native.to_le_bytes());
        }
    }
    scan
}

fn write(folder: &Path, name: &str, bytes: &[u8]) -> String {
    let path = folder.join(name);
    std::fs::write(&path, bytes).expect("temporary folder");
    path.display().to_string()
}

/// What is built of `inputs`, in the place of those of `config`.
fn built(config: &BuildConfig) -> (BuildReport, Dataset<Vec<u8>>) {
    let report = build(config, &Quiet).expect("builds");
    let file = std::fs::read(&config.output).expect("written");
    (report, Dataset::open(file).expect("a dataset"))
}

/// The dataset that was built, beside its inputs.
fn verified(config: &BuildConfig, against: &[String]) -> VerifyReport {
    let config = VerifyConfig {
        dataset: config.output.clone(),
        against: against.to_vec(),
        columns: config.columns.clone(),
        cancel: Arc::default(),
    };
    verify(&config, &Quiet).expect("opens")
}
