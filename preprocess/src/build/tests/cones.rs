//! Normal cones.

use std::collections::HashMap;

use lodestream_protocol::{NodeKey, NormalCone, ScalarType};

use super::*;

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
            let files = [(1, 1 << 30), (3, 1 << 30), (2, 64 << 10)].map(|(threads, memory)| {
            let mut config = config(folder.path(), &[], threads, memory);
            config.columns = Some("x,y,z,nx,ny,nz".into());
            std::fs::write(&config.inputs[0], text_with_normals(&points)).expect("temporary folder");
            build_in_chunks(&config, SMALL_CHUNKS, &Quiet).expect("builds");
            std::fs::read(&config.output).expect("written")
        });
        prop_assert!(files[0] == files[1] && files[0] == files[2], "threads or memory change the bytes");

        let [file, ..] = files;
        let dataset = Dataset::open(file).expect("a dataset");
        let nodes = dataset.hierarchy().expect("nodes");
        let groups: Vec<usize> = (0..dataset.manifest().groups.len()).collect();
        let Some(index) = dataset.manifest().attributes.iter().position(|a| a.group().is_some()) else {
            prop_assert!(nodes.iter().all(|n| n.normal_cone.is_none()), "the same normal everywhere");
            return Ok(());
        };
        let cones: HashMap<NodeKey, NormalCone> =
            nodes.iter().map(|n| (n.key, n.normal_cone.expect("a cone"))).collect();
        for node in nodes.iter().filter(|node| node.points > 0) {
            let decoded = dataset.read_node(node, &groups).expect("decodes");
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
    let (_, dataset) = built(&config);
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
