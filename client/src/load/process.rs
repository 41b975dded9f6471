//! What processes take of the machine, where the system tells: on Linux, by `/proc`.

use std::time::Duration;

use serde::{Deserialize, Serialize};

/// What processes have taken.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Usage {
    /// Processor time since they were started.
    pub cpu: Duration,
    /// Memory that they hold now.
    pub memory_bytes: u64,
    /// Of that, what is no file's: files that are mapped give theirs back when it is needed.
    pub own_bytes: u64,
}

/// What processes took during a run.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ProcessReport {
    /// Their numbers.
    pub pids: Vec<u32>,
    /// Processors that they kept busy on average.
    pub cores: f64,
    /// Seconds of processor time.
    pub cpu_seconds: f64,
    /// Memory at the beginning.
    pub memory_before_bytes: u64,
    /// The most memory at any look.
    pub memory_peak_bytes: u64,
    /// The most at any look that was no mapped file's.
    pub own_peak_bytes: u64,
}

/// Processes that are looked at from time to time.
#[derive(Debug)]
pub struct Watched {
    pids: Vec<u32>,
    first: Usage,
    last: Usage,
    peak: Usage,
}

impl Watched {
    /// Begins to look at processes; `None` where the system does not tell of them.
    #[must_use]
    pub fn new(pids: Vec<u32>) -> Option<Self> {
        let first = usage(&pids)?;
        Some(Self { pids, first, last: first, peak: first })
    }

    /// Looks at them; what has ended keeps what it had taken.
    pub fn look(&mut self) -> Usage {
        if let Some(usage) = usage(&self.pids) {
            self.last = Usage { cpu: usage.cpu.max(self.last.cpu), ..usage };
            self.peak.memory_bytes = self.peak.memory_bytes.max(usage.memory_bytes);
            self.peak.own_bytes = self.peak.own_bytes.max(usage.own_bytes);
        }
        Usage { cpu: self.last.cpu.saturating_sub(self.first.cpu), ..self.last }
    }

    /// What they took in `seconds`.
    #[must_use]
    pub fn report(&self, seconds: f64) -> ProcessReport {
        let cpu_seconds = self.last.cpu.saturating_sub(self.first.cpu).as_secs_f64();
        ProcessReport {
            pids: self.pids.clone(),
            cores: cpu_seconds / seconds.max(1e-3),
            cpu_seconds,
            memory_before_bytes: self.first.memory_bytes,
            memory_peak_bytes: self.peak.memory_bytes,
            own_peak_bytes: self.peak.own_bytes,
        }
    }
}

/// The processes of this machine that listen on a TCP port. None where the system does not tell, or does
/// not tell this user.
#[cfg(target_os = "linux")]
#[must_use]
pub fn listening(port: u16) -> Vec<u32> {
    use procfs::{
        net::{TcpState, tcp, tcp6},
        process::{FDTarget, all_processes},
    };
    let sockets = [tcp(), tcp6()].into_iter().flatten().flatten();
    let listens = sockets.filter(|s| s.state == TcpState::Listen && s.local_address.port() == port);
    let inodes: Vec<u64> = listens.map(|socket| socket.inode).collect();
    let Ok(processes) = all_processes() else { return Vec::new() };
    let holds = |process: &procfs::process::Process| {
        let is_one = |fd: procfs::process::FDInfo| matches!(fd.target, FDTarget::Socket(inode) if inodes.contains(&inode));
        process.fd().is_ok_and(|mut fds| fds.any(|fd| fd.is_ok_and(is_one)))
    };
    let found = processes.flatten().filter(holds);
    found.filter_map(|process| u32::try_from(process.pid).ok()).collect()
}

/// As on Linux.
#[cfg(not(target_os = "linux"))]
#[must_use]
pub fn listening(_port: u16) -> Vec<u32> {
    Vec::new()
}

/// The sum over those that are there; `None` where none is.
#[cfg(target_os = "linux")]
fn usage(pids: &[u32]) -> Option<Usage> {
    let of = |pid: &u32| {
        let process = procfs::process::Process::new(i32::try_from(*pid).ok()?).ok()?;
        let (stat, status) = (process.stat().ok()?, process.status().ok()?);
        let ticks = stat.utime + stat.stime;
        Some(Usage {
            cpu: Duration::from_secs_f64(ticks as f64 / procfs::ticks_per_second() as f64),
            memory_bytes: stat.rss * procfs::page_size(),
            own_bytes: status.rssanon.unwrap_or(0) * 1024,
        })
    };
    pids.iter().filter_map(of).reduce(|a, b| Usage {
        cpu: a.cpu + b.cpu,
        memory_bytes: a.memory_bytes + b.memory_bytes,
        own_bytes: a.own_bytes + b.own_bytes,
    })
}

#[cfg(not(target_os = "linux"))]
fn usage(_pids: &[u32]) -> Option<Usage> {
    None
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn a_listening_process_is_found_by_its_port_and_its_memory_told() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
        let port = listener.local_addr().expect("bound").port();
        assert_eq!(listening(port), [std::process::id()]);
        let mut watched = Watched::new(listening(port)).expect("this process");
        assert!(watched.look().memory_bytes > 1 << 20);
        assert!(watched.report(1.0).memory_peak_bytes >= 1 << 20);
        drop(listener);
        assert!(listening(port).is_empty());
        assert!(Watched::new(vec![]).is_none());
    }
}
