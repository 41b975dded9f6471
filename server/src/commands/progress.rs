//! Progress on standard error: a bar with rate and time left on a terminal, plain lines elsewhere.

use std::{
    fmt::Write,
    io::IsTerminal,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

use indicatif::{
    BinaryBytes, HumanCount, HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState,
    ProgressStyle,
};
use lodestream_preprocess::Progress;

/// Without a terminal, a long phase says this often how far it is.
const PLAIN_INTERVAL: Duration = Duration::from_secs(10);

/// Shows the phases of one piece of work; every phase leaves one line behind.
#[derive(Debug)]
pub struct TerminalProgress {
    is_terminal: bool,
    start: Instant,
    /// Of the current phase.
    done: AtomicU64,
    /// Milliseconds after `start` from which on the next plain line is due.
    next_line_ms: AtomicU64,
    phase: Mutex<Option<Phase>>,
}

#[derive(Debug)]
struct Phase {
    name: String,
    total: u64,
    unit: String,
    start: Instant,
    bar: ProgressBar,
}

impl Default for TerminalProgress {
    fn default() -> Self {
        Self {
            is_terminal: std::io::stderr().is_terminal(),
            start: Instant::now(),
            done: AtomicU64::new(0),
            next_line_ms: AtomicU64::new(0),
            phase: Mutex::new(None),
        }
    }
}

impl TerminalProgress {
    /// Ends the last phase and leaves its line. (Work that failed just drops the progress.)
    pub fn finish(&self) {
        self.replace(None);
    }

    fn replace(&self, next: Option<Phase>) {
        let mut phase = self.phase.lock().unwrap_or_else(PoisonError::into_inner);
        let done = self.done.swap(0, Ordering::Relaxed);
        let due = millis(self.start.elapsed() + PLAIN_INTERVAL);
        self.next_line_ms.store(due, Ordering::Relaxed);
        if let Some(ended) = std::mem::replace(&mut *phase, next) {
            ended.bar.finish_and_clear();
            eprintln!("{}", ended.summary(done));
        }
    }

    fn plain_line(&self) {
        let now = millis(self.start.elapsed());
        let due = self.next_line_ms.load(Ordering::Relaxed);
        let next = now + millis(PLAIN_INTERVAL);
        let order = Ordering::Relaxed;
        // Of all threads that come by, one writes the line.
        if now < due || self.next_line_ms.compare_exchange(due, next, order, order).is_err() {
            return;
        }
        if let Some(phase) = &*self.phase.lock().unwrap_or_else(PoisonError::into_inner) {
            eprintln!("{}", phase.so_far(self.done.load(order)));
        }
    }
}

impl Progress for TerminalProgress {
    fn phase(&self, name: &str, total: u64, unit: &str) {
        let bar = if self.is_terminal { bar(name, total, unit) } else { ProgressBar::hidden() };
        let (name, unit) = (name.to_owned(), unit.to_owned());
        self.replace(Some(Phase { name, total, unit, start: Instant::now(), bar }));
    }

    fn advance(&self, amount: u64) {
        self.done.fetch_add(amount, Ordering::Relaxed);
        if !self.is_terminal {
            return self.plain_line();
        }
        if let Some(phase) = &*self.phase.lock().unwrap_or_else(PoisonError::into_inner) {
            phase.bar.inc(amount);
        }
    }

    fn warn(&self, line: &str) {
        match &*self.phase.lock().unwrap_or_else(PoisonError::into_inner) {
            Some(phase) => phase.bar.suspend(|| eprintln!("warning: {line}")),
            None => eprintln!("warning: {line}"),
        }
    }
}

impl Phase {
    fn summary(&self, done: u64) -> String {
        let seconds = self.start.elapsed().as_secs_f64();
        let mut line = format!("{:<9} {seconds:>8.2} s", self.name);
        if done > 0 {
            let (done, rate) = (amount(done, &self.unit), rate(done as f64 / seconds, &self.unit));
            let _ = write!(line, "  {done}, {rate}");
        }
        line
    }

    fn so_far(&self, done: u64) -> String {
        let seconds = self.start.elapsed().as_secs_f64();
        let per_second = done as f64 / seconds;
        let mut line = format!("{:<9} {seconds:>8.0} s  {}", self.name, amount(done, &self.unit));
        if self.total > 0 {
            let _ = write!(line, " of {}", amount(self.total, &self.unit));
        }
        let _ = write!(line, ", {}", rate(per_second, &self.unit));
        let left = self.total.saturating_sub(done) as f64 / per_second;
        if let Ok(left) = Duration::try_from_secs_f64(left).map(HumanDuration)
            && self.total > 0
        {
            let _ = write!(line, ", {left} left");
        }
        line
    }
}

fn bar(name: &str, total: u64, unit: &str) -> ProgressBar {
    let template = if total > 0 {
        "{prefix:9} {bar:32} {percent:>3} %  {done}  {rate}  {eta} left"
    } else {
        "{prefix:9} {spinner} {done}  {rate}"
    };
    let (done_unit, rate_unit) = (unit.to_owned(), unit.to_owned());
    // A write to indicatif's string does not fail.
    let style = ProgressStyle::with_template(template)
        .expect("the templates above are well-formed")
        .progress_chars("━╸ ")
        .with_key("done", move |state: &ProgressState, out: &mut dyn Write| {
            let _ = out.write_str(&amount(state.pos(), &done_unit));
        })
        .with_key("rate", move |state: &ProgressState, out: &mut dyn Write| {
            let _ = out.write_str(&rate(state.per_sec(), &rate_unit));
        });
    let length = (total > 0).then_some(total);
    ProgressBar::with_draw_target(length, ProgressDrawTarget::stderr())
        .with_style(style)
        .with_prefix(name.to_owned())
}

/// `10,653,336 points`, `51.0 MiB`.
fn amount(count: u64, unit: &str) -> String {
    match unit {
        "bytes" => BinaryBytes(count).to_string(),
        _ => format!("{} {unit}", HumanCount(count)).trim_end().to_owned(),
    }
}

/// `6.6 M points/s`, `51.0 MiB/s`.
fn rate(per_second: f64, unit: &str) -> String {
    if unit == "bytes" {
        // Saturates: a phase of no measurable length has no rate worth telling exactly.
        return format!("{}/s", BinaryBytes(per_second as u64));
    }
    let (scaled, prefix) = match per_second {
        r if r >= 1e9 => (r / 1e9, " G"),
        r if r >= 1e6 => (r / 1e6, " M"),
        r if r >= 1e3 => (r / 1e3, " k"),
        r => (r, " "),
    };
    format!("{scaled:.1}{prefix}{}{unit}/s", if prefix == " " { "" } else { " " })
}

fn millis(duration: Duration) -> u64 {
    u64::try_from(duration.as_millis()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_and_rates_read_well() {
        assert_eq!(amount(10_653_336, "points"), "10,653,336 points");
        assert_eq!(amount(3 << 20, "bytes"), "3.00 MiB");
        assert_eq!(rate(6_600_000.0, "points"), "6.6 M points/s");
        assert_eq!(rate(12.0, "nodes"), "12.0 nodes/s");
        assert_eq!(rate(f64::INFINITY, "points"), "inf G points/s");
    }

    #[test]
    fn a_phase_tells_how_far_it_is_and_what_it_did() {
        let phase = Phase {
            name: "read".into(),
            total: 1000,
            unit: "points".into(),
            start: Instant::now() - Duration::from_secs(10),
            bar: ProgressBar::hidden(),
        };
        let line = phase.so_far(500);
        assert!(
            line.starts_with("read  ") && line.contains("500 points of 1,000 points"),
            "{line}"
        );
        assert!(line.ends_with("10 seconds left"), "{line}");
        assert!(phase.summary(1000).contains("1,000 points, "), "{}", phase.summary(1000));
    }
}
