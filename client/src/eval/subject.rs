//! A dataset under evaluation: its file, its tree, and the truth of any view of it.

use std::{
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use anyhow::Context;
use glam::DVec3;
use lodestream_preprocess::FileSource as PositionedFile;
use lodestream_protocol::{Dataset, Manifest, Node, Refinement};
use rayon::prelude::*;

use crate::{
    engine::DrawNode,
    render::{Picture, RenderSettings, TruthRenderer, VisibleTree},
    source::FileSource,
};

/// Points that are decoded at a time for a truth.
const BATCH_POINTS: u64 = 1 << 20;

/// An open dataset.
pub struct Subject {
    /// Of the file, without its ending.
    pub name: String,
    /// The file.
    pub path: PathBuf,
    /// Its manifest, as the one of one cloud.
    pub clouds: Vec<Arc<Manifest>>,
    /// Where the cloud lies, world units.
    pub bounds: [DVec3; 2],
    /// Where its points have their middle.
    pub middle: DVec3,
    dataset: Dataset<PositionedFile>,
    /// The nodes that hold every point once.
    nodes: Vec<Node>,
}

impl Subject {
    /// Opens a dataset.
    ///
    /// # Errors
    /// Where the file cannot be read, is no dataset, or has no points.
    pub fn open(path: &Path) -> anyhow::Result<Self> {
        let context = || path.display().to_string();
        let dataset = Dataset::open(PositionedFile::open(path)?).with_context(context)?;
        let manifest = Arc::new(dataset.manifest().clone());
        let mut nodes = dataset.hierarchy().with_context(context)?;
        let Some((bounds, root)) = manifest.bounds_world().zip(nodes.first()) else {
            anyhow::bail!("{}: has no points, so that there is nothing to evaluate", context());
        };
        let top = dataset.read_node(root, &[0]).with_context(context)?;
        let count = top.positions.len().max(1) as f64;
        let corner = manifest.lattice.node_min(root.key);
        // The middle point on each axis: not drawn away by what lies far outside.
        let middle = std::array::from_fn(|axis| {
            let mut along: Vec<u32> = top.positions.iter().map(|q| q[axis]).collect();
            along.sort_unstable();
            corner[axis].saturating_add(along.get(count as usize / 2).copied().unwrap_or(0))
        });
        let middle = manifest.lattice.world(middle).into();
        if manifest.refinement == Refinement::Replace {
            nodes.retain(Node::is_leaf);
        }
        nodes.sort_by_key(|node| node.key);
        let name = path.file_stem().map(|name| name.to_string_lossy().into_owned());
        Ok(Self {
            name: name.unwrap_or_default(),
            path: path.to_owned(),
            clouds: vec![manifest],
            bounds: [bounds.0.into(), bounds.1.into()],
            middle,
            dataset,
            nodes,
        })
    }

    /// The manifest.
    #[must_use]
    pub fn manifest(&self) -> &Manifest {
        &self.clouds[0]
    }

    /// The names of the attributes that pictures of such settings show.
    #[must_use]
    pub fn shown(&self, settings: &RenderSettings) -> Vec<String> {
        let manifest = self.manifest();
        let shown = settings.attributes(manifest).into_iter();
        shown.map(|index| manifest.attributes[index].name.clone()).collect()
    }

    /// The file, to be put behind a link.
    ///
    /// # Errors
    /// Where it cannot be opened any more.
    pub fn file(&self) -> anyhow::Result<FileSource> {
        Ok(FileSource::open(&self.path)?)
    }

    /// The nodes that hold every point once.
    #[must_use]
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The picture of all points, `samples` by `samples` a pixel, placed as the seed says.
    ///
    /// # Errors
    /// Where the file cannot be read, the view cannot be drawn, or `cancel` is set.
    pub fn truth(
        &self,
        settings: &RenderSettings,
        samples: u32,
        seed: u64,
        cancel: &AtomicBool,
    ) -> anyhow::Result<Picture> {
        let tree = VisibleTree::of(self.nodes.iter().map(|n| (0, n.key, n.spacing)));
        let renderer = TruthRenderer::new(settings, &self.clouds, tree, samples)?;
        let mut renderer = renderer.jittered(seed);
        let groups = settings.groups(self.manifest());
        for pass in 0..renderer.passes() {
            if pass > 0 {
                renderer.next_pass()?;
            }
            let mut rest = self.nodes.as_slice();
            while !rest.is_empty() {
                if cancel.load(Ordering::Relaxed) {
                    anyhow::bail!("interrupted");
                }
                let mut points = 0;
                let fits = |node: &&Node| {
                    points += u64::from(node.points);
                    points <= BATCH_POINTS
                };
                // One node at least, however large.
                let count = rest.iter().take_while(fits).count().max(1);
                let (batch, next) = rest.split_at(count);
                rest = next;
                let read = |node: &Node| self.dataset.read_node(node, &groups);
                let decoded = batch.par_iter().map(read).collect::<Result<Vec<_>, _>>();
                let decoded = decoded.with_context(|| self.path.display().to_string())?;
                for (node, points) in batch.iter().zip(decoded) {
                    let (key, spacing) = (node.key, node.spacing);
                    renderer.add_node(DrawNode {
                        cloud: 0,
                        key,
                        spacing,
                        points: Arc::new(points),
                        part: 0,
                    })?;
                }
            }
        }
        Ok(renderer.finish()?.picture)
    }
}
