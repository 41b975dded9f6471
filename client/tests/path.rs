//! `lodestream shot --path`: numbered pictures along a camera path, by the real binary.

#[expect(dead_code, reason = "the host can misbehave in more ways than these tests need")]
#[path = "common/host.rs"]
mod host;
#[path = "common/world.rs"]
mod world;

use std::{path::Path, process::Command};

use lodestream_client::path::CameraPath;
use serde_json::Value;

use host::{Answer, Host};
use world::{World, read, refused, run};

const CPU: [&str; 2] = ["--renderer", "cpu"];

/// The camera turns its back to the courtyard, then looks at it, twice, and turns away again.
const THERE_AND_BACK: &str = r#"{
  "format": "lodestream-path", "version": 1, "name": "there and back",
  "keys": [
    {"time": 0, "position": [-1, -19, 15], "target": [-1, -40, 15], "fov_y_degrees": 50},
    {"time": 1, "position": [-1, -19, 15], "target": [12, 9, 1], "fov_y_degrees": 50, "jump": true},
    {"time": 2, "position": [-1, -19, 15], "target": [12, 9, 1], "fov_y_degrees": 50},
    {"time": 3, "position": [-1, -19, 15], "target": [-1, -40, 15], "fov_y_degrees": 50, "jump": true},
    {"time": 4, "position": [-1, -19, 15], "target": [12, 9, 1], "fov_y_degrees": 50, "jump": true}
  ]
}"#;

impl World {
    /// `lodestream shot` of `source` along a path into the folder `NAME` and `NAME.json`.
    fn tour_of(&self, source: &str, name: &str, path: &str, args: &[&str]) -> Command {
        let mut command = self.shot_of(source, name, name, args);
        command.args(["--path", path]);
        command
    }

    fn tour(&self, name: &str, path: &str, args: &[&str]) -> Command {
        self.tour_of(&self.source(), name, path, args)
    }

