//! Points: all of them, at their distances, in the same bytes however they are built.

use super::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn every_point_is_kept_at_its_distance_in_the_same_bytes(points in cloud()) {
        let folder = tempfile::tempdir().expect("temporary folder");
        let mut files = Vec::new();
        for threads in [1, 3] {
            let config = config(folder.path(), &points, threads, 1 << 30);
            let report = build_in_chunks(&config, SMALL_CHUNKS, &Quiet).expect("builds");
            prop_assert_eq!(report.points_written, points.len() as u64);
            files.push(std::fs::read(&config.output).expect("written"));
            let verified = verified(&config, &config.inputs);
            prop_assert!(verified.is_sound(), "{:?}", verified.findings);
            prop_assert!(verified.against.is_some_and(|c| c.identical));
        }
        prop_assert!(files[0] == files[1], "threads change the bytes");
    }
}

#[test]
fn parts_with_scales_and_offsets_of_their_own_make_what_the_whole_does() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let points: Vec<[i32; 3]> =
        (0..3000).map(|i| [i * 7919 % 10_000, i * 31 % 10_007, i % 10]).collect();
    let whole = vec![write(folder.path(), "whole.las", &scan(&points, 0.01, 0).bytes())];
    let parts = [(0.001, 0), (0.01, 3), (0.0001, 0), (0.005, -7)];
    let parts: Vec<String> = points
        .chunks(750)
        .zip(parts)
        .enumerate()
        .map(|(i, (points, (scale, offset)))| {
            write(folder.path(), &format!("{i}.las"), &scan(points, scale, offset).bytes())
        })
        .collect();
    let built = [&whole, &parts].map(|inputs| {
        let mut config = config(folder.path(), &[], 2, 1 << 30);
        config.inputs = inputs.clone();
        config.columns = None;
        let report = build(&config, &Quiet).expect("builds");
        assert_eq!((report.scale, report.largest_coordinate_error), (0.01, 0.0));
        let position = report.columns[0].bytes;
        (position, verified(&config, &whole))
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
    let built = [1 << 30, 64 << 10].map(|memory| {
        let config = config(folder.path(), &points, 2, memory);
        let report = build_in_chunks(&config, SMALL_CHUNKS, &Quiet).expect("builds");
        assert_eq!(report.spilled, memory < 1 << 20);
        std::fs::read(&config.output).expect("written")
    });
    assert!(built[0] == built[1], "memory changes the bytes");
}

#[test]
fn a_value_that_changes_between_files_is_no_constant() {
    // Each file is one block of the store, and each thread looks at one of them.
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut config = config(folder.path(), &[], 2, 1 << 30);
    let points: Vec<[i32; 3]> = (0..65_536).map(|i| [i % 256, i / 256, 0]).collect();
    config.inputs = (0..2u8)
        .map(|value| {
            let mut scan = scan(&points, 0.01, 0);
            scan.points.chunks_exact_mut(20).for_each(|record| record[12] = value);
            write(folder.path(), &format!("{value}.las"), &scan.bytes())
        })
        .collect();
    let (_, dataset) = built(&config);
    let intensity = dataset.manifest().attribute("intensity").expect("in every LAS file");
    assert!(intensity.constant().is_none());
    assert!(verified(&config, &config.inputs).is_sound());
}

#[test]
fn parents_whose_children_gave_all_points_away_are_leaves() {
    // 4 points a side, a quarter of the side apart: with a grid of 4 the root takes them all, and
    // they are twice as many as a leaf holds.
    let folder = tempfile::tempdir().expect("temporary folder");
    let at = |i: i64| i << 18;
    let points: Vec<[i64; 3]> = (0..64).map(|i| [at(i % 4), at(i / 4 % 4), at(i / 16)]).collect();
    // One more makes the cube that wide.
    let points = [points, vec![[(1 << 20) - 1; 3]]].concat();
    let config = config(folder.path(), &points, 2, 1 << 30);
    let (report, dataset) = built(&config);
    let nodes = dataset.hierarchy().expect("nodes");
    assert!(report.nodes < 9, "{} nodes", report.nodes);
    for node in nodes.iter().filter(|node| node.is_leaf()) {
        assert!(node.points > 0 && node.geometric_error == 0.0, "{node:?}");
    }
    assert!(verified(&config, &config.inputs).is_sound());
}

#[test]
fn a_tree_of_more_nodes_than_a_page_holds_is_read_whole() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let height = |i: i64| i * 7919 % 89;
    let points: Vec<[i64; 3]> =
        (0..80_000).map(|i| [i % 283 * 9, i / 283 * 9, height(i)]).collect();
    let config = config(folder.path(), &points, 2, 1 << 30);
    let (report, dataset) = built(&config);
    let pages = dataset.boot().root_page.nodes.iter().filter(|n| n.child_page.is_some()).count();
    assert!(report.nodes > 4096 && pages > 0, "{} nodes, {pages} pages", report.nodes);
    let verified = verified(&config, &config.inputs);
    assert!(verified.is_sound(), "{:?}", verified.findings);
    assert_eq!(verified.nodes, report.nodes);
}
