//! From a file's coordinates to the lattice, and back to world coordinates.

use std::path::Path;

use fastrand::Rng;
use lodestream_preprocess::writers::{self, ExportBlock, ExportInfo};
use lodestream_protocol::{Attribute, Column, Domain, Lattice, LatticeBox, ScalarType, Storage};

use super::Rows;
use crate::stability::{
    Row, StabilityError,
    dataset::{Built, Digits},
    exact::{Big, apart, big, decimal, whole},
};

const REFERENCE: &str = "the file's decimals as fractions of 512 bits";
const ROUNDINGS: &str = "three roundings of a double of that size: the scale, the product, the sum";
const HALF_A_STEP: &str =
    "half the step that is written down for the case, and the double's own rounding";

/// Of coordinates that are taken for decimal numbers.
const MOST_DECIMALS: u32 = 9;

/// Steps of lattices that cannot hold what they are given exactly. Written down here: a build that chooses
/// coarser ones, and tells so, fails its case. Of a power of two, far below the points' spacing:
const TEN_DECIMALS_STEP: f64 = 1.0 / (1u64 << 43) as f64;
const DOUBLES_STEP: f64 = 1.0 / (1u64 << 23) as f64;
/// The finest power of ten of which 2^32 reach across.
const WIDE_STEP: f64 = 1.0;

pub(super) fn cases() -> Rows {
    let mut rng = Rng::with_seed(2);
    let mut around = |middle: i64, reach: i64| -> Vec<[i64; 3]> {
        (0..500).map(|_| std::array::from_fn(|_| middle + rng.i64(-reach..=reach))).collect()
    };
    let mut rows = Vec::new();
    let exact = [
        Digits {
            name: "offset of 10^7 m, 1 mm detail",
            decimals: 3,
            points: around(10_000_000_000, 5000),
        },
        Digits {
            name: "earth-centred (ECEF), 1 mm detail",
            decimals: 3,
            points: around(0, 5000)
                .iter()
                .map(|p| [p[0] + 4_027_881_628, p[1] + 306_998_785, p[2] + 4_919_498_981])
                .collect(),
        },
        Digits {
            name: "cloud at 10^9 m",
            decimals: 3,
            points: around(1_000_000_000_000, 2_000_000),
        },
        Digits { name: "scale of 10^-9 m", decimals: 9, points: around(123_456_789, 1_000_000) },
        Digits { name: "extent of 10^-6 m, ten decimals", decimals: 10, points: around(0, 5000) },
        Digits { name: "extent of 10^9 m", decimals: 0, points: around(0, 500_000_000) },
        Digits {
            name: "last digit of negative coordinates (off by one elsewhere)",
            decimals: 3,
            points: around(-123_456, 2000),
        },
        Digits { name: "one point", decimals: 3, points: vec![[-1, 10_000_000_001, 0]] },
    ];
    for digits in exact {
        let (found, built) = errors(&digits)?;
        let (shortcut, truncated) = shortcuts(&digits);
        let reach = digits.points.iter().flatten().map(|c| c.unsigned_abs()).max().unwrap_or(0);
        let reach = reach as f64 / 10f64.powi(digits.decimals as i32);
        let roundings = 1.5 * f64::EPSILON * reach;
        // More than nine decimals are taken for binary numbers, and what that costs is told. That it is told
        // where it need not be fails the case: the tolerance does not hang on what the build says.
        let is_rounded = built.report.largest_coordinate_error != 0.0;
        let tolerance = if digits.decimals > MOST_DECIMALS {
            (0.5 * TEN_DECIMALS_STEP + roundings, HALF_A_STEP)
        } else {
            (roundings, ROUNDINGS)
        };
        let found =
            if is_rounded && digits.decimals <= MOST_DECIMALS { f64::INFINITY } else { found };
        rows.push(
            Row::new(digits.name, (found, "m"), tolerance, REFERENCE)
                .beside("single precision", shortcut)
                .beside("truncated steps", truncated),
        );
    }
    rows.push(too_wide(&mut rng)?);
    rows.push(doubles(&mut rng)?);
    rows.push(las(&mut rng)?);
    rows.extend(dropped()?);
    Ok(rows)
}

