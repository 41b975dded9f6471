//! A person in a hurry, on a bad line: a random walk with teleports over two clouds whose hosts are slow,
//! misbehave, die and come back with another dataset, while budget, cache, clip box and what is to be seen
//! change all the time. Real threads, real sockets.

use std::{
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use fastrand::Rng;
use glam::DVec3;
use lodestream_client::{
    camera::{Camera, Projection},
    engine::{ClipBox, Engine, EngineConfig, EngineError, EngineStats, FramePlan, View},
    render::{CpuRenderer, RenderSettings, Scene},
    source::{HttpSource, LinkSpec, Source, Timeouts},
};

use super::{
    drawn::{Picture, cells, picture, picture_in},
    host::{Answer, Host},
};

/// The last wait: on a bad line, this long is a deadlock.
const PATIENCE: Duration = Duration::from_secs(300);

/// What is to happen.
#[derive(Debug, Clone)]
pub struct Soak {
    /// Two clouds, and what the first is replaced by and back.
    pub clouds: [PathBuf; 2],
    pub other: PathBuf,
    pub length: Duration,
    pub seed: u64,
    /// Of each host.
    pub link: LinkSpec,
    pub size_px: [u32; 2],
    /// Least and most.
    pub budgets: [u64; 2],
    pub cache_bytes: u64,
    /// Times after which things happen: budget, cache, clip box and visibility; a host dies.
    pub step: Duration,
    pub death: Duration,
}

/// A frame, as its caller saw it.
#[derive(Debug, Clone)]
pub struct Seen {
    /// Milliseconds that setting the view and taking the plan took.
    pub call_ms: f64,
    /// Milliseconds that drawing took.
    pub draw_ms: f64,
    pub plan: Arc<FramePlan>,
    pub settings: RenderSettings,
}

/// What has happened.
#[derive(Debug)]
pub struct Outcome {
    pub frames: u64,
    pub teleports: u64,
    pub deaths: u64,
    pub replaced: u32,
    /// Largest accounted bytes: pinned and cached.
    pub most_bytes: u64,
    /// At the end, looking away: kept, and the limit.
    pub cached_bytes: u64,
    pub cache_limit: u64,
    /// At the end, no more exactly placed than what is expected.
    pub picture: Picture,
    pub expected: Picture,
    pub stats: EngineStats,
}

impl Soak {
    fn config(&self) -> EngineConfig {
        EngineConfig {
            point_budget: self.budgets[1],
            cache_bytes: self.cache_bytes,
            min_size_px: 2.0,
            ..EngineConfig::default()
        }
    }

    /// Runs; shows each frame to `look`.
    ///
    /// # Errors
    /// Where the engine does not settle in the end.
    pub fn run(&self, mut look: impl FnMut(Seen)) -> Result<Outcome, EngineError> {
        let mut rng = Rng::with_seed(self.seed);
        let [old, new, beside] = [&self.clouds[0], &self.other, &self.clouds[1]].map(|p| read(p));
        let mut hosts = [MovingHost::start(old.clone(), self), MovingHost::start(beside, self)];
        let engine = Engine::start(hosts.iter().map(MovingHost::source).collect(), self.config())?;
        let boots = engine.wait_open(PATIENCE)?;
        let corners = boots.iter().filter_map(|boot| boot.manifest.bounds_world());
        let room = corners.map(|(min, max)| (DVec3::from(min), DVec3::from(max)));
        let (min, max) = room.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).expect("points");
        let mut walker = Walker::new(min, max, self.size_px, rng.fork());
        let mut outcome = (0, 0, 0);
        let (frames, teleports, deaths) = (&mut outcome.0, &mut outcome.1, &mut outcome.2);
        let mut most_bytes = 0;
        let (begin, mut next_step, mut next_death) = (Instant::now(), self.step, self.death);
        let mut dead = false;
        while begin.elapsed() < self.length {
            *teleports += u64::from(walker.walk());
            let view = walker.view();
            let called = Instant::now();
            engine.set_view(view);
            let plan = engine.plan();
            let call_ms = milliseconds(called);
            let drawing = Instant::now();
            // The picture of the newest view is of the nodes that are there: as a window does.
            let scene = Scene { clouds: &plan.clouds, nodes: &plan.nodes };
            let settings = RenderSettings::new(self.size_px, view.camera);
            CpuRenderer.render(&scene, &settings).expect("can be drawn");
            let draw_ms = milliseconds(drawing);
            look(Seen { call_ms, draw_ms, plan, settings });
            *frames += 1;
            if begin.elapsed() >= next_step {
                next_step += self.step;
                self.meddle(&engine, &mut rng, (min, max));
            }
            if begin.elapsed() >= next_death {
                next_death += self.death;
                if dead {
                    hosts[0].come_back(if *deaths % 2 == 1 { new.clone() } else { old.clone() });
                } else {
                    hosts[0].die();
                    *deaths += 1;
                }
                dead = !dead;
            }
            let stats = engine.stats();
            most_bytes = most_bytes.max(stats.pinned_bytes + stats.cached_bytes);
            // As fast as a screen, no faster.
            std::thread::sleep(Duration::from_millis(15).saturating_sub(called.elapsed()));
        }
        // The last that is heard of the first host is another dataset.
        hosts[0].die();
        hosts[0].come_back(new);
        let files = [&self.other, &self.clouds[1]];
        engine.set_clip(None);
        engine.set_visible(0, true);
        engine.set_visible(1, true);
        engine.set_budget(self.config().point_budget);
        engine.set_min_size_px(self.config().min_size_px);
        let cache_limit = self.cache_bytes / 2;
        engine.set_cache_bytes(cache_limit);
        // Damage may have come three times in a row: such nodes are given another chance.
        engine.reopen(0);
        engine.reopen(1);
        let overview = overview(min, max, self.size_px);
        // Nodes of the view before count more.
        engine.set_view(away(overview));
        let cached_bytes = settle(&engine)?.cached_bytes;
        engine.set_view(overview);
        let plan = settle(&engine)?;
        let expected = self.expected(files, overview)?;
        let (frames, teleports, deaths) = outcome;
        Ok(Outcome {
            frames,
            teleports,
            deaths,
            replaced: engine.clouds().iter().map(|cloud| cloud.replaced).sum(),
            most_bytes,
            cached_bytes,
            cache_limit,
            picture: picture_in(&plan, &cells(&expected)),
            expected: picture(&expected),
            stats: engine.stats(),
        })
    }

    /// Changes something, and the budget.
    fn meddle(&self, engine: &Engine, rng: &mut Rng, (min, max): (DVec3, DVec3)) {
        let [least, most] = self.budgets.map(|budget| (budget as f64).ln());
        engine.set_budget((least + (most - least) * rng.f64()).exp() as u64);
        match rng.u8(0..6) {
            0 => _ = engine.set_visible(1, rng.bool()),
            1 => {
                let corner = min + (max - min) * DVec3::new(rng.f64(), rng.f64(), 0.0);
                let clip = ClipBox { min: corner, max: corner + 0.5 * (max - min) };
                engine.set_clip(rng.bool().then_some(clip));
            }
            2 => _ = engine.set_cache_bytes(rng.u64(0..=self.cache_bytes)),
            3 => _ = engine.set_min_size_px(1.0 + 40.0 * rng.f64()),
            _ => {}
        }
        if rng.u8(0..6) == 0 {
            engine.set_min_size_px(self.config().min_size_px);
        }
    }

    /// What a cold start from files settles on.
    fn expected(&self, files: [&PathBuf; 2], view: View) -> Result<Arc<FramePlan>, EngineError> {
        let source = |path: &PathBuf| Source::parse(path.to_str().expect("a path")).expect("opens");
        let engine = Engine::start(files.map(source).into(), self.config())?;
        engine.set_view(view);
        settle(&engine)
    }
}

