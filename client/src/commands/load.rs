//! `load`: many clients follow a camera path over a server's datasets.

use std::{
    io::IsTerminal,
    path::PathBuf,
    process::ExitCode,
    sync::{Mutex, PoisonError},
    time::Duration,
};

use anyhow::Context;
use clap::{ArgGroup, Args, value_parser};
use indicatif::{BinaryBytes, HumanCount, ProgressBar, ProgressDrawTarget, ProgressStyle};
use lodestream_server::commands::{cancel_on_interrupt, print};

use crate::{
    commands::command_line,
    engine::{EngineConfig, Policy},
    load::{self, Length, LoadConfig, MOST_CLIENTS, Standing},
    path::PathSource,
    source::LinkSpec,
};

/// Between two lines where there is no terminal.
const PLAIN_INTERVAL: Duration = Duration::from_secs(5);

/// Files that a client may have open at a time besides its connections, and the program altogether.
const SPARE_FILES: u64 = 100;

/// Load a server with many clients that follow a camera path, and tell what each waited for
#[derive(Debug, Clone, Args)]
#[command(group(ArgGroup::new("length").args(["duration", "loops"])))]
pub struct LoadArgs {
    /// Addresses of datasets that every client looks at together: URLs, or a server and a dataset
    #[arg(required = true, value_name = "URL")]
    pub sources: Vec<String>,
    /// What the cameras follow: a path file or a generator, such as 'orbit?seconds=20' or teleport
    /// (see PATHS.md); every client begins elsewhere on it
    #[arg(long, value_name = "FILE.json|GENERATOR", default_value = "orbit")]
    pub path: String,
    /// How many clients; several numbers are tried one after the other
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_value = "10")]
    pub clients: Vec<usize>,
    /// How long each run takes; visitors follow one another [default: 30]
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub duration: Option<Duration>,
    /// How often every client follows the path, instead
    #[arg(long, value_name = "K", value_parser = value_parser!(u32).range(1..))]
    pub loops: Option<u32>,
    /// Each client's own link, bandwidth / round trip / loss: 20mbit/40ms
    #[arg(long, value_name = "LINK")]
    pub link: Option<LinkSpec>,
    /// Ways to fetch: ours, potree, fraiss; with several, each run is made with each
    #[arg(long, value_name = "POLICY,…", value_delimiter = ',', default_value = "ours", value_parser = hosted)]
    pub policy: Vec<Policy>,
    /// Folder for load.html, load.json and tables of CSV; made if it is missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Ask for ranges, even of a host that takes one request for many
    #[arg(long)]
    pub no_batches: bool,
    /// Time over which the clients begin
    #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = seconds)]
    pub ramp: Duration,
    /// Clients keep what they have loaded when they begin the path anew; otherwise a new visitor comes
    /// with an empty cache and connections of his own
    #[arg(long)]
    pub keep_cache: bool,
    /// Views a second while a camera moves
    #[arg(long, value_name = "NUMBER", default_value_t = 10.0)]
    pub views_per_second: f64,
    /// Most points of a picture
    #[arg(long, value_name = "POINTS", default_value_t = EngineConfig::default().point_budget)]
    pub budget: u64,
    /// Width and height of the picture that nodes are chosen for
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "1280x720",
          value_parser = crate::commands::shot::size)]
    pub size: [u32; 2],
    /// Attributes to fetch besides positions
    #[arg(long, value_name = "NAME,…", value_delimiter = ',', default_value = "color")]
    pub attributes: Vec<String>,
    /// Most requests of a run; when they are spent, it is over
    #[arg(long, value_name = "N", default_value_t = 10_000_000)]
    pub most_requests: u64,
    /// The server's process, to tell its processor time and memory, where it is not the one that
    /// listens on the address's port on this machine
    #[arg(long, value_name = "PID")]
    pub server_pid: Option<u32>,
    /// Threads that the clients share [default: as many as there are processors]
    #[arg(long, value_name = "N", value_parser = value_parser!(u16).range(1..=256))]
    pub threads: Option<u16>,
}

/// Reads `2.5`.
fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().and_then(|s| Duration::try_from_secs_f64(s).ok());
    seconds.ok_or_else(|| "expected a number of seconds, such as 30".into())
}

/// A policy that can fetch what servers host.
fn hosted(text: &str) -> Result<Policy, String> {
    match text.parse()? {
        Policy::PotreeBrotli => {
            let why = "no such files are hosted here: 'eval' has this policy, on made-up links";
            Err(format!("{why}; take potree"))
        }
        policy => Ok(policy),
    }
}

