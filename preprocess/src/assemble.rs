//! Writes the dataset file: pages, payloads in the order clients ask for them, one rename at the end.

use std::{collections::HashMap, io::Write, path::Path};

use lodestream_protocol::{
    BOOT_SPECULATIVE_BYTES, Boot, HierarchyPage, Manifest, Node, NodeKey, PageRef, PayloadRef,
    morton_encode,
};

use crate::{
    blobs::FinishedBlobs,
    encode::OutNode,
    error::{Error, Result},
    target::Target,
};

/// Most nodes in a page, unless one level alone has more: about 150 KiB.
const PAGE_NODES: usize = 4096;

/// Removes leaves that kept no points, and parents that this leaves without anything.
pub fn prune(nodes: &mut Vec<OutNode>) {
    let mut index: HashMap<NodeKey, usize> =
        nodes.iter().enumerate().map(|(i, n)| (n.key, i)).collect();
    let mut order: Vec<usize> = (0..nodes.len()).collect();
    order.sort_by_key(|&i| std::cmp::Reverse(nodes[i].key.level()));
    let mut empty = vec![false; nodes.len()];
    for i in order {
        let node = &nodes[i];
        let Some(parent) = node.key.parent() else { continue };
        if node.points == 0 && node.child_mask == 0 {
            empty[i] = true;
            let octant = node.key.octant();
            let parent = index.get_mut(&parent).expect("every node's parent is there");
            nodes[*parent].child_mask &= !(1 << octant);
        }
    }
    let mut keep = empty.iter().map(|e| !e);
    nodes.retain(|_| keep.next().unwrap_or(true));
    for node in nodes {
        // A parent whose children all gave their points away is a leaf now: nothing is missing.
        if node.child_mask == 0 {
            node.geometric_error = 0.0;
        }
    }
}

/// Breadth-first order: by level, then Morton order.
pub fn sort(nodes: &mut [OutNode]) {
    nodes.sort_by_cached_key(|n| {
        let [x, y, z] = n.key.coords();
        let high = morton_encode([x >> 21, y >> 21, z >> 21]);
        (n.key.level(), high, morton_encode([x, y, z].map(|c| c & 0x1f_ffff)))
    });
}

/// One page: nodes by index, and where its children's pages hang.
#[derive(Debug, Default)]
struct Page {
    nodes: Vec<usize>,
    /// `(place in nodes, page)`.
    children: Vec<(usize, usize)>,
}

/// Splits the tree into pages: whole levels from the page's top, as long as they fit.
fn paginate(nodes: &[OutNode]) -> Vec<Page> {
    let index: HashMap<NodeKey, usize> =
        nodes.iter().enumerate().map(|(i, n)| (n.key, i)).collect();
    let children_of = |i: usize| -> Vec<usize> {
        let node = &nodes[i];
        (0..8)
            .filter(|o| node.child_mask >> o & 1 == 1)
            .filter_map(|o| node.key.child(o))
            .map(|key| index[&key])
            .collect()
    };
    let mut pages: Vec<Page> = Vec::new();
    let seeds: Vec<usize> = if nodes.is_empty() { vec![] } else { vec![0] };
    pages.push(Page { nodes: seeds, children: Vec::new() });
    let mut next = 0;
    while next < pages.len() {
        let mut level = pages[next].nodes.clone();
        let mut first_of_level = 0;
        loop {
            let below: Vec<Vec<usize>> = level.iter().map(|&i| children_of(i)).collect();
            let count: usize = below.iter().map(Vec::len).sum();
            if count == 0 {
                break;
            }
            if pages[next].nodes.len() + count > PAGE_NODES && pages[next].nodes.len() > 8 {
                for (place, children) in below.into_iter().enumerate() {
                    if !children.is_empty() {
                        let page = pages.len();
                        pages.push(Page { nodes: children, children: Vec::new() });
                        pages[next].children.push((first_of_level + place, page));
                    }
                }
                break;
            }
            first_of_level = pages[next].nodes.len();
            level = below.into_iter().flatten().collect();
            pages[next].nodes.extend(&level);
        }
        next += 1;
    }
    pages
}

/// What was written.
#[derive(Debug, Clone, Copy)]
pub struct Written {
    /// Length of the file.
    pub file_bytes: u64,
    /// Bytes of header, manifest and all hierarchy pages.
    pub index_bytes: u64,
}

