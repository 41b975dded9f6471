//! What a plan draws, so that it can be compared.

use std::collections::BTreeMap;

use lodestream_client::engine::FramePlan;
use lodestream_protocol::NodeKey;

/// Cloud and node → number of points and a checksum of positions and columns.
pub type Picture = BTreeMap<(usize, NodeKey), (usize, u32)>;

/// What a plan draws.
pub fn picture(plan: &FramePlan) -> Picture {
    let nodes = plan.nodes.iter().map(|node| {
        let mut crc = crc32fast::Hasher::new();
        node.points.positions.iter().flatten().for_each(|q| crc.update(&q.to_le_bytes()));
        for column in &node.points.columns {
            crc.update(&[column.attribute as u8]);
            crc.update(&column.bytes);
        }
        ((node.cloud, node.key), (node.points.positions.len(), crc.finalize()))
    });
    let picture: Picture = nodes.collect();
    assert_eq!(picture.len(), plan.nodes.len(), "no node is drawn twice");
    picture
}