    /// Names of the files of a tour.
    fn names(&self, name: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.path(name)).expect("a folder");
        let mut names: Vec<String> = entries
            .map(|entry| entry.expect("listed").file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    /// The pictures of a tour.
    fn pictures(&self, name: &str) -> Vec<Vec<u8>> {
        let names = self.names(name).into_iter();
        names.map(|file| read(&self.path(name).join(file)).rgba8).collect()
    }

    fn there_and_back(&self) -> String {
        std::fs::write(self.path("path.json"), THERE_AND_BACK).expect("written");
        self.file("path.json")
    }
}

fn frames(report: &Value) -> &Vec<Value> {
    report["frames"].as_array().expect("a list")
}

fn numbers(report: &Value, field: &str) -> Vec<u64> {
    frames(report).iter().map(|frame| frame[field].as_u64().expect(field)).collect()
}

#[test]
fn an_orbit_is_numbered_pictures_that_differ_and_can_be_repeated_from_its_file() {
    let world = World::new();
    let file = world.file("course.json");
    let spec = "orbit?seconds=4&fov=60";
    let args = [&CPU[..], &["--frames", "5", "--write-path", &file]].concat();
    run(&mut world.tour("orbit", spec, &args));
    let names = ["frame_0000.png", "frame_0001.png", "frame_0002.png", "frame_0003.png"];
    assert_eq!(world.names("orbit"), [&names[..], &["frame_0004.png"]].concat());
    let pictures = world.pictures("orbit");
    for (index, picture) in pictures.iter().enumerate() {
        assert!(!pictures[..index].contains(picture), "picture {index} is one of those before");
    }

    let report = world.report("orbit");
    assert_eq!(report["path"]["name"], spec);
    assert_eq!(report["path"]["loop"], true);
    let path = CameraPath::read(Path::new(&file)).expect("a path");
    for (index, frame) in frames(&report).iter().enumerate() {
        // A loop's end is its start, which is drawn already.
        let time = frame["time"].as_f64().expect("a number");
        assert!((time - 0.8 * index as f64).abs() < 1e-12);
        let camera: Value = serde_json::from_str(&path.at(time).to_json()).expect("JSON");
        assert_eq!(frame["camera"]["eye"], camera["eye"]);
        assert_eq!(frame["settled"], true);
        assert!(frame["points"].as_u64() > Some(10_000), "{frame}");
        assert!(frame["coverage"].as_f64() > Some(0.02), "{frame}");
    }
    let told = numbers(&report, "bytes").iter().sum::<u64>();
    assert!(Some(told) <= report["bytes"].as_u64(), "{told} bytes, {report}");

    let args = [&CPU[..], &["--frames", "5"]].concat();
    run(&mut world.tour("again", &file, &args));
    assert!(world.pictures("again") == pictures, "the file is another path");
}

#[test]
fn a_picture_of_a_path_is_that_of_its_camera() {
    let world = World::new();
    let path = world.there_and_back();
    run(&mut world.tour("tour", &path, &[&CPU[..], &["--frames", "2"]].concat()));
    let camera = world.report("tour")["frames"][1]["camera"].to_string();
    std::fs::write(world.path("camera.json"), camera).expect("written");
    let camera = world.file("camera.json");
    let args = [&CPU[..], &["--camera", &camera]].concat();
    run(&mut world.shot_of(&world.source(), "one.png", "one", &args));
    assert!(world.picture("one").rgba8 == world.pictures("tour")[1]);
}

#[test]
fn what_one_picture_has_loaded_is_there_for_the_next() {
    let world = World::new();
    let path = world.there_and_back();
    let gpu = std::env::var_os("LODESTREAM_NO_GPU").is_none_or(|value| value != "1");
    let renderer = if gpu { "gpu" } else { "cpu" };
    let args = ["--renderer", renderer, "--frames", "5"];
    run(&mut world.tour("tour", &path, &args));
    let pictures = world.pictures("tour");
    let [away, there, still, gone, back] = &pictures[..] else { panic!("not five pictures") };
    assert!(away != there && there == still && away == gone && there == back);
    let report = world.report("tour");
    let requests = numbers(&report, "requests");
    assert!(requests[1] > 0 && requests[2..] == [0, 0, 0], "{requests:?}");
    assert!(numbers(&report, "cache_hits")[4] > 0, "{report}");
    assert_eq!(report["frames"][2]["settled_ms"], 0.0, "the camera has not moved");
    if gpu {
        assert_eq!(report["fallback"], Value::Null, "apt-get install mesa-vulkan-drivers");
        let uploaded = |k: usize| report["frames"][k]["frame"]["uploaded_bytes"].as_u64();
        assert!(uploaded(1) > Some(0), "{report}");
        assert_eq!([uploaded(2), uploaded(4)], [Some(0), Some(0)], "not on the GPU any more");
    }
}

#[test]
fn the_truth_along_a_path_is_of_every_point() {
    let world = World::new();
    let path = world.there_and_back();
    let args = ["--renderer", "truth", "--frames", "3", "--size", "64x48"];
    let output = run(&mut world.tour("truth", &path, &args[..4]));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("all 60000 points"), "{said}");
    let report = world.report("truth");
    assert_eq!(report["renderer"], "truth");
    assert_eq!(numbers(&report, "points"), [60_000; 3]);
    assert!(numbers(&report, "bytes").iter().all(|bytes| *bytes > 100_000), "{report}");
    assert_eq!(world.names("truth").len(), 3);
}

/// A host that sends the dataset's first bytes, and then stops in the middle of every answer; tells
/// when it has come to that.
fn stalling_host(world: &World) -> (Host, tokio::sync::mpsc::UnboundedReceiver<()>) {
    let bytes = std::fs::read(world.path("courtyard.lods")).expect("built");
    let (reached, stalled) = tokio::sync::mpsc::unbounded_channel();
    let host = Host::start(bytes, move |request| match request.number {
        0 => Answer::Good,
        _ => Answer::Hang { share: 0.5, reached: reached.clone() },
    });
    (host, stalled)
}

