//! A dataset of a simulated scan, a server for it, and the real binary.

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
    server: RunningServer,
}

impl World {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().expect("temporary folder");
        let config = BuildConfig {
            inputs: vec!["sim:courtyard?points=60k&seed=3".into()],
            output: folder.path().join("courtyard.lods"),
            method: Method::default(),
            grid: 128,
            memory_bytes: 256 << 20,
            threads: Some(1),
            drop_attributes: Vec::new(),
            columns: None,
            scale: None,
            cells_per_spacing: lodestream_preprocess::CELLS_PER_SPACING,
            cancel: Default::default(),
        };
        build(&config, &Silent).expect("built");
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        let server = spawn(ServeConfig::new(folder.path(), address)).expect("serving");
        Self { folder, server }
    }

    /// The served dataset, as a source is named.
    pub fn source(&self) -> String {
        format!("{}/courtyard", self.server.url())
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
