//! The clouds of a plan, by number.

use std::sync::Arc;

use lodestream_protocol::{
    Boot, GroupInfo, Lattice, LatticeBox, Manifest, Method, Primitive, Refinement,
};

/// What the clouds are, shared by all plans until one of them changes.
#[derive(Debug)]
pub(super) struct Clouds {
    list: Arc<[Arc<Manifest>]>,
    /// Stands for those that are not open, or removed.
    nothing: Arc<Manifest>,
}

impl Clouds {
    pub fn new() -> Self {
        Self { list: Arc::default(), nothing: Arc::new(nothing()) }
    }

    pub fn list(&self) -> Arc<[Arc<Manifest>]> {
        Arc::clone(&self.list)
    }

    /// Sets the cloud of that number.
    pub fn set(&mut self, number: usize, boot: Option<&Boot>) {
        let manifest = match boot {
            Some(boot) => Arc::new(boot.manifest.clone()),
            None => Arc::clone(&self.nothing),
        };
        let mut list = self.list.to_vec();
        list.resize(list.len().max(number + 1), Arc::clone(&self.nothing));
        list[number] = manifest;
        self.list = list.into();
    }
}

/// The manifest of a cloud without points.
fn nothing() -> Manifest {
    Manifest {
        generator: String::new(),
        points: 0,
        nodes: 0,
        levels: 0,
        refinement: Refinement::Additive,
        primitive: Primitive::Point,
        method: Method { name: String::new(), grid: 1, leaf_capacity: 0 },
        lattice: Lattice { scale: 1.0, offset: [0.0; 3], origin: [0; 3], side_bits: 1 },
        bounds: LatticeBox::EMPTY,
        largest_rounding: 0.0,
        attributes: Vec::new(),
        groups: vec![GroupInfo { name: "base".into(), columns: vec![0] }],
        fine: None,
        crs: None,
        sources: Vec::new(),
    }
}
