//! Requests a second, waits and processor time of `lodestream serve`, beside nginx on the same file
//!
//! `./dev bench serve [INPUT] [--runs N]`. nginx runs with `sendfile`, `tcp_nodelay` and a worker for
//! every core, without an access log; `wrk` asks both for ranges at random places of one file of 64 MiB,
//! by turns, so that a drift of the machine's speed meets both. Then many nodes of 16 KiB by batches,
//! beside nginx's by ranges; and what batches are worth to the client's engine, on INPUT (a dataset
//! or anything that `lodestream build` takes; without one, a simulated courtyard of 2 million points).

use std::{
    error::Error,
    fmt::Write as _,
    fs,
    io::{BufRead, BufReader},
    path::Path,
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use glam::DVec3;
use lodestream_client::{
    camera::Camera,
    engine::{Engine, EngineConfig, View},
    source::Source,
};
use lodestream_protocol::{BATCH_REQUEST_TYPE, BatchPart, BatchRequest, Header};
use lodestream_tests::{Options, median, program};

#[path = "../nginx.rs"]
mod nginx;

use nginx::Nginx;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

const DEFAULT_INPUT: &str = "sim:courtyard?points=2M&seed=1";
const FILE_BYTES: u64 = 64 << 20;
const SIZES: [u64; 5] = [4 << 10, 16 << 10, 64 << 10, 256 << 10, 1 << 20];
const CONNECTIONS: [u32; 2] = [16, 256];
const NODE_BYTES: u32 = 16 << 10;
const NODES: usize = 64;
/// Of every measurement.
const SECONDS: u32 = 3;
/// Different requests that a thread of wrk repeats.
const REQUESTS: usize = 2000;

fn main() -> Result<()> {
    let Options { input, runs } = Options::parse(DEFAULT_INPUT)?;
    let folder = tempfile::tempdir()?;
    write_file(&folder.path().join("bench.lods"))?;
    let ours = Server::start(folder.path())?;
    let rival = Nginx::start(folder.path())?;
    println!(
        "{}, {} cores, medians of {runs} runs of {SECONDS} s by turns; ratios are ours to nginx's\n",
        Nginx::version()?,
        std::thread::available_parallelism()?
    );

    println!(
        "| KiB | connections | requests/s | nginx | ratio | p99 ms | nginx | ratio | server's µs/request | nginx |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let (our_url, their_url) =
        (format!("{}/bench.lods", ours.url), format!("http://{}/bench.lods", rival.addr));
    let (our_pids, their_pids) = (vec![ours.child.id()], rival.pids());
    for connections in CONNECTIONS {
        for size in SIZES {
            let script = folder.path().join("ranges.lua");
            fs::write(&script, range_script(size))?;
            let (us, them) = by_turns(
                runs,
                || load(&our_url, &script, connections, &our_pids),
                || load(&their_url, &script, connections, &their_pids),
            )?;
            println!(
                "| {} | {connections} | {:.0} | {:.0} | {:.2} | {:.2} | {:.2} | {:.2} | {:.1} | {:.1} |",
                size >> 10,
                us.rate,
                them.rate,
                us.rate / them.rate,
                us.p99_ms,
                them.p99_ms,
                us.p99_ms / them.p99_ms,
                us.cpu_us,
                them.cpu_us
            );
        }
    }

    println!("\nNodes of 16 KiB, by batches of {NODES} beside nginx's by ranges:\n");
    println!("| connections | nodes/s | nginx | ratio | server's µs/node | nginx |");
    println!("| --- | --- | --- | --- | --- | --- |");
    let (batches, ranges) = (folder.path().join("batches.lua"), folder.path().join("nodes.lua"));
    fs::write(&batches, batch_script()?)?;
    fs::write(&ranges, range_script(u64::from(NODE_BYTES)))?;
    let batch_url = format!("{our_url}/batch");
    for connections in CONNECTIONS {
        let (us, them) = by_turns(
            runs,
            || load(&batch_url, &batches, connections, &our_pids),
            || load(&their_url, &ranges, connections, &their_pids),
        )?;
        let nodes = us.rate * NODES as f64;
        println!(
            "| {connections} | {nodes:.0} | {:.0} | {:.2} | {:.1} | {:.1} |",
            them.rate,
            nodes / them.rate,
            us.cpu_us / NODES as f64,
            them.cpu_us
        );
    }

    println!("\nThe client's engine on the overview and three places near the ground:\n");
    println!("| | requests | bytes | until all is there, s |");
    println!("| --- | --- | --- | --- |");
    let dataset = folder.path().join("scene.lods");
    if Path::new(&input).extension().is_some_and(|e| e == "lods") {
        fs::copy(&input, &dataset)?;
    } else {
        let mut build = Command::new(program("lodestream")?);
        let status = build.arg("build").arg(&input).arg("-o").arg(&dataset).status()?;
        status.success().then_some(()).ok_or("the build failed")?;
    }
    let scene_url = format!("{}/scene.lods", ours.url);
    for (name, batches) in [("batches", true), ("coalesced ranges", false)] {
        let mut walks = (0..runs).map(|_| walk(&scene_url, batches)).collect::<Result<Vec<_>>>()?;
        let mut of = |value: fn(&Walk) -> f64| {
            median(&mut walks.iter_mut().map(|walk| value(walk)).collect::<Vec<_>>())
        };
        println!(
            "| {name} | {} | {} | {:.3} |",
            of(|walk| walk.requests as f64),
            of(|walk| walk.bytes as f64),
            of(|walk| walk.seconds)
        );
    }
    Ok(())
}

/// Random bytes behind a sound header: all that a host looks at.
fn write_file(path: &Path) -> Result<()> {
    let header = header();
    let mut bytes = header.encode().to_vec();
    let mut state = 1u64;
    while (bytes.len() as u64) < FILE_BYTES {
        // Xorshift (Marsaglia 2003).
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        bytes.extend_from_slice(&state.to_le_bytes());
    }
    Ok(fs::write(path, bytes)?)
}

fn header() -> Header {
    Header {
        version: (1, 0),
        manifest_bytes: 0,
        root_page_bytes: 0,
        boot_bytes: 64,
        file_bytes: FILE_BYTES,
        content_id: [7; 16],
        index_crc: 0,
    }
}

/// Our server, ended when dropped.
struct Server {
    child: Child,
    url: String,
}

impl Server {
    fn start(folder: &Path) -> Result<Self> {
        let mut command = Command::new(program("lodestream-server")?);
        command.arg("serve").arg(folder).args(["--listen", "127.0.0.1:0"]);
        let mut child = command.stdout(Stdio::piped()).spawn()?;
        let mut url = String::new();
        let stdout = child.stdout.take().ok_or("no standard output")?;
        BufReader::new(stdout).read_line(&mut url)?;
        Ok(Self { child, url: url.trim().to_owned() })
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// What came of one run of wrk.
#[derive(Debug, Clone, Copy)]
struct Load {
    rate: f64,
    p99_ms: f64,
    /// The server's processor time for each request.
    cpu_us: f64,
}

fn by_turns(
    runs: usize,
    ours: impl Fn() -> Result<Load>,
    theirs: impl Fn() -> Result<Load>,
) -> Result<(Load, Load)> {
    // Once in vain: files are opened, buffers grow, the dataset earns its copy.
    ours()?;
    let (mut us, mut them) = (Vec::new(), Vec::new());
    for _ in 0..runs {
        us.push(ours()?);
        them.push(theirs()?);
    }
    let middle = |loads: &[Load]| {
        let of = |value: fn(&Load) -> f64| median(&mut loads.iter().map(value).collect::<Vec<_>>());
        Load { rate: of(|l| l.rate), p99_ms: of(|l| l.p99_ms), cpu_us: of(|l| l.cpu_us) }
    };
    Ok((middle(&us), middle(&them)))
}

fn load(url: &str, script: &Path, connections: u32, pids: &[u32]) -> Result<Load> {
    let before = ticks(pids);
    let output = Command::new("wrk")
        .args(["-t2", &format!("-c{connections}"), &format!("-d{SECONDS}s"), "--latency", "-s"])
        .arg(script)
        .arg(url)
        .output()
        .map_err(|e| format!("wrk cannot be started (apt-get install wrk): {e}"))?;
    let ticks = ticks(pids) - before;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    // A figure about refusals or broken connections would be none.
    if text.contains("Non-2xx") || text.contains("Socket errors") || !output.status.success() {
        return Err(format!("{url}: {text}").into());
    }
    let after = |label: &str| {
        let rest = text.lines().find_map(|line| line.trim().strip_prefix(label));
        rest.map(str::trim).ok_or(format!("wrk tells no {label}: {text}"))
    };
    let requests = text.lines().find_map(|line| line.split_once(" requests in"));
    let requests: f64 = requests.ok_or("wrk tells no number of requests")?.0.trim().parse()?;
    Ok(Load {
        rate: after("Requests/sec:")?.parse()?,
        p99_ms: milliseconds(after("99%")?)?,
        // A tick is a hundredth of a second on every Linux.
        cpu_us: ticks as f64 * 10_000.0 / requests,
    })
}

/// wrk writes `850.00us`, `3.27ms` or `1.02s`.
fn milliseconds(text: &str) -> Result<f64> {
    let split = text.find(|c: char| c.is_ascii_alphabetic()).ok_or("a time without a unit")?;
    let (number, unit) = text.split_at(split);
    let number: f64 = number.parse()?;
    match unit {
        "us" => Ok(number / 1e3),
        "ms" => Ok(number),
        "s" => Ok(number * 1e3),
        _ => Err(format!("{text} is no time").into()),
    }
}

/// Processor time of these processes.
fn ticks(pids: &[u32]) -> u64 {
    let of = |pid: &u32| -> Option<u64> {
        let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
        let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
        let (user, system): (u64, u64) =
            (fields.next()?.parse().ok()?, fields.next()?.parse().ok()?);
        Some(user + system)
    };
    pids.iter().filter_map(of).sum()
}

fn range_script(size: u64) -> String {
    let last_page = (FILE_BYTES - size) / 4096;
    format!(
        "local requests, next = {{}}, 0\n\
         function init(args)\n\
           math.randomseed(1)\n\
           for i = 1, {REQUESTS} do\n\
             local first = math.random(0, {last_page}) * 4096\n\
             local range = string.format('bytes=%d-%d', first, first + {size} - 1)\n\
             requests[i] = wrk.format('GET', nil, {{ ['Range'] = range }})\n\
           end\n\
         end\n\
         function request() next = next % {REQUESTS} + 1; return requests[next] end\n"
    )
}

fn batch_script() -> Result<String> {
    let mut script = String::from("local requests, next, bodies = {}, 0, {\n");
    let mut state = 1u64;
    for _ in 0..REQUESTS / NODES {
        let mut place = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 33) % ((FILE_BYTES - u64::from(NODE_BYTES)) / 4096) * 4096
        };
        let parts = (0..NODES).map(|_| BatchPart { offset: place(), bytes: NODE_BYTES }).collect();
        let request = BatchRequest { content_id: header().content_id, parts };
        script.push('"');
        for byte in request.encode()? {
            let _ = write!(script, "\\{byte:03}");
        }
        script.push_str("\",\n");
    }
    let _ = write!(
        script,
        "}}\n\
         function init(args)\n\
           for i, body in ipairs(bodies) do\n\
             local fields = {{ ['Content-Type'] = '{BATCH_REQUEST_TYPE}' }}\n\
             requests[i] = wrk.format('POST', nil, fields, body)\n\
           end\n\
         end\n\
         function request() next = next % #requests + 1; return requests[next] end\n"
    );
    Ok(script)
}

/// What the engine took to have all that four views want.
struct Walk {
    requests: u64,
    bytes: u64,
    seconds: f64,
}

fn walk(url: &str, batches: bool) -> Result<Walk> {
    let patience = Duration::from_secs(120);
    let config = EngineConfig { batches, ..EngineConfig::default() };
    let start = Instant::now();
    let engine = Engine::start(vec![Source::parse(url)?], config)?;
    let boots = engine.wait_open(patience)?;
    let bounds = boots[0].manifest.bounds_world().ok_or("there are no points")?;
    let (min, max) = (DVec3::from(bounds.0), DVec3::from(bounds.1));
    let overview = Camera::overview(min, max, 1.5);
    for share in [1.0, 0.2, 0.1, 0.05] {
        let mut camera = overview.clone();
        camera.eye = camera.target + (camera.eye - camera.target) * share;
        engine.set_view(View { camera, size_px: [1280, 720] });
        engine.wait_settled(patience)?;
    }
    let seconds = start.elapsed().as_secs_f64();
    let totals = engine.stats().since_start.totals;
    Ok(Walk { requests: totals.requests, bytes: totals.bytes, seconds })
}