/// Integers of a LAS file on both sides of zero, with an offset that is no whole number of steps.
fn las(rng: &mut Rng) -> Result<Row, StabilityError> {
    const OFFSET: &str = "-4027881.6285";
    const ORIGIN: i64 = -1000;
    let offset = OFFSET.parse().unwrap_or(f64::NAN);
    let lattice = Lattice { scale: 0.001, offset: [offset; 3], origin: [ORIGIN; 3], side_bits: 11 };
    let positions: Vec<[u32; 3]> =
        (0..500).map(|_| std::array::from_fn(|_| rng.u32(..2000))).collect();
    let attribute = Attribute {
        name: "point_source_id".into(),
        scalar: ScalarType::U16,
        components: 1,
        domain: Domain::Element,
        storage: Storage::Column { group: 0 },
        min: vec![0.0],
        max: vec![499.0],
    };
    let bounds = LatticeBox { min: [0; 3], max: [1999; 3] };
    let info = ExportInfo { lattice, bounds, points: 500, attributes: vec![attribute], crs: None };
    let numbers = Column { attribute: 0, bytes: (0..500u16).flat_map(u16::to_le_bytes).collect() };
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |e: std::io::Error| StabilityError::File { path, why: e.to_string() }
    };
    let folder = tempfile::tempdir().map_err(failed(&std::env::temp_dir()))?;
    let path = folder.path().join("case.las");
    let mut writer = writers::create(&path, info)?;
    writer.write(&ExportBlock { positions: positions.clone(), columns: vec![numbers] })?;
    writer.finish()?;
    let bytes = std::fs::read(&path).map_err(failed(&path))?;
    let built = Built::of("case.las", &bytes, 8)?;
    let found = built.points()?;
    let lattice = built.dataset.manifest().lattice;
    let (mut error, mut single, mut cut) = (0.0f64, 0.0f64, 0.0f64);
    for point in &found {
        let world = lattice.world(point.q);
        for a in 0..3 {
            let steps = ORIGIN + i64::from(positions[point.number][a]);
            let exact = decimal(OFFSET) + whole(steps.into()) / whole(1000);
            error = error.max(apart(world[a], &exact));
            single = single.max(apart(f64::from(world[a] as f32), &exact));
            // From the lowest coordinate, cut off to whole steps.
            let low = offset + ORIGIN as f64 * 0.001;
            let steps = ((offset + steps as f64 * 0.001 - low) / 0.001) as i64;
            cut = cut.max(apart(low + steps as f64 * 0.001, &exact));
        }
    }
    let error = if found.len() == positions.len() { error } else { f64::INFINITY };
    let tolerance = 1.5 * f64::EPSILON * 4_027_882.0;
    let case = "LAS integers of both signs, offset of half a step";
    Ok(Row::new(case, (error, "m"), (tolerance, ROUNDINGS), REFERENCE)
        .beside("single precision", single)
        .beside("truncated steps", cut))
}

/// Largest error of a coordinate; infinite where points are missing.
fn errors(digits: &Digits) -> Result<(f64, Built), StabilityError> {
    let built = Built::of("case.xyz", digits.text().as_bytes(), 8)?;
    let points = built.points()?;
    if points.len() != digits.points.len() {
        return Ok((f64::INFINITY, built));
    }
    let lattice = built.dataset.manifest().lattice;
    let error = points.iter().flat_map(|point| {
        let exact = digits.exact(point.number);
        lattice.world(point.q).into_iter().zip(exact).map(|(found, exact)| apart(found, &exact))
    });
    Ok((error.fold(0.0, f64::max), built))
}

/// Largest errors of coordinates kept in single precision, and of steps cut off instead of rounded.
fn shortcuts(digits: &Digits) -> (f64, f64) {
    let scale = 10f64.powi(-(digits.decimals as i32));
    let world: Vec<[f64; 3]> = digits.points.iter().map(|p| p.map(|c| c as f64 * scale)).collect();
    let least: [f64; 3] =
        std::array::from_fn(|a| world.iter().map(|p| p[a]).fold(f64::INFINITY, f64::min));
    let (mut single, mut cut) = (0.0f64, 0.0f64);
    for (i, p) in world.iter().enumerate() {
        for (a, exact) in digits.exact(i).iter().enumerate() {
            single = single.max(apart(f64::from(p[a] as f32), exact));
            let steps = ((p[a] - least[a]) / scale) as i64;
            cut = cut.max(apart(least[a] + steps as f64 * scale, exact));
        }
    }
    (single, cut)
}