/// All that is there, whatever failed on the way: failures heal.
fn settle(engine: &Engine) -> Result<Arc<FramePlan>, EngineError> {
    let begin = Instant::now();
    loop {
        match engine.wait_settled(PATIENCE) {
            Ok(plan) if plan.left_out.failed.nodes == 0 => return Ok(plan),
            Ok(_) | Err(EngineError::Cloud(_)) if begin.elapsed() < PATIENCE => {
                std::thread::sleep(Duration::from_millis(10));
            }
            other => return other,
        }
    }
}

fn read(path: &Path) -> Vec<u8> {
    std::fs::read(path).expect("a dataset")
}

fn milliseconds(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}

fn overview(min: DVec3, max: DVec3, size_px: [u32; 2]) -> View {
    let aspect = f64::from(size_px[0]) / f64::from(size_px[1]);
    View { camera: Camera::overview(min, max, aspect), size_px }
}

fn away(mut view: View) -> View {
    view.camera.target = 2.0 * view.camera.eye - view.camera.target;
    view
}

/// A host on a bad line.
struct MovingHost {
    host: Host,
    is_other: Arc<AtomicBool>,
    first: Vec<u8>,
}

impl MovingHost {
    fn start(file: Vec<u8>, soak: &Soak) -> Self {
        let is_other = Arc::new(AtomicBool::new(false));
        let (mut rng, tag) = (Rng::with_seed(soak.seed ^ file.len() as u64), Arc::clone(&is_other));
        let first = file.clone();
        let host = Host::start(file, move |_| match rng.u8(..) {
            0..8 => Answer::Status(503),
            8..20 => Answer::CutShort { share: rng.f64() },
            20..28 => Answer::Close,
            28..32 => Answer::WrongRange,
            32..40 => Answer::Late(Duration::from_millis(30)),
            40 => Answer::Garbage,
            _ if tag.load(Ordering::Relaxed) => Answer::Tagged("\"second\""),
            _ => Answer::Good,
        });
        host.throttle(soak.link);
        Self { host, is_other, first }
    }

