//! The clouds of a plan, by number.

use std::sync::Arc;

use lodestream_protocol::{Boot, Manifest};

/// What the clouds are, shared by all plans until one of them changes.
#[derive(Debug)]
pub(super) struct Clouds {
    list: Arc<[Arc<Manifest>]>,
    /// Stands for those that are not open, or removed.
    nothing: Arc<Manifest>,
}

impl Clouds {
    pub fn new() -> Self {
        Self { list: Arc::default(), nothing: Arc::new(Manifest::empty()) }
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