#[test]
fn in_real_time_a_picture_shows_what_has_come_and_waits_for_nothing() {
    let world = World::new();
    let (host, _stalled) = stalling_host(&world);
    let path = world.there_and_back();
    // With the camera on the courtyard from the second picture on.
    let args = [&CPU[..], &["--time-step", "1", "--frames", "2"]].concat();
    let output = run(&mut world.tour_of(&host.url(), "live", &path, &args));
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("2 pictures") && said.contains("1 complete"), "{said}");
    assert_eq!(world.names("live"), ["frame_0000.png", "frame_0001.png"]);
    let report = world.report("live");
    assert_eq!(report["time_step_seconds"], 1.0);
    let [away, there] = &frames(&report)[..] else { panic!("not two pictures") };
    assert_eq!((&away["settled"], &there["settled"]), (&true.into(), &false.into()));
    assert_eq!(there["current"], true, "a second is enough for a walk through the tree");
    assert!(there["left_out"]["loading"]["nodes"].as_u64() > Some(0), "{there}");
    assert_eq!(there["settled_ms"], Value::Null);
    assert!(there["late_ms"].is_number());
}

#[cfg(unix)]
#[test]
fn an_interrupt_leaves_whole_pictures_only() {
    let world = World::new();
    let (host, mut stalled) = stalling_host(&world);
    let path = world.there_and_back();
    let mut command = world.tour_of(&host.url(), "cut", &path, &CPU);
    command.args(["--frames", "5"]).stderr(std::process::Stdio::piped());
    let child = command.spawn().expect("starts");
    stalled.blocking_recv().expect("the second picture is being loaded");
    let interrupted = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(interrupted.expect("kill runs").success());
    let output = child.wait_with_output().expect("ends");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("error: frame_0001.png (at 1 s): interrupted"), "{said}");
    assert_eq!(world.names("cut"), ["frame_0000.png"]);
    assert_eq!(world.pictures("cut").len(), 1);
}

#[test]
fn bad_usage_is_exit_2() {
    let world = World::new();
    let orbit = &["--path", "orbit"][..];
    for args in [
        orbit,
        &["--frames", "3"],
        &["--time-step", "1"],
        &["--write-path", "p.json"],
        &[orbit, &["--frames", "0"]].concat(),
        &[orbit, &["--time-step", "0"]].concat(),
        &[orbit, &["--time-step", "1e9"]].concat(),
        &[orbit, &["--frames", "3", "--camera", "c.json"]].concat(),
        &[orbit, &["--frames", "3", "--camera", "overview"]].concat(),
        &[orbit, &["--frames", "3", "--against", "a.png"]].concat(),
        &[orbit, &["--time-step", "1", "--renderer", "truth"]].concat(),
    ] {
        let mut command = world.shot_of(&world.source(), "none", "none", args);
        let output = command.output().expect("the binary runs");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {said}");
        assert!(!world.path("none").exists(), "{args:?}");
    }
}

#[test]
fn what_is_no_path_is_refused_in_one_line() {
    let world = World::new();
    let three = [&CPU[..], &["--frames", "3"]].concat();
    let refused = |path: &str| refused(&mut world.tour("refused", path, &three));
    assert!(refused("no-such.json").contains("no-such.json: no such file"));
    assert!(refused("orbit?turn=2").contains("orbit has no option \"turn\""));
    let bad = THERE_AND_BACK.replace("\"time\": 3", "\"time\": 1.5");
    std::fs::write(world.path("bad.json"), bad).expect("written");
    let said = refused(&world.file("bad.json"));
    assert!(said.contains("bad.json: key 4: time 1.5 is not after"), "{said}");
    std::fs::write(world.path("refused"), "a file").expect("written");
    let said = refused("orbit");
    assert!(said.contains("refused: cannot make the folder"), "{said}");
}