/// Makes the runs and writes the reports. Fails where there was any error.
///
/// # Errors
/// Where something is out of bounds, a source cannot be opened, or a file cannot be written.
pub fn run(args: LoadArgs) -> anyhow::Result<ExitCode> {
    let processors = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let config = LoadConfig {
        path: PathSource::open(&args.path)?,
        path_name: args.path.clone(),
        clients: args.clients.clone(),
        policies: args.policy.clone(),
        length: match args.loops {
            Some(rounds) => Length::Rounds(rounds),
            None => Length::Time(args.duration.unwrap_or(Duration::from_secs(30))),
        },
        keeps: args.keep_cache,
        ramp: args.ramp,
        link: args.link,
        views_per_second: args.views_per_second,
        size_px: args.size,
        engine: EngineConfig {
            point_budget: args.budget,
            attributes: args.attributes.clone(),
            batches: !args.no_batches,
            ..EngineConfig::default()
        },
        most_requests: args.most_requests,
        server_pid: args.server_pid,
        threads: args.threads.map_or(processors, usize::from),
        command: command_line(),
        sources: args.sources,
    };
    config.check()?;
    check_open_files(&config)?;
    let folder = &args.output;
    std::fs::create_dir_all(folder)
        .with_context(|| format!("{}: cannot create", folder.display()))?;
    let cancel = cancel_on_interrupt()?;
    let live = Live::default();
    let tell = |policy: Policy, clients, standing: &Standing| live.tell(policy, clients, standing);
    let report = load::run(&config, &cancel, &tell)?;
    live.finish();
    let mut files = report.tables();
    files.push(("load.json", report.json()));
    files.push(("load.html", load::page(&report).render()));
    for (name, text) in files {
        let path = folder.join(name);
        std::fs::write(&path, text).with_context(|| format!("{}: cannot write", path.display()))?;
    }
    let page = folder.join("load.html");
    print(&format!("{}{}\n", load::summary(&report), page.display()))?;
    let is_whole = report.runs.iter().all(|run| run.errors == 0 && run.cut_short.is_none());
    let is_complete = report.runs.iter().all(|run| run.visits.failed == 0);
    Ok(if is_whole && is_complete { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Raises the limit of open files as far as it goes; refuses where that is not enough: connections
/// that cannot be opened would be taken for the server's doing.
fn check_open_files(config: &LoadConfig) -> anyhow::Result<()> {
    #[cfg(unix)]
    {
        use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
        let limit = getrlimit(Resource::Nofile);
        let raised = Rlimit { current: limit.maximum, maximum: limit.maximum };
        // Where it stays, it is looked at below.
        let _ = setrlimit(Resource::Nofile, raised);
        let clients = config.clients.iter().copied().max().unwrap_or(0).min(MOST_CLIENTS) as u64;
        let each = (config.engine.requests_in_flight * config.sources.len()).max(1) as u64;
        let needed = clients * each + SPARE_FILES;
        if let Some(limit) = getrlimit(Resource::Nofile).current
            && limit < needed
        {
            anyhow::bail!(
                "{clients} clients need up to {needed} open files, this process may have {limit}: raise \
                 the limit (ulimit -n {needed}) or take fewer clients"
            );
        }
    }
    Ok(())
}

/// How the runs are going, on standard error.
#[derive(Default)]
struct Live {
    state: Mutex<Option<LiveRun>>,
}

/// The run that is shown.
struct LiveRun {
    name: String,
    bar: ProgressBar,
    next_line: Duration,
    last: Standing,
}

impl Live {
    fn tell(&self, policy: Policy, clients: usize, standing: &Standing) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let plural = if clients == 1 { "" } else { "s" };
        let name = format!("{} {clients} client{plural}", policy.name());
        if state.as_ref().is_none_or(|run| run.name != name) {
            if let Some(ended) = state.take() {
                ended.bar.finish_and_clear();
            }
            *state = Some(LiveRun::new(name, standing.length));
        }
        if let Some(run) = state.as_mut() {
            run.tell(standing);
        }
    }

    fn finish(&self) {
        if let Some(run) = self.state.lock().unwrap_or_else(PoisonError::into_inner).take() {
            run.bar.finish_and_clear();
        }
    }
}

impl LiveRun {
    fn new(name: String, length: Option<Duration>) -> Self {
        let template = match length {
            Some(_) => "{prefix}  {bar:24} {msg}",
            None => "{prefix}  {spinner} {msg}",
        };
        let style = ProgressStyle::with_template(template)
            .expect("the templates above are well-formed")
            .progress_chars("━╸ ");
        let target = if std::io::stderr().is_terminal() {
            ProgressDrawTarget::stderr()
        } else {
            ProgressDrawTarget::hidden()
        };
        let length = length.map(|length| u64::try_from(length.as_millis()).unwrap_or(u64::MAX));
        let bar = ProgressBar::with_draw_target(length, target).with_style(style);
        bar.set_prefix(name.clone());
        Self { name, bar, next_line: PLAIN_INTERVAL, last: Standing::default() }
    }

    fn tell(&mut self, standing: &Standing) {
        let passed = (standing.elapsed - self.last.elapsed).as_secs_f64();
        if passed < 0.9 && !self.last.elapsed.is_zero() {
            return;
        }
        let rate = |now: u64, before: u64| ((now - before) as f64 / passed.max(1e-3)) as u64;
        let mut message = format!(
            "{:>4.0} s  {} requests/s  {}/s  {} nodes  {} in flight",
            standing.elapsed.as_secs_f64(),
            HumanCount(rate(standing.requests, self.last.requests)),
            BinaryBytes(rate(standing.bytes, self.last.bytes)),
            HumanCount(standing.nodes),
            standing.in_flight,
        );
        if let Some(ms) = standing.p99_ms {
            message += &format!("  p99 {ms:.0} ms");
        }
        if let Some(server) = standing.server {
            message += &format!("  server {}", BinaryBytes(server.memory_bytes));
        }
        message += &format!("  {} errors", standing.faults);
        self.bar.set_position(u64::try_from(standing.elapsed.as_millis()).unwrap_or(u64::MAX));
        if self.bar.is_hidden() {
            if standing.elapsed >= self.next_line {
                eprintln!("{:<18} {message}", self.name);
                self.next_line = standing.elapsed + PLAIN_INTERVAL;
            }
        } else {
            self.bar.set_message(message);
        }
        self.last = *standing;
    }
}