/// Writes the file beside `output`, syncs it, and renames it to `output`. `nodes` are in
/// breadth-first order.
///
/// # Errors
/// Where the file cannot be written; nothing is left behind then.
pub fn write(
    output: &Path,
    manifest: &Manifest,
    nodes: &[OutNode],
    blobs: &FinishedBlobs,
    advance: &dyn Fn(u64) -> Result<()>,
) -> Result<Written> {
    let groups = manifest.groups.len();
    let pages = paginate(nodes);
    // Group offsets per page, counted from the end of the index.
    let mut offset = 0;
    let mut group_offsets = vec![vec![0u64; groups]; pages.len()];
    for group in 0..groups {
        for (page, offsets) in pages.iter().zip(&mut group_offsets) {
            offsets[group] = offset;
            offset +=
                page.nodes.iter().map(|&i| u64::from(nodes[i].payloads[group].bytes)).sum::<u64>();
        }
    }
    let payload_bytes = offset;
    // Children's pages come after their parents' in the list, so encode from the back: a page holds
    // its children's lengths and checksums.
    let mut encoded: Vec<Vec<u8>> = vec![Vec::new(); pages.len()];
    let mut refs: Vec<Option<PageRef>> = vec![None; pages.len()];
    let mut tail = Vec::new();
    for (index, page) in pages.iter().enumerate().rev() {
        let mut wire: Vec<Node> = page.nodes.iter().map(|&i| to_node(&nodes[i])).collect();
        for &(place, child) in &page.children {
            wire[place].child_page = refs[child];
        }
        let bytes =
            HierarchyPage::encode(&wire, group_offsets[index].clone(), &manifest.lattice)
                .map_err(|source| Error::Format { path: output.display().to_string(), source })?;
        if index > 0 {
            refs[index] = Some(PageRef {
                offset: payload_bytes + tail.len() as u64,
                bytes: bytes.len() as u32,
                nodes: page.nodes.len() as u32,
                crc: crc32fast::hash(&bytes),
            });
            tail.extend_from_slice(&bytes);
        }
        encoded[index] = bytes;
    }
    let top = top_payload_bytes(manifest, &encoded[0], &pages[0], nodes);
    let tail_bytes = payload_bytes + tail.len() as u64;
    let index = Boot::encode(manifest, &encoded[0], top, tail_bytes)
        .map_err(|source| Error::Format { path: output.display().to_string(), source })?;

    let failed = |e| Error::io(output, "cannot write")(e);
    let mut file = Target::create(output)?;
    file.write_all(&index).map_err(failed)?;
    for group in 0..groups {
        for &i in pages.iter().flat_map(|page| &page.nodes) {
            let node = &nodes[i];
            let bytes = node.payloads[group].bytes;
            blobs.copy(node.part, group, node.starts[group], bytes, &mut |payload| {
                file.write_all(payload).map_err(failed)
            })?;
            advance(u64::from(bytes))?;
        }
    }
    file.write_all(&tail).map_err(failed)?;
    file.finish()?;
    Ok(Written {
        file_bytes: index.len() as u64 + tail_bytes,
        index_bytes: (index.len() + tail.len()) as u64,
    })
}

/// Payloads of group 0, from the root on, that fit the first request a client makes: at least the
/// root's.
fn top_payload_bytes(manifest: &Manifest, page: &[u8], root: &Page, nodes: &[OutNode]) -> u64 {
    let index = manifest.to_json().map_or(0, |json| json.len()) + page.len() + 64;
    let mut bytes = 0;
    for (place, &i) in root.nodes.iter().enumerate() {
        let next = bytes + u64::from(nodes[i].payloads[0].bytes);
        if place > 0 && index as u64 + next > BOOT_SPECULATIVE_BYTES {
            break;
        }
        bytes = next;
    }
    bytes
}

fn to_node(node: &OutNode) -> Node {
    Node {
        key: node.key,
        child_mask: node.child_mask,
        points: node.points,
        bounds: node.bounds,
        geometric_error: node.geometric_error,
        spacing: node.spacing,
        normal_cone: node.normal_cone,
        payloads: node
            .payloads
            .iter()
            .map(|p| PayloadRef { offset: 0, bytes: p.bytes, crc: p.crc })
            .collect(),
        child_page: None,
    }
}
