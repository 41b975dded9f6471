//! Requests a second, waits and processor time of `lodestream serve`, beside nginx on the same file
//!
//! `./dev bench serve [INPUT] [--runs N]`. nginx runs with `sendfile`, `tcp_nodelay` and a worker for
//! every core, without an access log; `wrk` asks both for ranges at random places of one file of 64 MiB,
//! by turns, so that a drift of the machine's speed meets both: first from processors of its own, then from the
//! same ones, where the threads that are busy wait for each other (with few connections nginx has often all of
//! them on one worker, so that fewer threads share the processors: its requests are slower then, its slowest
//! faster). The slowest hundredth is decided by whatever else takes a processor for a millisecond (wrk counts a
//! wait as if it had gone on asking meanwhile, so that it is a hundredth of the time, nearly): behind its
//! medians stand quartiles, and in how many turns ours was the slower. wrk asks as fast as it is answered, so that
//! waits are those of queues, and how much of them is seen depends on which side they form; so a load generator of this
//! bench also asks both at the same rate, three fifths of what the slower one gives. Then many nodes of 16 KiB by batches,
//! beside nginx's by ranges, both asked by that generator: wrk takes answers in pieces of 8
//! KiB, which costs it more for a node than the server, and would be what is measured. At last, what
//! batches are worth to the client's engine, on INPUT (a dataset or anything that `lodestream build` takes;
//! without one, a simulated courtyard of 2 million points).

