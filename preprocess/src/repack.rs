//! A dataset's twin whose positions and colours are stored in one part: what streaming it in the usual way costs.

use std::path::Path;

use lodestream_protocol::{Dataset, MortonCode, NodePoints, ReadAt};

use crate::{
    assemble,
    blobs::Blobs,
    encode::{Layout, NodeEncoder, OutNode},
    error::{Error, Result},
};

/// Writes a dataset of the same nodes, points and columns to `output`, positions and colours in one part. Holds the
/// encoded payloads in memory.
///
/// # Errors
/// Where the dataset cannot be read, or the file not be written.
pub fn with_whole_positions<R: ReadAt>(dataset: &Dataset<R>, output: &Path) -> Result<()> {
    let failed = |source| Error::Format { path: output.display().to_string(), source };
    let mut manifest = dataset.manifest().clone();
    if let Some(fine) = manifest.fine.take() {
        // An empty group: the others keep their numbers.
        manifest.groups[fine.group].columns.clear();
    }
    let layout = Layout::of(&manifest);
    let mut encoder = NodeEncoder::new(&layout);
    let groups: Vec<usize> = (0..manifest.groups.len()).collect();
    let mut nodes = Vec::new();
    for node in dataset.hierarchy().map_err(failed)? {
        let points = dataset.read_node(&node, &groups).map_err(failed)?;
        let rows = rows(&layout, &points);
        let codes: Vec<u128> = points.positions.iter().map(|&q| MortonCode::encode(q)).collect();
        let bits = manifest.lattice.node_bits(node.key.level());
        let starts = encoder.buffers.iter().map(|buffer| buffer.len() as u64).collect();
        let row = |point: usize| &rows[point * layout.row_bytes..][..layout.row_bytes];
        let payloads = encoder.encode(&codes, bits, 0, row).map_err(failed)?;
        nodes.push(OutNode {
            key: node.key,
            child_mask: node.child_mask,
            points: node.points,
            bounds: node.bounds,
            geometric_error: node.geometric_error,
            spacing: node.spacing,
            normal_cone: node.normal_cone,
            payloads,
            part: 0,
            starts,
        });
    }
    assemble::sort(&mut nodes);
    encoder.ranges.fill(&mut manifest);
    let folder = output.parent().map(Path::to_path_buf).unwrap_or_default();
    let blobs = Blobs::new(1, u64::MAX, folder);
    blobs.put(0, encoder.buffers)?;
    assemble::write(output, &manifest, &nodes, &blobs.finish(), &|_| Ok(()))?;
    Ok(())
}

/// The stored values of all columns, point by point.
fn rows(layout: &Layout, points: &NodePoints) -> Vec<u8> {
    let mut rows = vec![0; points.positions.len() * layout.row_bytes];
    for column in &points.columns {
        let (len, offset) =
            (layout.attributes[column.attribute].value_bytes(), layout.offsets[column.attribute]);
        for (row, value) in
            rows.chunks_exact_mut(layout.row_bytes).zip(column.bytes.chunks_exact(len))
        {
            row[offset..offset + len].copy_from_slice(value);
        }
    }
    rows
}
