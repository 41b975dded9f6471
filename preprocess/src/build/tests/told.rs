//! What the manifest, the nodes and the report tell.

use lodestream_protocol::BOOT_SPECULATIVE_BYTES;

use super::*;

#[test]
fn sources_and_the_reference_system_are_told() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut config = config(folder.path(), &[], 2, 1 << 30);
    let wkt = "LOCAL_CS[\"a place\"]";
    let mut second = scan(&[[1, 2, 3], [4, 5, 6], [7, 8, 9]], 0.01, 0);
    second.records.push(("LASF_Projection", 2112, [wkt.as_bytes(), &[0]].concat()));
    config.inputs = vec![
        write(folder.path(), "first.las", &scan(&[[0; 3]], 0.01, 0).bytes()),
        write(folder.path(), "second.las", &second.bytes()),
    ];
    config.columns = None;
    let (report, dataset) = built(&config);
    let sources: Vec<(&str, u64)> =
        dataset.manifest().sources.iter().map(|s| (s.name.as_str(), s.points)).collect();
    assert_eq!(sources, [("first.las", 1), ("second.las", 3)]);
    assert_eq!(dataset.manifest().crs.as_deref(), Some(wkt));
    assert_eq!((report.points_read, report.points_written), (4, 4));
}

#[test]
fn dropped_points_are_counted_by_input_and_reason() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut config = config(folder.path(), &[], 2, 1 << 30);
    config.inputs = vec![
        write(folder.path(), "a.xyz", b"nan 1 2 3\n1 2 3 4\n1 inf 3 5\n"),
        write(folder.path(), "b.xyz", b"7 8 9 6\nnan nan nan 7\n"),
    ];
    let (report, _) = built(&config);
    assert_eq!((report.points_read, report.points_written), (5, 2));
    let dropped: Vec<(bool, u64)> = report
        .dropped
        .iter()
        .zip(["a.xyz: coordinate is NaN", "b.xyz: coordinate is NaN"])
        .map(|(dropped, reason)| (dropped.reason.contains(reason), dropped.points))
        .collect();
    assert_eq!(dropped, [(true, 2), (true, 1)], "{:?}", report.dropped);
}

#[test]
fn rounding_is_told_by_manifest_and_report() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut config = config(folder.path(), &[[0, 0, 0], [5, 7, 9]], 1, 1 << 20);
    let (exact, dataset) = built(&config);
    assert_eq!((exact.largest_coordinate_error, dataset.manifest().largest_rounding), (0.0, 0.0));
    assert!(exact.warnings.is_empty(), "{:?}", exact.warnings);
    config.scale = Some(2.0);
    let (rounded, dataset) = built(&config);
    assert_eq!((rounded.largest_coordinate_error, dataset.manifest().largest_rounding), (1.0, 1.0));
    assert_eq!(rounded.warnings, ["coordinates are rounded to multiples of 2e0"]);
}

#[test]
fn dropped_attributes_are_not_there() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut config = config(folder.path(), &[[0, 0, 0], [5, 7, 9]], 1, 1 << 20);
    let (_, dataset) = built(&config);
    assert!(dataset.manifest().attribute("number").is_some());
    config.drop_attributes = vec!["number".into()];
    let (report, dataset) = built(&config);
    assert_eq!((dataset.manifest().attributes.len(), report.columns.len()), (0, 1));
}

#[test]
fn the_boot_block_holds_as_much_as_the_first_request_brings() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut config = config(folder.path(), &[], 2, 1 << 30);
    let line =
        |i: u32| format!("{} {} {}\n", i % 500, i / 500, i.wrapping_mul(2_654_435_761) >> 20);
    let text: String = (0..150_000).map(line).collect();
    write(folder.path(), "cloud.xyz", text.as_bytes());
    (config.columns, config.grid) = (Some("x,y,z".into()), 16);
    let (_, dataset) = built(&config);
    let header = &dataset.boot().header;
    assert!(
        header.file_bytes > BOOT_SPECULATIVE_BYTES && header.boot_bytes <= BOOT_SPECULATIVE_BYTES
    );
    // Payloads lie in the nodes' order: it ends with one of them, and the next would not fit.
    let nodes = dataset.hierarchy().expect("nodes");
    let end = |node: &lodestream_protocol::Node| {
        node.payloads[0].offset + u64::from(node.payloads[0].bytes)
    };
    let next = nodes.iter().find(|node| end(node) > header.boot_bytes).expect("not all of it");
    assert_eq!(next.payloads[0].offset, header.boot_bytes);
    assert!(end(next) > BOOT_SPECULATIVE_BYTES);
}

#[test]
fn spacings_are_those_of_the_levels_and_less_in_full_leaves() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let points: Vec<[i64; 3]> = (0..20_000i64).map(|i| [i % 200, i / 200, 0]).collect();
    let (_, dataset) = built(&config(folder.path(), &points, 2, 1 << 30));
    for node in dataset.hierarchy().expect("nodes") {
        let level = dataset.manifest().spacing_world(node.key.level()) as f32;
        if node.is_leaf() {
            assert!(node.spacing > 0.0 && node.spacing <= level, "{node:?}");
        } else {
            assert_eq!((node.spacing, node.geometric_error), (level, level), "{node:?}");
        }
    }
    // Few points at opposite corners are farther apart, on the mean, than their level demands: in a
    // leaf that is the root, and in one below a crowd (the last of the three keeps it from giving all
    // its points away).
    let corners = [[1 << 19; 3], [(1 << 20) - 1; 3], [(1 << 19) + 1; 3]];
    let crowd = (0..200).map(|i| [i % 10, i / 10, 0]);
    for points in [corners.to_vec(), crowd.chain(corners).collect()] {
        let (_, dataset) = built(&config(folder.path(), &points, 2, 1 << 30));
        let nodes = dataset.hierarchy().expect("nodes");
        let corner = dataset.manifest().bounds.max;
        let far = nodes.iter().find(|node| node.is_leaf() && node.bounds.contains(corner));
        let far = far.expect("it keeps a point");
        let level = dataset.manifest().spacing_world(far.key.level()) as f32;
        assert!(far.spacing == level && level > 1000.0, "{far:?}");
    }
}
