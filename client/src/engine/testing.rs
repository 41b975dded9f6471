//! Trees by hand, for tests.

use lodestream_protocol::{
    Boot, Header, HierarchyPage, Lattice, LatticeBox, Manifest, Method, Node, NodeKey,
};

/// A manifest without points and attributes.
pub fn manifest() -> Manifest {
    Manifest {
        method: Method { name: "test".into(), grid: 128, leaf_capacity: 1000 },
        lattice: Lattice { scale: 1.0, offset: [0.0; 3], origin: [0; 3], side_bits: 16 },
        ..Manifest::empty()
    }
}

/// A leaf of one point, without payloads.
pub fn node(key: NodeKey) -> Node {
    Node {
        key,
        child_mask: 0,
        points: 1,
        bounds: LatticeBox::EMPTY,
        geometric_error: 0.0,
        spacing: 0.0,
        normal_cone: None,
        payloads: Vec::new(),
        child_page: None,
    }
}

/// The index of a file whose lengths nobody looks at.
pub fn boot(content_id: [u8; 16], manifest: Manifest, nodes: Vec<Node>) -> Boot {
    let header = Header {
        version: (1, 0),
        manifest_bytes: 0,
        root_page_bytes: 0,
        boot_bytes: 0,
        file_bytes: 0,
        content_id,
        index_crc: 0,
    };
    Boot { header, manifest, root_page: HierarchyPage { nodes } }
}
