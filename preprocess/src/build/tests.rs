use std::{collections::HashMap, sync::Arc};

use lodestream_protocol::{Dataset, NodeKey, NormalCone, ScalarType};
use proptest::prelude::*;

use super::*;
use crate::{
    readers::las::tests::scan::{Compression, Scan},
    verify::{VerifyConfig, verify},
};

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
        cancel: Arc::default(),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn every_point_is_kept_at_its_distance_in_the_same_bytes(points in cloud()) {
        let folder = tempfile::tempdir().expect("temporary folder");
        let sizes = ChunkSizes { min: 40, max: 200, wanted: 16 };
        let mut files = Vec::new();
        for threads in [1, 3] {
            let config = config(folder.path(), &points, threads, 1 << 30);
            let report = build_in_chunks(&config, sizes, &Quiet).expect("builds");
            prop_assert_eq!(report.points_written, points.len() as u64);
            files.push(std::fs::read(&config.output).expect("written"));
            let verified = verify(
                &VerifyConfig {
                    dataset: config.output.clone(),
                    against: config.inputs.clone(),
                    columns: config.columns.clone(),
                    cancel: Arc::default(),
                },
                &Quiet,
            );
            let verified = verified.expect("opens");
            prop_assert!(verified.is_sound(), "{:?}", verified.findings);
            prop_assert!(verified.against.is_some_and(|c| c.identical));
        }
        prop_assert!(files[0] == files[1], "threads change the bytes");
    }
}

/// A line per point: place, normal.
fn text_with_normals(points: &[([i64; 3], [i32; 3])]) -> String {
    let line = |([x, y, z], [nx, ny, nz]): &([i64; 3], [i32; 3])| {
        // Of any length, as some files have them.
        format!("{x} {y} {z} {nx} {ny} {nz}\n")
    };
    points.iter().map(line).collect()
}

fn cloud_with_normals() -> impl Strategy<Value = Vec<([i64; 3], [i32; 3])>> {
    // Around one direction, wide or narrow, with or without some that have no direction.
    let normals = ([-9..=9i32, -9..=9, -9..=9], 0..=9i32, any::<bool>());
    (cloud(), normals, any::<u64>()).prop_map(|(points, (near, spread, zeros), seed)| {
        let mut state = seed | 1;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            i32::try_from(state >> 40).unwrap_or(0)
        };
        let normal = |_| match zeros && next() % 50 == 0 {
            true => [0; 3],
            false => near.map(|c| 9 * c + next() % (2 * spread + 1) - spread),
        };
        let normals: Vec<[i32; 3]> = points.iter().map(normal).collect();
        points.into_iter().zip(normals).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn every_normal_lies_in_the_cones_of_its_node_and_of_all_above(points in cloud_with_normals()) {
        let folder = tempfile::tempdir().expect("temporary folder");
        let sizes = ChunkSizes { min: 40, max: 200, wanted: 16 };
        let files = [(1, 1 << 30), (3, 1 << 30), (2, 64 << 10)].map(|(threads, memory)| {
            let mut config = config(folder.path(), &[], threads, memory);
            config.columns = Some("x,y,z,nx,ny,nz".into());
            std::fs::write(&config.inputs[0], text_with_normals(&points)).expect("temporary folder");
            build_in_chunks(&config, sizes, &Quiet).expect("builds");
            std::fs::read(&config.output).expect("written")
        });
        prop_assert!(files[0] == files[1] && files[0] == files[2], "threads or memory change the bytes");

        let [file, ..] = files;
        let dataset = Dataset::open(file).expect("a dataset");
        let nodes = dataset.hierarchy().expect("nodes");
        let Some(index) = dataset.manifest().attributes.iter().position(|a| a.group().is_some()) else {
            prop_assert!(nodes.iter().all(|n| n.normal_cone.is_none()), "the same normal everywhere");
            return Ok(());
        };
        let cones: HashMap<NodeKey, NormalCone> =
            nodes.iter().map(|n| (n.key, n.normal_cone.expect("a cone"))).collect();
        for node in nodes.iter().filter(|node| node.points > 0) {
            let decoded = dataset.read_node(node, &[0, 1]).expect("decodes");
            for normal in decoded.column(index).expect("stored").bytes.chunks_exact(12) {
                let normal = std::array::from_fn(|a| ScalarType::F32.to_f64(&normal[4 * a..]));
                for level in 0..=node.key.level() {
                    let above = node.key.ancestor(level).expect("not below the node");
                    prop_assert!(cones[&above].contains(normal), "{} {above}: {normal:?}", node.key);
                }
            }
        }
    }
}

#[test]
fn cones_are_as_narrow_as_the_normals_and_as_wide_where_one_has_no_direction() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut config = config(folder.path(), &[], 2, 1 << 30);
    config.columns = Some("x,y,z,nx,ny,nz".into());
    // A floor, a wall, and far off a point that has no normal.
    let floor = (0..1000i64).map(|i| ([i % 32, i / 32, 0], [0, 0, 1]));
    let wall = (0..1000i64).map(|i| ([100, i % 32, i / 32], [1, 0, 0]));
    let lone = std::iter::once(([100, 100, 100], [0, 0, 0]));
    let points: Vec<_> = floor.chain(wall).chain(lone).collect();
    std::fs::write(&config.inputs[0], text_with_normals(&points)).expect("temporary folder");
    build(&config, &Quiet).expect("builds");
    let dataset = Dataset::open(std::fs::read(&config.output).expect("written")).expect("sound");
    let widths: Vec<(NodeKey, u8)> = dataset
        .hierarchy()
        .expect("nodes")
        .iter()
        .map(|node| (node.key, node.normal_cone.expect("a cone").to_bytes()[2]))
        .collect();
    let of = |key| widths.iter().find(|(k, _)| *k == key).map(|(_, width)| *width);
    let child = |octant| NodeKey::ROOT.child(octant).expect("a child");
    // Steps of pi / 255: floor and wall are one direction each, half of the root's would be 64.
    assert!(of(child(0)).is_some_and(|width| width <= 2), "{widths:?}");
    assert!(of(child(1)).is_some_and(|width| width <= 2), "{widths:?}");
    // Where the point without direction is, any direction may be.
    assert_eq!(of(NodeKey::ROOT), Some(255), "{widths:?}");
}

