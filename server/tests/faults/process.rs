//! The server's process: killed, started again, asked to stop.

use std::{
    io::{BufRead, BufReader},
    net::SocketAddr,
    path::Path,
    process::{Child, Command, Stdio},
    sync::{Arc, atomic::Ordering},
};

use crate::{clients::Crowd, file::dataset};

/// The real program, killed when dropped.
pub struct Program {
    child: Child,
    addr: SocketAddr,
}

impl Program {
    pub fn start(folder: &Path, listen: &str) -> Self {
        Self::with(folder, listen, &[])
    }

    /// With further arguments.
    pub fn with(folder: &Path, listen: &str, arguments: &[&str]) -> Self {
        // The port of the one before may be taken for a moment yet.
        loop {
            let mut command = Command::new(env!("CARGO_BIN_EXE_lodestream-server"));
            command.arg("serve").arg(folder).args(["--listen", listen]);
            command.args(arguments);
            let mut child = command.stdout(Stdio::piped()).spawn().expect("the program is there");
            let mut line = String::new();
            let mut stdout = BufReader::new(child.stdout.take().expect("piped"));
            stdout.read_line(&mut line).expect("readable");
            if let Some(addr) = line.trim().strip_prefix("http://") {
                return Self { child, addr: addr.parse().expect("an address") };
            }
            child.wait().expect("it has ended");
        }
    }

    pub fn addr(&self) -> SocketAddr {
        self.addr
    }

    /// Memory that it holds.
    pub fn resident_bytes(&self) -> u64 {
        let statm = std::fs::read_to_string(format!("/proc/{}/statm", self.child.id()));
        let statm = statm.unwrap_or_default();
        let pages = statm.split(' ').nth(1).and_then(|pages| pages.parse::<u64>().ok());
        pages.unwrap_or(0) * 4096
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn clients_go_on_after_the_server_was_killed_and_started_again() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = Arc::new(dataset(1, 2_000_000));
    std::fs::write(folder.path().join("a.lods"), &*file).expect("writable");
    let mut program = Program::start(folder.path(), "127.0.0.1:0");
    let listen = program.addr.to_string();
    let crowd = Crowd::start(program.addr, "/a.lods", 4, move |_| Arc::clone(&file));
    for _ in 0..3 {
        crowd.tally.wait_for_good(50);
        // SIGKILL.
        program.child.kill().expect("it runs");
        program.child.wait().expect("it has ended");
        program = Program::start(folder.path(), &listen);
    }
    crowd.tally.wait_for_good(50);
    let tally = crowd.stop();
    assert_eq!(tally.refused.load(Ordering::Relaxed), 0);
    assert!(tally.failed.load(Ordering::Relaxed) > 0, "nobody noticed");
}

#[test]
fn answers_under_way_are_sent_whole_when_the_server_is_asked_to_stop() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = Arc::new(dataset(1, 2_000_000));
    std::fs::write(folder.path().join("a.lods"), &*file).expect("writable");
    let mut program = Program::start(folder.path(), "127.0.0.1:0");
    let crowd = Crowd::start(program.addr, "/a.lods", 8, move |_| Arc::clone(&file));
    crowd.tally.wait_for_good(100);
    let pid = program.child.id().to_string();
    // SIGTERM.
    assert!(Command::new("kill").arg(&pid).status().expect("kill is there").success());
    assert!(program.child.wait().expect("it ends").success());
    let tally = crowd.stop();
    assert_eq!(tally.broken.load(Ordering::Relaxed), 0, "{tally:?}");
    assert_eq!(tally.refused.load(Ordering::Relaxed), 0, "{tally:?}");
}
