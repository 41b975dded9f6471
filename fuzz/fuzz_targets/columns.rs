//! A node's columns: positions and attributes of every type, in every encoding.
#![no_main]

use libfuzzer_sys::fuzz_target;
use lodestream_fuzz::{ColumnsInput, in_parts};
use lodestream_protocol::{Domain, Manifest, Node, decode_unchecked, encode_column};

/// The same bytes, as where the points lie in their cells and what their colours lack.
fn second_part(manifest: &Manifest, node: &Node, payload: &[u8]) {
    let Ok(decoded) = decode_unchecked(manifest, 1, node, payload) else { return };
    if let Some(colors) = decoded.fine_colors {
        let bytes = manifest.attributes[colors.attribute].value_bytes() * node.points as usize;
        colors.refine(&mut vec![0; bytes]).expect("as many as the node has");
    }
    let Some(fine) = decoded.fine else { return };
    assert_eq!(fine.offsets.len(), node.points as usize);
    let inside = |q: &[u32; 3]| q.iter().all(|&v| u64::from(v) >> fine.cell_bits == 0);
    assert!(fine.offsets.iter().all(inside), "a position outside its cell");
}

/// All that a node has, or what comes first of it.
fn first_part(manifest: &Manifest, node: &Node, payload: &[u8]) {
    let Ok(decoded) = decode_unchecked(manifest, 0, node, payload) else { return };
    let count = node.points as usize;
    assert_eq!(decoded.positions.len(), count);
    let bits = manifest.lattice.node_bits(node.key.level());
    let inside = |q: &[u32; 3]| q.iter().all(|&v| u64::from(v) >> bits == 0);
    assert!(decoded.positions.iter().all(inside), "a position outside its node");
    for column in &decoded.columns {
        let attribute = &manifest.attributes[column.attribute];
        assert_eq!(column.bytes.len() % attribute.value_bytes(), 0);
        if attribute.domain == Domain::Element {
            assert_eq!(column.bytes.len() / attribute.value_bytes(), count);
            // What was decoded can be stored.
            encode_column(&mut Vec::new(), attribute, &column.bytes).expect("a decoded column");
        }
    }
}

fuzz_target!(|data: &[u8]| {
    let Some(ColumnsInput { manifest, node, payload }) = ColumnsInput::parse(data) else { return };
    first_part(&manifest, &node, payload);
    let parted = in_parts(&manifest);
    first_part(&parted, &node, payload);
    second_part(&parted, &node, payload);
});
