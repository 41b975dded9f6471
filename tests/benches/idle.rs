//! What a window at rest costs: processor time and frames over a minute, by input and by seconds.
//!
//! Usage: `./dev bench idle [DATASET.lods|INPUT] [SECONDS]`. The window is a real one on a screen of its own
//! (Xvfb), its picture complete. Frames that are drawn would be told by events: there must be none.

#[path = "support/overview.rs"]
#[allow(dead_code, reason = "a dataset is all that is needed")]
mod overview;
#[path = "../../client/tests/common/screen.rs"]
mod screen;

use std::{error::Error, ffi::OsString, time::Duration};

use lodestream_tests::program;
use screen::{Screen, Window};

/// Ticks of a second in /proc: the same on all of Linux.
const TICKS: f64 = 100.0;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments =
        std::env::args_os().skip(1).filter(|a| !a.to_string_lossy().starts_with("--"));
    let input =
        arguments.next().unwrap_or_else(|| OsString::from("sim:courtyard?points=2M&seed=1"));
    let seconds = arguments.next().and_then(|s| s.to_str()?.parse().ok()).unwrap_or(60u64);
    let dataset = overview::dataset(&input, "idle.lods")?;
    let program = program("lodestream")?.display().to_string();
    let screen = Screen::new(1280, 800);
    let source = dataset.display().to_string();
    let arguments = [source.as_str(), "--settings", "-", "--size", "1280x800"];
    let mut window = Window::open(&screen, &program, &arguments);
    let settled = window.wait("settled", |event| event["points"].as_u64() > Some(0));
    println!("{} points in a window of {}", settled["points"], settled["size"]);
    // What a start leaves to do (a tooltip's timer, a cursor) is done by then.
    std::thread::sleep(Duration::from_secs(3));
    let before = ticks(window.pid())?;
    std::thread::sleep(Duration::from_secs(seconds));
    let used = (ticks(window.pid())? - before) as f64 / TICKS;
    let share = 100.0 * used / seconds as f64;
    println!("{used:.2} s of processor time in {seconds} s at rest: {share:.2} % of one core");
    window.keys(&["1"]);
    window.settled();
    println!("and still alive");
    window.close();
    Ok(())
}

/// Processor time of a process so far, user and system.
fn ticks(pid: u32) -> Result<u64, Box<dyn Error>> {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat"))?;
    let (_, fields) = stat.rsplit_once(')').ok_or("no stat of the process")?;
    let fields: Vec<&str> = fields.split_whitespace().collect();
    let field = |index: usize| fields.get(index).and_then(|f| f.parse::<u64>().ok());
    field(11).zip(field(12)).map(|(user, system)| user + system).ok_or_else(|| "no times".into())
}