use std::{
    cell::RefCell,
    error::Error,
    ffi::OsStr,
    fs,
    io::{self, BufRead, BufReader},
    net::SocketAddr,
    path::Path,
    process::{Child, Command, Stdio},
    sync::Arc,
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
use tokio::net::TcpStream;

#[path = "../nginx.rs"]
mod nginx;

use nginx::Nginx;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

const DEFAULT_INPUT: &str = "sim:courtyard?points=2M&seed=1";
const FILE_BYTES: u64 = 64 << 20;
const SIZES: [u64; 5] = [4 << 10, 16 << 10, 64 << 10, 256 << 10, 1 << 20];
const CONNECTIONS: [u32; 2] = [16, 256];
const NODE_BYTES: u32 = 16 << 10;
/// As many bytes as the client asks for at once.
const NODES: usize = 16;
/// Of every measurement.
const SECONDS: u32 = 1;
/// Where both are asked for as much: over how many connections, and for what part of what the slower one gives.
const RATE_CONNECTIONS: u32 = 256;
const RATE_SHARE: f64 = 0.6;
/// How the bench starts itself as a load generator: this, an address, bytes of a range, requests a second.
const AT_A_RATE: &str = "--at-a-rate";
/// Different requests that a thread of wrk repeats.
const REQUESTS: usize = 2000;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().collect();
    if let [_, flag, addr, size, rate] = &arguments[..]
        && flag == AT_A_RATE
    {
        return ask_at_a_rate(addr.parse()?, size.parse()?, rate.parse()?);
    }
    let Options { input, runs } = Options::parse(DEFAULT_INPUT)?;
    let folder = tempfile::tempdir()?;
    write_file(&folder.path().join("bench.lods"))?;
    let processors = std::thread::available_parallelism()?.get();
    println!(
        "{}, {processors} cores, {} on TCP, medians of {runs} runs of {SECONDS} s by turns (quartiles behind them); ratios are \
         ours to nginx's; slower: turns in which ours was",
        Nginx::version()?,
        congestion_control(),
    );
    if let Some((servers, generators)) = halves(processors) {
        println!("\nServers on one half of the cores, wrk on the other:\n");
        let ours = Server::start(folder.path(), Some(&servers.0))?;
        let rival = Nginx::start_on(folder.path(), Some((&servers.0, servers.1)))?;
        let rates = ranges(&ours, &rival, Some(&generators), runs)?;
        println!("\nBoth asked for as much, over {RATE_CONNECTIONS} connections:\n");
        at_a_rate(&ours, &rival, &generators, runs, &rates)?;
    }
    println!("\nServers and wrk on all cores, in each other's way:\n");
    let ours = Server::start(folder.path(), None)?;
    let rival = Nginx::start(folder.path())?;
    ranges(&ours, &rival, None, runs)?;
    let (our_pids, their_pids) = (vec![ours.child.id()], rival.pids());

    println!("\nNodes of 16 KiB, by batches of {NODES} beside nginx's by ranges:\n");
    println!("| connections | nodes/s | nginx | ratio | server's µs/node | nginx |");
    println!("| --- | --- | --- | --- | --- | --- |");
    let (ours_at, theirs_at) = (ours.url.trim_start_matches("http://").parse()?, rival.addr);
    let (batches, ranges) = (batch_requests()?, range_requests(NODE_BYTES.into()));
    for connections in CONNECTIONS {
        let (us, them) = by_turns(
            runs,
            || ask(ours_at, &batches, connections, &our_pids),
            || ask(theirs_at, &ranges, connections, &their_pids),
        )?;
        let (us, them) = (middle(&us), middle(&them));
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

/// How the system controls congestion: what answers of several packets wait for hangs on it.
fn congestion_control() -> String {
    fs::read_to_string("/proc/sys/net/ipv4/tcp_congestion_control")
        .map_or_else(|_| "unknown congestion control".to_owned(), |name| name.trim().to_owned())
}

/// Processors as `taskset` takes them, and how many.
type Processors = (String, usize);

/// Half of the processors for servers, the others for those who ask; `None` where there is one.
fn halves(processors: usize) -> Option<(Processors, Processors)> {
    let half = processors / 2;
    (half > 0).then(|| {
        let list = |from: usize, to: usize| (format!("{from}-{}", to - 1), to - from);
        (list(0, half), list(half, processors))
    })
}

/// Ranges of each size over few and many connections: the table. Returns the requests a second that the slower of both
/// answers over many, by size.
fn ranges(
    ours: &Server,
    rival: &Nginx,
    generators: Option<&Processors>,
    runs: usize,
) -> Result<Vec<f64>> {
    let mut rates = Vec::new();
    println!(
        "| KiB | connections | requests/s | nginx | ratio | slower | p90 ms | nginx | p99 ms | nginx | ratio | slower | server's µs/request | nginx |"
    );
    println!("|{}", " --- |".repeat(14));
    let folder = tempfile::tempdir()?;
    let (our_url, their_url) =
        (format!("{}/bench.lods", ours.url), format!("http://{}/bench.lods", rival.addr));
    let (our_pids, their_pids) = (vec![ours.child.id()], rival.pids());
    for connections in CONNECTIONS {
        for size in SIZES {
            let script = folder.path().join("ranges.lua");
            fs::write(&script, range_script(size))?;
            let (us, them) = by_turns(
                runs,
                || load(&our_url, &script, connections, generators, &our_pids),
                || load(&their_url, &script, connections, generators, &their_pids),
            )?;
            let slower = |is_slower: fn(&Load, &Load) -> bool| {
                us.iter().zip(&them).filter(|(us, them)| is_slower(us, them)).count()
            };
            let (slower_rate, slower_p99) = (
                slower(|us, them| us.rate < them.rate),
                slower(|us, them| us.p99_ms > them.p99_ms),
            );
            let p99 = |loads: &[Load]| {
                let [low, middle, high] = quartiles(loads, |load| load.p99_ms);
                format!("{middle:.2} ({low:.2}-{high:.2})")
            };
            let (ours, theirs) = (middle(&us), middle(&them));
            if connections == RATE_CONNECTIONS {
                rates.push(ours.rate.min(theirs.rate));
            }
            println!(
                "| {} | {connections} | {:.0} | {:.0} | {:.2} | {slower_rate} | {:.2} | {:.2} | {} | {} | {:.2} | \
                 {slower_p99} | {:.1} | {:.1} |",
                size >> 10,
                ours.rate,
                theirs.rate,
                ours.rate / theirs.rate,
                ours.p90_ms,
                theirs.p90_ms,
                p99(&us),
                p99(&them),
                ours.p99_ms / theirs.p99_ms,
                ours.cpu_us,
                theirs.cpu_us
            );
        }
    }
    Ok(rates)
}

/// Waits where both are asked for as much: the table.
fn at_a_rate(
    ours: &Server,
    rival: &Nginx,
    generators: &Processors,
    runs: usize,
    rates: &[f64],
) -> Result<()> {
    println!(
        "| KiB | requests/s | p50 ms | nginx | p99 ms | nginx | ratio | slower | p99.9 ms | nginx |"
    );
    println!("|{}", " --- |".repeat(10));
    let ours = ours.url.trim_start_matches("http://").to_owned();
    let theirs = rival.addr.to_string();
    let ask = |addr: &str, size: u64, rate: f64| -> Result<[f64; 3]> {
        let output = on(Some(&generators.0), std::env::current_exe()?)
            .args([AT_A_RATE, addr, &size.to_string(), &rate.to_string()])
            .output()?;
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let values: Vec<f64> = text.split_whitespace().filter_map(|v| v.parse().ok()).collect();
        let why = || format!("{addr}: {text}{}", String::from_utf8_lossy(&output.stderr));
        values.try_into().map_err(|_| why().into())
    };
    for (size, rate) in SIZES.into_iter().zip(rates) {
        let rate = (rate * RATE_SHARE).round();
        let (us, them) = by_turns(runs, || ask(&ours, size, rate), || ask(&theirs, size, rate))?;
        let slower = us.iter().zip(&them).filter(|(us, them)| us[1] > them[1]).count();
        let of = |waits: &[[f64; 3]], which: usize| {
            median(&mut waits.iter().map(|wait| wait[which]).collect::<Vec<_>>())
        };
        println!(
            "| {} | {rate:.0} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {slower} | {:.2} | {:.2} |",
            size >> 10,
            of(&us, 0),
            of(&them, 0),
            of(&us, 1),
            of(&them, 1),
            of(&us, 1) / of(&them, 1),
            of(&us, 2),
            of(&them, 2),
        );
    }
    Ok(())
}

/// Asks for ranges of that many bytes at that rate, and prints within how many milliseconds a half, 99 and 99.9 % of the
/// answers came. Every request is due at a time of its own; one that has to wait for the answer before it waits since
/// then.
fn ask_at_a_rate(addr: SocketAddr, size: u64, rate: f64) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let interval = Duration::from_secs_f64(f64::from(RATE_CONNECTIONS) / rate);
    let requests: Arc<Vec<Vec<u8>>> = Arc::new(range_requests(size));
    let mut waits = runtime.block_on(async {
        // Time for all to connect.
        let begin = Instant::now() + Duration::from_millis(200);
        let until = begin + Duration::from_secs(SECONDS.into());
        let mut asking = tokio::task::JoinSet::new();
        for index in 0..RATE_CONNECTIONS {
            let requests = Arc::clone(&requests);
            asking.spawn(async move {
                let stream = TcpStream::connect(addr).await?;
                stream.set_nodelay(true)?;
                let mut due =
                    begin + interval.mul_f64(f64::from(index) / f64::from(RATE_CONNECTIONS));
                let mut waits = Vec::new();
                for request in requests.iter().cycle().skip(index as usize * 7) {
                    if due > until {
                        break;
                    }
                    // How late the clock wakes us is not the server's doing.
                    let start = if Instant::now() < due {
                        tokio::time::sleep_until(due.into()).await;
                        Instant::now()
                    } else {
                        due
                    };
                    exchange(&stream, request).await?;
                    waits.push(start.elapsed());
                    due += interval;
                }
                Ok::<_, io::Error>(waits)
            });
        }
        let mut waits = Vec::new();
        while let Some(ended) = asking.join_next().await {
            waits.extend(ended??);
        }
        Ok::<_, Box<dyn Error>>(waits)
    })?;
    waits.sort_unstable();
    let [half, p99, p999] = [500, 990, 999].map(|share| within(&waits, share));
    println!("{} {} {}", half?, p99?, p999?);
    Ok(())
}

/// Of waits in order, the milliseconds within which so many thousandths came.
fn within(waits: &[Duration], thousandths: usize) -> Result<f64> {
    let wait = waits.get(waits.len() * thousandths / 1000).ok_or("nothing was answered")?;
    Ok(wait.as_secs_f64() * 1e3)
}

/// A program, on these processors alone if so.
fn on(processors: Option<&str>, program: impl AsRef<OsStr>) -> Command {
    match processors {
        Some(list) => {
            let mut command = Command::new("taskset");
            command.args(["-c", list]).arg(program);
            command
        }
        None => Command::new(program),
    }
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
    fn start(folder: &Path, processors: Option<&str>) -> Result<Self> {
        let mut command = on(processors, program("lodestream-server")?);
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
    p90_ms: f64,
    p99_ms: f64,
    /// The server's processor time for each request.
    cpu_us: f64,
}

fn by_turns<T>(
    runs: usize,
    ours: impl Fn() -> Result<T>,
    theirs: impl Fn() -> Result<T>,
) -> Result<(Vec<T>, Vec<T>)> {
    // Once in vain: files are opened, buffers grow, the dataset earns its copy.
    ours()?;
    let (mut us, mut them) = (Vec::new(), Vec::new());
    for turn in 0..runs {
        // Neither is always the first.
        if turn % 2 == 0 {
            us.push(ours()?);
            them.push(theirs()?);
        } else {
            them.push(theirs()?);
            us.push(ours()?);
        }
    }
    Ok((us, them))
}

/// Each figure's median.
fn middle(loads: &[Load]) -> Load {
    let of = |value: fn(&Load) -> f64| median(&mut loads.iter().map(value).collect::<Vec<_>>());
    Load {
        rate: of(|l| l.rate),
        p90_ms: of(|l| l.p90_ms),
        p99_ms: of(|l| l.p99_ms),
        cpu_us: of(|l| l.cpu_us),
    }
}

/// The medians of the lower half, of all, and of the upper half.
fn quartiles(loads: &[Load], value: fn(&Load) -> f64) -> [f64; 3] {
    let mut values: Vec<f64> = loads.iter().map(value).collect();
    values.sort_unstable_by(f64::total_cmp);
    let half = values.len().div_ceil(2);
    let (low, high) = (values[..half].to_vec(), values[values.len() - half..].to_vec());
    [low, values, high].map(|mut values| median(&mut values))
}

fn load(
    url: &str,
    script: &Path,
    connections: u32,
    processors: Option<&Processors>,
    pids: &[u32],
) -> Result<Load> {
    let before = ticks(pids);
    let (list, threads) = processors.map_or((None, 2), |(list, count)| (Some(&**list), *count));
    let output = on(list, "wrk")
        .args([
            &format!("-t{threads}"),
            &format!("-c{connections}"),
            &format!("-d{SECONDS}s"),
            "--latency",
            "-s",
        ])
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
        p90_ms: milliseconds(after("90%")?)?,
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
    // Anywhere: payloads do not begin with pages.
    let last = FILE_BYTES - size;
    format!(
        "local requests, next = {{}}, 0\n\
         function init(args)\n\
           math.randomseed(1)\n\
           for i = 1, {REQUESTS} do\n\
             local first = math.random(0, {last})\n\
             local range = string.format('bytes=%d-%d', first, first + {size} - 1)\n\
             requests[i] = wrk.format('GET', nil, {{ ['Range'] = range }})\n\
           end\n\
         end\n\
         function request() next = next % {REQUESTS} + 1; return requests[next] end\n"
    )
}

/// Places in the file for so many bytes, always the same ones.
fn places(bytes: u64) -> impl Iterator<Item = u64> {
    let next = |state: &u64| Some(state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1));
    let states = std::iter::successors(Some(1u64), next).skip(1);
    states.map(move |state| (state >> 33) % (FILE_BYTES - bytes))
}

fn range_requests(bytes: u64) -> Vec<Vec<u8>> {
    let request = |first: u64| {
        let last = first + bytes - 1;
        format!("GET /bench.lods HTTP/1.1\r\nhost: x\r\nrange: bytes={first}-{last}\r\n\r\n")
    };
    places(bytes).take(REQUESTS).map(|first| request(first).into_bytes()).collect()
}

fn batch_requests() -> Result<Vec<Vec<u8>>> {
    let mut places = places(NODE_BYTES.into());
    let mut requests = Vec::new();
    for _ in 0..REQUESTS / NODES {
        let part = |offset| BatchPart { offset, bytes: NODE_BYTES };
        let parts = places.by_ref().take(NODES).map(part).collect();
        let body = BatchRequest { content_id: header().content_id, parts }.encode()?;
        let head = format!(
            "POST /bench.lods/batch HTTP/1.1\r\nhost: x\r\ncontent-type: {BATCH_REQUEST_TYPE}\r\n\
             content-length: {}\r\n\r\n",
            body.len()
        );
        requests.push([head.as_bytes(), &body].concat());
    }
    Ok(requests)
}

/// Asks over so many connections for `SECONDS`, always the next thing when an answer has come.
fn ask(addr: SocketAddr, requests: &[Vec<u8>], connections: u32, pids: &[u32]) -> Result<Load> {
    let runtime =
        tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
    let before = ticks(pids);
    let begin = Instant::now();
    let until = begin + Duration::from_secs(SECONDS.into());
    let asking = (0..connections as usize).map(|first| {
        let requests = requests.to_vec();
        runtime.spawn(async move {
            let stream = TcpStream::connect(addr).await?;
            stream.set_nodelay(true)?;
            let mut waits = Vec::new();
            for request in requests.iter().cycle().skip(first * 7) {
                let start = Instant::now();
                if start > until {
                    break;
                }
                exchange(&stream, request).await?;
                waits.push(start.elapsed());
            }
            Ok::<_, io::Error>(waits)
        })
    });
    let asking: Vec<_> = asking.collect();
    let mut waits = Vec::new();
    for connection in asking {
        waits.extend(runtime.block_on(connection)??);
    }
    let seconds = begin.elapsed().as_secs_f64();
    let ticks = ticks(pids) - before;
    waits.sort_unstable();
    Ok(Load {
        rate: waits.len() as f64 / seconds,
        cpu_us: ticks as f64 * 10_000.0 / waits.len() as f64,
        p90_ms: within(&waits, 900)?,
        p99_ms: within(&waits, 990)?,
    })
}

/// Sends a request and takes the answer, looking at nothing but its length.
async fn exchange(stream: &TcpStream, request: &[u8]) -> io::Result<()> {
    thread_local! {
        // Nobody looks at what is in there.
        static TAKEN: RefCell<Vec<u8>> = RefCell::new(vec![0; 256 << 10]);
    }
    let mut rest = request;
    while !rest.is_empty() {
        stream.writable().await?;
        match stream.try_write(rest) {
            Ok(sent) => rest = &rest[sent..],
            Err(e) if e.kind() == io::ErrorKind::WouldBlock => {}
            Err(e) => return Err(e),
        }
    }
    let mut left = None;
    while left != Some(0) {
        stream.readable().await?;
        let taken: io::Result<Option<usize>> = TAKEN.with_borrow_mut(|taken| {
            let count = stream.try_read(taken)?;
            if count == 0 {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            // A head comes in one piece, with whatever there is of the body.
            Ok::<_, io::Error>(match left {
                None => answer_bytes(&taken[..count])?.checked_sub(count),
                Some(left) => usize::checked_sub(left, count),
            })
        });
        left = match taken {
            Err(e) if e.kind() == io::ErrorKind::WouldBlock => left,
            Err(e) => return Err(e),
            Ok(None) => return Err(io::Error::other("more came than was announced")),
            Ok(left) => left,
        };
    }
    Ok(())
}

/// Bytes of an answer, head and body, of which this is the beginning.
fn answer_bytes(begin: &[u8]) -> io::Result<usize> {
    let end = begin.windows(4).position(|window| window == b"\r\n\r\n");
    let head = end.and_then(|end| std::str::from_utf8(&begin[..end]).ok());
    let head = head.ok_or_else(|| io::Error::other("no head"))?;
    if !["HTTP/1.1 200", "HTTP/1.1 206"].iter().any(|status| head.starts_with(status)) {
        return Err(io::Error::other(head.to_owned()));
    }
    let length = head.lines().find_map(|line| {
        let (name, value) = line.split_once(':')?;
        name.eq_ignore_ascii_case("content-length").then(|| value.trim().parse::<usize>().ok())?
    });
    let length = length.ok_or_else(|| io::Error::other("no length"))?;
    Ok(head.len() + 4 + length)
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
        let mut camera = overview;
        camera.eye = camera.target + (camera.eye - camera.target) * share;
        engine.set_view(View { camera, size_px: [1280, 720] });
        engine.wait_settled(patience)?;
    }
    let seconds = start.elapsed().as_secs_f64();
    let totals = engine.stats().since_start.totals;
    Ok(Walk { requests: totals.requests, bytes: totals.bytes, seconds })
}
