//! Nodes are found by their keys, by way of the hierarchy's pages.

#[path = "common/dataset.rs"]
mod dataset;

use dataset::Recipe;
use lodestream_protocol::{Dataset, NodeKey, Refinement};

#[test]
fn every_node_is_found_by_its_key_whatever_page_it_is_in() {
    for refinement in [Refinement::Additive, Refinement::Replace] {
        let bytes = dataset::dataset(Recipe { refinement, levels: 6, ..Recipe::default() });
        let dataset = Dataset::open(bytes).expect("a dataset");
        let nodes = dataset.hierarchy().expect("a hierarchy");
        assert!(nodes.iter().any(|node| node.key.level() == 5), "several pages deep");
        for node in &nodes {
            assert_eq!(dataset.node(node.key).expect("readable").as_ref(), Some(node));
        }
        let missing = (0..8)
            .filter_map(|octant| NodeKey::ROOT.child(octant))
            .find(|key| nodes.iter().all(|node| node.key != *key));
        if let Some(key) = missing {
            assert_eq!(dataset.node(key).expect("readable"), None);
            let below = key.child(3).expect("a child");
            assert_eq!(dataset.node(below).expect("readable"), None);
        }
    }
}
