//! Twins of a dataset whose nodes are stored otherwise: what streaming them so costs.

use std::{io, path::Path};

use lodestream_protocol::{
    Dataset, Error as FormatError, Manifest, MortonCode, Node, NodePoints, ReadAt,
};

use crate::{
    assemble,
    blobs::Blobs,
    encode::{Layout, NodeEncoder, OutNode, Payload},
    error::{Error, Result},
};

/// Writes a dataset of the same nodes, points and columns to `output`, positions and colours in one part. Holds the
/// encoded payloads in memory.
///
/// # Errors
/// Where the dataset cannot be read, or the file not be written.
pub fn with_whole_positions<R: ReadAt>(dataset: &Dataset<R>, output: &Path) -> Result<()> {
    let mut manifest = in_one_part(dataset.manifest());
    let layout = Layout::of(&manifest);
    let mut encoder = NodeEncoder::new(&layout);
    let nodes = each_node(dataset, output, |node, points| {
        let rows = rows(&layout, points);
        let codes: Vec<u128> = points.positions.iter().map(|&q| MortonCode::encode(q)).collect();
        let bits = manifest.lattice.node_bits(node.key.level());
        let starts = starts(&encoder.buffers);
        let row = |point: usize| &rows[point * layout.row_bytes..][..layout.row_bytes];
        let payloads = encoder.encode(&codes, bits, 0, row);
        Ok((payloads.map_err(format_error(output))?, starts))
    })?;
    encoder.ranges.fill(&mut manifest);
    write(output, &manifest, nodes, encoder.buffers)
}

/// Writes a file of the same tree to `output` in which a node is what `encode` makes of it, all in group 0. It is
/// for measuring what fetching another encoding costs: nothing here decodes it. Holds the payloads in memory.
///
/// # Errors
/// Where the dataset cannot be read, a node not be encoded, or the file not be written.
pub fn with_foreign_payloads<R: ReadAt>(
    dataset: &Dataset<R>,
    output: &Path,
    mut encode: impl FnMut(&Manifest, &NodePoints) -> io::Result<Vec<u8>>,
) -> Result<()> {
    let manifest = in_one_part(dataset.manifest());
    let mut buffers = vec![Vec::new(); manifest.groups.len()];
    let nodes = each_node(dataset, output, |_, points| {
        let encoded = encode(dataset.manifest(), points).and_then(|payload| {
            let bytes = u32::try_from(payload.len()).map_err(io::Error::other)?;
            Ok((Payload { bytes, crc: crc32fast::hash(&payload) }, payload))
        });
        let (reference, payload) = encoded.map_err(Error::io(output, "cannot encode a node"))?;
        let starts = starts(&buffers);
        buffers[0].extend(payload);
        let mut payloads = vec![Payload::default(); buffers.len()];
        payloads[0] = reference;
        Ok((payloads, starts))
    })?;
    write(output, &manifest, nodes, buffers)
}

/// The manifest without parts.
fn in_one_part(manifest: &Manifest) -> Manifest {
    let mut manifest = manifest.clone();
    if let Some(fine) = manifest.fine.take() {
        // An empty group: the others keep their numbers.
        manifest.groups[fine.group].columns.clear();
    }
    manifest
}

/// A node's payloads, and where they begin in the buffers.
type Encoded = (Vec<Payload>, Vec<u64>);

/// Encodes every node.
fn each_node<R: ReadAt>(
    dataset: &Dataset<R>,
    output: &Path,
    mut encode: impl FnMut(&Node, &NodePoints) -> Result<Encoded>,
) -> Result<Vec<OutNode>> {
    let groups: Vec<usize> = (0..dataset.manifest().groups.len()).collect();
    let encode = |node: Node| {
        let points = dataset.read_node(&node, &groups).map_err(format_error(output))?;
        let (payloads, starts) = encode(&node, &points)?;
        Ok(OutNode {
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
        })
    };
    let nodes = dataset.hierarchy().map_err(format_error(output))?;
    nodes.into_iter().map(encode).collect()
}

fn starts(buffers: &[Vec<u8>]) -> Vec<u64> {
    buffers.iter().map(|buffer| buffer.len() as u64).collect()
}

fn write(
    output: &Path,
    manifest: &Manifest,
    mut nodes: Vec<OutNode>,
    buffers: Vec<Vec<u8>>,
) -> Result<()> {
    assemble::sort(&mut nodes);
    let folder = output.parent().map(Path::to_path_buf).unwrap_or_default();
    let blobs = Blobs::new(1, u64::MAX, folder);
    blobs.put(0, buffers)?;
    assemble::write(output, manifest, &nodes, &blobs.finish(), &|_| Ok(()))?;
    Ok(())
}

fn format_error(output: &Path) -> impl FnOnce(FormatError) -> Error {
    let path = output.display().to_string();
    |source| Error::Format { path, source }
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
