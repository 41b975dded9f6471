//! A program that runs beside the test, and ends with it.

use std::{
    io::{BufRead, BufReader, Read},
    process::{Child, Command, Stdio},
    thread,
};

use rustix::process::{Pid, Signal, kill_process};

/// Killed when dropped, unless it has ended.
pub struct Process {
    child: Child,
}

impl Process {
    /// Starts the program; returns with the first line of its standard output or error, whichever
    /// `from_errors` says, that `wanted` takes, and what that makes of it.
    pub fn start<T>(
        mut command: Command,
        from_errors: bool,
        wanted: impl Fn(&str) -> Option<T>,
    ) -> (Self, T) {
        if from_errors {
            command.stderr(Stdio::piped()).stdout(Stdio::null());
        } else {
            command.stdout(Stdio::piped());
        }
        let mut child = command.spawn().unwrap_or_else(|e| panic!("{command:?}: {e}"));
        let pipe: Box<dyn Read + Send> = if from_errors {
            Box::new(child.stderr.take().expect("piped"))
        } else {
            Box::new(child.stdout.take().expect("piped"))
        };
        let process = Self { child };
        let mut lines = BufReader::new(pipe).lines().map_while(Result::ok);
        let mut seen = Vec::new();
        let found = lines.by_ref().find_map(|line| {
            let found = wanted(&line);
            seen.push(line);
            found
        });
        let found = found.unwrap_or_else(|| panic!("{command:?} ended: {}", seen.join("\n")));
        // A program whose pipe is full stands still.
        thread::spawn(move || lines.for_each(drop));
        (process, found)
    }

    /// Sends it a signal.
    pub fn signal(&self, signal: Signal) {
        kill_process(Pid::from_child(&self.child), signal).expect("it runs");
    }

    /// Whether it still runs.
    pub fn is_running(&mut self) -> bool {
        self.child.try_wait().is_ok_and(|ended| ended.is_none())
    }

    /// Waits for its end.
    pub fn wait(mut self) {
        self.child.wait().expect("it ends");
    }

    /// Ends it as a power cut would.
    pub fn kill(mut self) {
        self.child.kill().expect("it runs");
        self.child.wait().expect("it ends");
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
