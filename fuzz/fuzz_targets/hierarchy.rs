//! Hierarchy pages: a root page, and a page of children for every node that names one.
#![no_main]

use libfuzzer_sys::fuzz_target;
use lodestream_fuzz::HierarchyInput;
use lodestream_protocol::{Boot, HierarchyPage, LatticeBox, Manifest};

fuzz_target!(|data: &[u8]| {
    let Some(input) = HierarchyInput::parse(data) else { return };
    let Some(sealed) = input.seal() else { return };
    let Ok(boot) = Boot::parse(&sealed) else { return };
    check(&boot.root_page, &boot.manifest);
    for node in &boot.root_page.nodes {
        if let Some(Ok(children)) = input.child_page_of(&boot, node) {
            check(&children, &boot.manifest);
        }
    }
});

/// What the traversal and the renderer rely on.
fn check(page: &HierarchyPage, manifest: &Manifest) {
    for node in &page.nodes {
        assert!(node.key.level() < manifest.levels);
        assert_eq!(node.payloads.len(), manifest.groups.len());
        assert!(node.geometric_error >= 0.0 && node.spacing >= 0.0);
        let LatticeBox { min, max } = node.bounds;
        let _ = (manifest.lattice.world(min), manifest.lattice.world(max));
        assert_eq!(node.children().count(), node.child_mask.count_ones() as usize);
    }
}
