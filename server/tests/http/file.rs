//! A dataset's file.

use lodestream_protocol::{
    Attribute, Boot, Domain, GroupInfo, HierarchyPage, Lattice, LatticeBox, Manifest, Method,
    Primitive, Refinement, ScalarType, Storage,
};

/// A dataset without points, followed by `tail` filler bytes: sound to its header, and all that a
/// host looks at.
pub fn dataset(seed: u8, tail: usize) -> Vec<u8> {
    let lattice = Lattice { scale: 0.01, offset: [0.0; 3], origin: [0; 3], side_bits: 10 };
    let color = Attribute {
        name: "color".into(),
        scalar: ScalarType::U8,
        components: 3,
        domain: Domain::Element,
        storage: Storage::Column { group: 0 },
        min: vec![],
        max: vec![],
    };
    let manifest = Manifest {
        generator: format!("test {seed}"),
        points: 0,
        nodes: 0,
        levels: 0,
        refinement: Refinement::Additive,
        primitive: Primitive::Point,
        method: Method { name: "poisson".into(), grid: 128, leaf_capacity: 16384 },
        lattice,
        bounds: LatticeBox::EMPTY,
        largest_rounding: 0.0,
        attributes: vec![color],
        fine: None,
        groups: vec![GroupInfo { name: "base".into(), columns: vec![0, 0] }],
        crs: None,
        sources: vec![],
    };
    let page = HierarchyPage::encode(&[], vec![0], &lattice).expect("an empty page");
    let mut bytes = Boot::encode(&manifest, &page, 0, tail as u64).expect("a sound manifest");
    let mut state = u32::from(seed) + 1;
    bytes.extend((0..tail).map(|_| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    }));
    bytes
}