    fn source(&self) -> Source {
        let silence = Duration::from_secs(10);
        let timeouts = Timeouts { connect: silence, silence };
        let url = self.host.url().parse().expect("a URL");
        Source::Http(HttpSource::with_timeouts(url, timeouts))
    }

    fn die(&mut self) {
        self.host.stop();
    }

    /// Is there again, with that file.
    fn come_back(&mut self, file: Vec<u8>) {
        self.is_other.store(file != self.first, Ordering::Relaxed);
        self.host.replace(file);
        self.host.restart();
    }
}

/// Where the person is.
struct Walker {
    min: DVec3,
    max: DVec3,
    size_px: [u32; 2],
    eye: DVec3,
    target: DVec3,
    drift: DVec3,
    rng: Rng,
}

impl Walker {
    fn new(min: DVec3, max: DVec3, size_px: [u32; 2], rng: Rng) -> Self {
        let camera = overview(min, max, size_px).camera;
        Self { min, max, size_px, eye: camera.eye, target: camera.target, drift: DVec3::ZERO, rng }
    }

    fn place(&mut self) -> DVec3 {
        let at = DVec3::new(self.rng.f64(), self.rng.f64(), self.rng.f64());
        self.min + at * (self.max - self.min)
    }

    /// A step; returns whether it was a jump.
    fn walk(&mut self) -> bool {
        let jumps = self.rng.u8(..) < 4;
        if jumps {
            self.target = self.place();
            let distance = (self.max - self.min).length() * (0.02 + self.rng.f64());
            self.eye = self.target
                + distance * DVec3::new(self.rng.f64() - 0.5, self.rng.f64() - 0.5, 0.3);
        } else {
            let pull = self.place() - self.target;
            self.drift = 0.95 * self.drift + 0.002 * pull;
            self.eye += self.drift;
            self.target += 0.5 * self.drift;
        }
        jumps
    }

    fn view(&self) -> View {
        let projection = Projection::Perspective { fov_y: 0.9 };
        let camera = Camera { eye: self.eye, target: self.target, up: DVec3::Z, projection };
        View { camera, size_px: self.size_px }
    }
}
