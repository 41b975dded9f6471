//! A dataset under evaluation: its file, its tree, and the truth of any view of it.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, atomic::AtomicBool},
    time::Duration,
};

use anyhow::Context;
use glam::DVec3;
use lodestream_preprocess::{FileSource as PositionedFile, with_whole_positions};
use lodestream_protocol::{Dataset, Manifest, Node};

use crate::{
    engine::{EngineConfig, FramePlan, Policy, SimulatedEngine},
    full_resolution,
    interrupt::go_on,
    render::{Picture, RenderSettings, TruthRenderer, VisibleTree},
    source::{FileSource, ForeignSizes, Link, LinkSpec, Source},
};

use super::potree;

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
    /// The same points with positions in one part, where the file has them in two.
    whole: Option<PathBuf>,
    /// What the nodes of that file weigh in Potree's encoding.
    potree: Option<potree::Weights>,
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
        let nodes = dataset.hierarchy().with_context(context)?;
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
        let nodes = full_resolution::nodes(manifest.refinement, nodes);
        let name = path.file_stem().map(|name| name.to_string_lossy().into_owned());
        Ok(Self {
            name: name.unwrap_or_default(),
            whole: None,
            potree: None,
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

    /// Prepares for the rivals' policies: they know no positions and colours in two parts, and fetch of every node a
    /// range that holds all of it. So they fetch from a twin, which is written to `folder`. For one of them
    /// the nodes are weighed in its own encoding; `shown` are the groups that the picture needs.
    ///
    /// # Errors
    /// Where the twin cannot be written or read.
    pub fn prepare_rivals(
        &mut self,
        folder: &Path,
        policies: &[Policy],
        shown: &[usize],
    ) -> anyhow::Result<()> {
        if self.manifest().fine.is_some() && policies.iter().any(|p| *p != Policy::Ours) {
            let path = folder.join(format!("{}.lods", self.name));
            with_whole_positions(&self.dataset, &path)?;
            self.whole = Some(path);
        }
        if policies.contains(&Policy::PotreeBrotli) {
            let path = self.whole.as_ref().unwrap_or(&self.path);
            let dataset = Dataset::open(PositionedFile::open(path)?)?;
            self.potree = Some(potree::weigh(&dataset, shown)?);
        }
        Ok(())
    }

    /// Bytes of all nodes in Potree's encoding, where they were weighed.
    #[must_use]
    pub fn potree_bytes(&self) -> Option<u64> {
        self.potree.as_ref().map(|weights| weights.nodes.values().sum())
    }

    /// The same of files that were made without the attributes that are not shown.
    #[must_use]
    pub fn potree_shown_bytes(&self) -> Option<u64> {
        self.potree.as_ref().map(|weights| weights.shown)
    }

    /// An engine that fetches the dataset by such a link and policy, in simulated time.
    ///
    /// # Errors
    /// Where the file cannot be opened any more.
    pub fn engine(
        &self,
        config: EngineConfig,
        policy: Policy,
        link: LinkSpec,
        seed: u64,
    ) -> anyhow::Result<Visitor> {
        let path = match (policy, &self.whole) {
            (Policy::Potree | Policy::PotreeBrotli | Policy::Fraiss, Some(whole)) => whole,
            _ => &self.path,
        };
        let config = policy.apply(config);
        let (file, link) = (FileSource::open(path)?, Link::new(link, seed));
        let weighed = self.potree.as_ref().filter(|_| policy == Policy::PotreeBrotli);
        let foreign =
            weighed.map(|weights| Arc::new(ForeignSizes::new(Arc::clone(&weights.nodes))));
        let source = match &foreign {
            Some(foreign) => Source::linked_as(file, link, Arc::clone(foreign)),
            None => Source::linked(file, link),
        };
        Ok(Visitor { engine: SimulatedEngine::start(vec![source], config)?, foreign })
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
            let done = |_| go_on(cancel);
            let drawn =
                full_resolution::draw(&mut renderer, 0, &self.dataset, &self.nodes, &groups, done);
            if let Err(error) = drawn {
                go_on(cancel)?;
                return Err(error.context(self.path.display().to_string()));
            }
        }
        Ok(renderer.finish()?.picture)
    }
}

/// Who fetches a dataset.
pub struct Visitor {
    /// The engine.
    pub engine: SimulatedEngine,
    /// Where its nodes weigh something else than their bytes in the file.
    foreign: Option<Arc<ForeignSizes>>,
}

impl Visitor {
    /// Bytes that came by the link since the start.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let extra = self.foreign.as_ref().map_or(0, |foreign| foreign.extra());
        self.engine.stats().since_start.totals.bytes.saturating_add_signed(extra)
    }
}

/// Lets so much time pass.
///
/// # Errors
/// Where something has failed for good, or `cancel` is set.
pub(super) fn advance(
    engine: &mut SimulatedEngine,
    time: Duration,
    cancel: &AtomicBool,
) -> anyhow::Result<Arc<FramePlan>> {
    go_on(cancel)?;
    let plan = engine.advance(time);
    match engine.stats().problems.first() {
        Some(problem) => anyhow::bail!("{problem}"),
        None => Ok(plan),
    }
}
