//! `lodestream shot`: the real binary, a real server, real pictures.

use std::{
    net::{Ipv4Addr, SocketAddr},
    path::Path,
    process::{Command, Output},
};

use lodestream_client::render::{Picture, ssim};
use lodestream_preprocess::{BuildConfig, Method, Progress, build};
use lodestream_server::{RunningServer, ServeConfig, spawn};

struct Silent;

impl Progress for Silent {
    fn phase(&self, _name: &str, _total: u64, _unit: &str) {}
    fn advance(&self, _amount: u64) {}
    fn warn(&self, _line: &str) {}
}

/// A folder with a dataset of a simulated scan in it, and a server for it.
struct World {
    folder: tempfile::TempDir,
    server: RunningServer,
}

impl World {
    fn new() -> Self {
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
            cancel: Default::default(),
        };
        build(&config, &Silent).expect("built");
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        let server = spawn(ServeConfig::new(folder.path(), address)).expect("serving");
        Self { folder, server }
    }

    fn file(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }

    /// `lodestream shot` of the served dataset into `NAME.png` and `NAME.json`.
    fn shot(&self, name: &str, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lodestream"));
        command
            .args(["shot", &format!("{}/courtyard", self.server.url()), "--size", "320x200"])
            .args(["-o", &self.file(&format!("{name}.png"))])
            .args(["--report", &self.file(&format!("{name}.json"))])
            .args(args);
        command
    }

    fn picture(&self, name: &str) -> Picture {
        Picture::read_png(Path::new(&self.file(&format!("{name}.png")))).expect("a picture")
    }

    fn report(&self, name: &str) -> serde_json::Value {
        let text = std::fs::read_to_string(self.file(&format!("{name}.json"))).expect("a report");
        serde_json::from_str(&text).expect("JSON")
    }
}

fn run(command: &mut Command) -> Output {
    let output = command.output().expect("the binary runs");
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {error}");
    output
}

#[test]
fn all_renderers_show_the_same_scene() {
    let world = World::new();
    run(&mut world.shot("cpu", &["--renderer", "cpu"]));
    let cpu = world.picture("cpu");
    run(&mut world.shot("truth", &["--renderer", "truth"]));
    let truth = ssim(&cpu, &world.picture("truth")).expect("same size");
    // 60,000 points fit the budget: the truth has the same ones, better sampled.
    assert!(truth > 0.8, "SSIM {truth}");
    let report = world.report("cpu");
    assert!(report["points"].as_u64() > Some(10_000), "{report}");
    assert!(report["requests"].as_u64() <= Some(12) && report["bytes"].as_u64() > Some(0));
    assert!(report["first_picture_ms"].as_f64() <= report["settled_picture_ms"].as_f64());
    assert_eq!(world.report("truth")["points"].as_u64(), Some(60_000));

    if std::env::var_os("LODESTREAM_NO_GPU").is_some_and(|value| value == "1") {
        println!("LODESTREAM_NO_GPU=1: the GPU part of this test is left out");
        return;
    }
    run(&mut world.shot("gpu", &["--against", &world.file("cpu.png")]));
    let report = world.report("gpu");
    assert_eq!(report["fallback"], serde_json::Value::Null, "apt-get install mesa-vulkan-drivers");
    assert!(report["ssim"].as_f64() > Some(0.99), "{report}");
}

#[test]
fn without_a_gpu_the_cpu_draws_and_one_line_says_so() {
    let world = World::new();
    run(&mut world.shot("cpu", &["--renderer", "cpu"]));
    // No Vulkan driver is found where there is no such folder.
    let mut command = world.shot("fallback", &[]);
    let output = run(command.env("VK_ICD_FILENAMES", world.file("nowhere.json")));
    let said = String::from_utf8_lossy(&output.stderr);
    let notes: Vec<_> = said.lines().filter(|line| line.starts_with("note: ")).collect();
    assert!(matches!(notes[..], [note] if note.ends_with("drawing on the CPU")), "{said}");
    assert_eq!(world.picture("fallback").rgba8, world.picture("cpu").rgba8);
    assert!(world.report("fallback")["fallback"].is_string());
}

#[test]
fn a_camera_file_is_looked_through() {
    let world = World::new();
    let path = world.file("camera.json");
    let camera = r#"{"eye":[0,0,1000],"target":[0,0,0],"orthographic_height":5000}"#;
    std::fs::write(&path, camera).expect("written");
    run(&mut world.shot("above", &["--renderer", "cpu", "--camera", &path, "--color", "level"]));
    let report = world.report("above");
    assert_eq!(report["camera"]["orthographic_height"], 5000.0);
    // A scene of some fifty metres in a picture of five kilometres.
    let coverage = report["coverage"].as_f64().expect("a number");
    assert!(coverage > 0.0 && coverage < 0.05, "{coverage}");
}

#[test]
fn what_cannot_be_drawn_is_refused_in_one_line() {
    let world = World::new();
    let refused = |args: &[&str]| {
        let output = world.shot("refused", args).output().expect("the binary runs");
        assert_eq!(output.status.code(), Some(1), "{args:?}");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(said.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{said}");
        said
    };
    let cpu = ["--renderer", "cpu"];
    assert!(refused(&[&cpu[..], &["--camera", "no-such.json"]].concat()).contains("no-such.json"));
    assert!(refused(&[&cpu[..], &["--against", "no-such.png"]].concat()).contains("no-such.png"));
    let usage = world.shot("usage", &["--splat", "star"]).output().expect("the binary runs");
    assert_eq!(usage.status.code(), Some(2));
}
