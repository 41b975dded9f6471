//! What a plan draws, so that it can be compared.

use std::collections::BTreeMap;

use lodestream_client::engine::FramePlan;
use lodestream_protocol::NodeKey;

/// Cloud and node → number of points and a checksum of positions and columns.
pub type Picture = BTreeMap<(usize, NodeKey), (usize, u32)>;

/// What a plan draws.
pub fn picture(plan: &FramePlan) -> Picture {
    picture_in(plan, &Cells::new())
}

/// How exactly nodes are placed: log2 of the side of their cells.
pub type Cells = BTreeMap<(usize, NodeKey), u8>;

/// How exactly a plan's nodes are placed.
pub fn cells(plan: &FramePlan) -> Cells {
    plan.nodes.iter().map(|node| ((node.cloud, node.key), node.points.cell_bits)).collect()
}

/// What a plan draws, no more exactly than these cells: of what was seen from nearer, more may be known.
pub fn picture_in(plan: &FramePlan, cells: &Cells) -> Picture {
    let nodes = plan.nodes.iter().map(|node| {
        let id = (node.cloud, node.key);
        let bits = cells.get(&id).copied().unwrap_or(0).max(node.points.cell_bits);
        let half = (1u32 << bits) / 2;
        let placed = |q: u32| if bits == 0 { q } else { q >> bits << bits | half };
        let mut crc = crc32fast::Hasher::new();
        let positions = node.points.positions.iter().flatten();
        positions.for_each(|&q| crc.update(&placed(q).to_le_bytes()));
        for column in &node.points.columns {
            crc.update(&[column.attribute as u8]);
            crc.update(&column.bytes);
        }
        (id, (node.points.positions.len(), crc.finalize()))
    });
    let picture: Picture = nodes.collect();
    assert_eq!(picture.len(), plan.nodes.len(), "no node is drawn twice");
    picture
}