/// A LAS file of points on steps of a centimetre, written at another scale and offset.
fn las(folder: &Path, name: &str, centimetres: &[[i32; 3]], scale: f64, offset: i32) -> String {
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
    let path = folder.join(name);
    std::fs::write(&path, scan.bytes()).expect("temporary folder");
    path.display().to_string()
}

#[test]
fn parts_with_scales_and_offsets_of_their_own_make_what_the_whole_does() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let points: Vec<[i32; 3]> =
        (0..3000).map(|i| [i * 7919 % 10_000, i * 31 % 10_007, i % 10]).collect();
    let whole = vec![las(folder.path(), "whole.las", &points, 0.01, 0)];
    let parts = [(0.001, 0), (0.01, 3), (0.0001, 0), (0.005, -7)];
    let parts: Vec<String> = points
        .chunks(750)
        .zip(parts)
        .enumerate()
        .map(|(i, (points, (scale, offset)))| {
            las(folder.path(), &format!("{i}.las"), points, scale, offset)
        })
        .collect();
    let built = [&whole, &parts].map(|inputs| {
        let mut config = config(folder.path(), &[], 2, 1 << 30);
        config.inputs = inputs.clone();
        config.columns = None;
        let report = build(&config, &Quiet).expect("builds");
        assert_eq!((report.scale, report.largest_coordinate_error), (0.01, 0.0));
        let position = report.columns[0].bytes;
        let against = VerifyConfig {
            dataset: config.output,
            against: whole.clone(),
            columns: None,
            cancel: Arc::default(),
        };
        (position, verify(&against, &Quiet).expect("opens"))
    });
    assert_eq!(built[0].0, built[1].0, "bytes of the positions");
    for (_, verified) in built {
        let against = verified.against.expect("compared");
        assert_eq!(against.largest_coordinate_error, 0.0);
        assert!(against.identical);
    }
}

#[test]
fn points_beyond_memory_go_through_the_disk_to_the_same_bytes() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let points: Vec<[i64; 3]> =
        (0..5000i64).map(|i| [i * 7919 % 1000, i * 104_729 % 1000, i % 10]).collect();
    let sizes = ChunkSizes { min: 40, max: 200, wanted: 16 };
    let built = [1 << 30, 64 << 10].map(|memory| {
        let config = config(folder.path(), &points, 2, memory);
        let report = build_in_chunks(&config, sizes, &Quiet).expect("builds");
        assert_eq!(report.spilled, memory < 1 << 20);
        std::fs::read(&config.output).expect("written")
    });
    assert!(built[0] == built[1], "memory changes the bytes");
}

#[test]
fn a_cancelled_build_leaves_nothing() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let config = config(folder.path(), &[[0, 0, 0], [5, 5, 5]], 1, 1 << 20);
    config.cancel.store(true, Ordering::Relaxed);
    let result = build(&config, &Quiet);
    assert!(matches!(result, Err(Error::Interrupted)), "{result:?}");
    let left: Vec<_> = std::fs::read_dir(folder.path()).expect("there").collect();
    assert_eq!(left.len(), 1, "only the input is there: {left:?}");
}

#[test]
fn a_folder_is_no_output() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut config = config(folder.path(), &[[0, 0, 0]], 1, 1 << 20);
    config.output = folder.path().to_path_buf();
    let error = build(&config, &Quiet).expect_err("refused").to_string();
    assert!(error.contains("is a folder; name a file"), "{error}");
}
