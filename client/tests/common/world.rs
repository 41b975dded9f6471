//! A dataset of a simulated scan, a server for it, and the real binary.
#![allow(dead_code, reason = "each test needs a part of it")]

use std::{
    net::{Ipv4Addr, SocketAddr},
    path::{Path, PathBuf},
    process::{Command, Output},
};

use lodestream_client::render::Picture;
use lodestream_preprocess::{BuildConfig, Method, Progress, build};
use lodestream_server::{RunningServer, ServeConfig, spawn};

struct Silent;

impl Progress for Silent {
    fn phase(&self, _name: &str, _total: u64, _unit: &str) {}
    fn advance(&self, _amount: u64) {}
    fn warn(&self, _line: &str) {}
}

/// A folder with the dataset in it, and its server.
pub struct World {
    folder: tempfile::TempDir,
    server: Option<RunningServer>,
    address: SocketAddr,
}

impl World {
    pub fn new() -> Self {
        Self::of("sim:courtyard?points=60k&seed=3")
    }

    /// With that scan as its dataset.
    pub fn of(scan: &str) -> Self {
        let folder = tempfile::tempdir().expect("temporary folder");
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        let mut world = Self { folder, server: None, address };
        world.add(scan, "courtyard");
        let server = spawn(ServeConfig::new(world.folder.path(), address)).expect("serving");
        world.address = server.addr();
        world.server = Some(server);
        world
    }

    /// Builds another dataset beside it.
    pub fn add(&mut self, scan: &str, name: &str) {
        let config = BuildConfig {
            inputs: vec![scan.into()],
            output: self.folder.path().join(format!("{name}.lods")),
            method: Method::default(),
            grid: 128,
            memory_bytes: 256 << 20,
            threads: Some(1),
            drop_attributes: Vec::new(),
            columns: None,
            scale: None,
            // In two parts, the first request would bring all of so small a scan.
            cells_per_spacing: 0,
            cancel: Default::default(),
        };
        build(&config, &Silent).expect("built");
    }

    /// Closes the server's port and connections.
    pub fn stop_server(&mut self) {
        self.server = None;
    }

    /// Opens the same port again.
    pub fn restart_server(&mut self) {
        // The connections that were closed a moment ago may still hold the port.
        self.server = Some(loop {
            match spawn(ServeConfig::new(self.folder.path(), self.address)) {
                Ok(server) => break server,
                Err(_) => std::thread::yield_now(),
            }
        });
    }

    /// The server's address.
    pub fn server_url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// The served dataset, as a source is named.
    pub fn source(&self) -> String {
        format!("{}/courtyard", self.server_url())
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn file(&self, name: &str) -> String {
        self.path(name).display().to_string()
    }

    /// `lodestream shot` of `source` into `output` and `NAME.json`.
    pub fn shot_of(&self, source: &str, output: &str, name: &str, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lodestream"));
        command
            .args(["shot", source, "--size", "320x200", "-o", &self.file(output)])
            .args(["--report", &self.file(&format!("{name}.json"))])
            .args(args);
        command
    }

    pub fn picture(&self, name: &str) -> Picture {
        read(&self.path(&format!("{name}.png")))
    }

    pub fn report(&self, name: &str) -> serde_json::Value {
        let text = std::fs::read_to_string(self.path(&format!("{name}.json"))).expect("a report");
        serde_json::from_str(&text).expect("JSON")
    }
}

/// A picture that must be there and whole.
pub fn read(path: &Path) -> Picture {
    Picture::read_png(path).expect("a picture")
}

/// Runs and expects success.
pub fn run(command: &mut Command) -> Output {
    let output = command.output().expect("the binary runs");
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {error}");
    output
}

/// Runs and expects exit 1 with one line that starts with `error: `; returns all it said.
pub fn refused(command: &mut Command) -> String {
    let output = command.output().expect("the binary runs");
    assert_eq!(output.status.code(), Some(1), "{command:?}");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(said.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{said}");
    said
}