/// More digits than a lattice has steps: rounded, and told.
fn too_wide(rng: &mut Rng) -> Result<Row, StabilityError> {
    let reach = 500_000_000_000i64;
    let points = (0..500).map(|_| std::array::from_fn(|_| rng.i64(-reach..=reach))).collect();
    let name = "extent of 10^9 m, 1 mm detail (more than 2^32 steps)";
    let digits = Digits { name, decimals: 3, points };
    let (found, _) = errors(&digits)?;
    let (single, _) = shortcuts(&digits);
    let tolerance = 0.5 * WIDE_STEP + 4.0 * f64::EPSILON * 5e8;
    Ok(Row::new(name, (found, "m"), (tolerance, HALF_A_STEP), REFERENCE)
        .beside("single precision", single))
}

/// Binary numbers, which no decimal lattice holds.
fn doubles(rng: &mut Rng) -> Result<Row, StabilityError> {
    let points: Vec<[f64; 3]> =
        (0..500).map(|_| std::array::from_fn(|_| 1e7 + 2.0 * rng.f64())).collect();
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\nproperty double \
         y\nproperty double z\nproperty uint number\nend_header\n",
        points.len()
    )
    .into_bytes();
    for (i, p) in (0u32..).zip(&points) {
        p.iter().for_each(|c| bytes.extend(c.to_le_bytes()));
        bytes.extend(i.to_le_bytes());
    }
    let built = Built::of("case.ply", &bytes, 8)?;
    let lattice = built.dataset.manifest().lattice;
    let found = built.points()?;
    let error = found.iter().flat_map(|point| {
        let exact: [Big; 3] = points[point.number].map(big);
        lattice.world(point.q).into_iter().zip(exact).map(|(found, exact)| apart(found, &exact))
    });
    let error = error.fold(0.0, f64::max);
    let error = if found.len() == points.len() { error } else { f64::INFINITY };
    let single = points.iter().flatten().map(|&c| apart(f64::from(c as f32), &big(c)));
    let tolerance = 0.5 * DOUBLES_STEP + 1.5 * f64::EPSILON * 1e7;
    Ok(Row::new(
        "binary doubles at 10^7 m",
        (error, "m"),
        (tolerance, HALF_A_STEP),
        "the file's doubles",
    )
    .beside("single precision", single.fold(0.0, f64::max)))
}

/// What is no coordinate, and nothing at all.
fn dropped() -> Rows {
    let text = "0.5 1.5 2.5 0\nnan 1 2 1\n1 inf 2 2\n1 2 -inf 3\n-0.5 -1.5 -2.5 4\n";
    let built = Built::of("case.xyz", text.as_bytes(), 8)?;
    let told: u64 = built.report.dropped.iter().map(|dropped| dropped.points).sum();
    let lattice = built.dataset.manifest().lattice;
    let mut kept = built.points()?;
    kept.sort_by_key(|point| point.number);
    let kept: Vec<_> = kept.iter().map(|point| lattice.world(point.q)).collect();
    let expected = ["0.5", "1.5", "2.5", "-0.5", "-1.5", "-2.5"].map(decimal);
    let is_same = kept.len() == 2
        && kept
            .iter()
            .flatten()
            .zip(&expected)
            .all(|(&found, exact)| apart(found, exact) == 0.0 && *exact != whole(0));
    let nan = Row::holds(
        "NaN and infinite coordinates",
        told == 3 && is_same,
        "the three bad points are left out and counted, the two good ones kept",
        "the lines of the file",
    );
    let empty = Built::of("case.ply", EMPTY_PLY.as_bytes(), 8);
    let none = Row::holds(
        "no point",
        empty.is_err_and(|e| e.to_string().contains("no points")),
        "there is nothing to build, and that is what is said",
        "nothing",
    );
    Ok(vec![nan, none])
}

const EMPTY_PLY: &str = "ply\nformat ascii 1.0\nelement vertex 0\nproperty double x\nproperty double \
                         y\nproperty double z\nend_header\n";
