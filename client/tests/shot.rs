//! `lodestream shot`: the real binary, a real server, real pictures.

#[path = "common/world.rs"]
mod world;

use std::process::Command;

use lodestream_client::metrics::ssim;

use world::{World, refused, run};

impl World {
    /// `lodestream shot` of the served dataset into `NAME.png` and `NAME.json`.
    fn shot(&self, name: &str, args: &[&str]) -> Command {
        self.shot_of(&self.source(), &format!("{name}.png"), name, args)
    }
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
    let refused = |args: &[&str]| refused(&mut world.shot("refused", args));
    let cpu = ["--renderer", "cpu"];
    assert!(refused(&[&cpu[..], &["--camera", "no-such.json"]].concat()).contains("no-such.json"));
    assert!(refused(&[&cpu[..], &["--against", "no-such.png"]].concat()).contains("no-such.png"));
    let usage = world.shot("usage", &["--splat", "star"]).output().expect("the binary runs");
    assert_eq!(usage.status.code(), Some(2));
}
