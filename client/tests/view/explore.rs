//! A person explores a dataset that a server has: everything once, by hand.

use std::{
    path::{Path, PathBuf},
    process::Command,
};

use lodestream_client::metrics::ssim;
use lodestream_protocol::Dataset;
use serde_json::Value;

use crate::{
    PROGRAM, is_without_gpu,
    screen::{Screen, Window},
    world::{World, read, run},
};

/// Pictures of the same nodes by the same renderer differ by nothing but rounding.
const SAME: f64 = 0.98;

/// Fewer points than there are.
const BUDGET: &str = "400000";

/// The splats of the pictures that are compared.
pub const LOOK: [&str; 8] =
    ["--splat", "circle", "--splat-size", "adaptive:1.6", "--min-splat", "2", "--max-splat", "8"];

pub fn eye(event: &Value) -> [f64; 3] {
    place(&event["camera"]["eye"])
}

fn place(value: &Value) -> [f64; 3] {
    std::array::from_fn(|axis| value[axis].as_f64().expect("a number"))
}

pub fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt()
}

/// The middle of the picture in the window.
fn middle(event: &Value) -> [i64; 2] {
    let side = |index: usize| event["view"][index].as_f64().expect("a number");
    [(0.5 * (side(0) + side(2))) as i64, (0.5 * (side(1) + side(3))) as i64]
}

/// Draws what the window shows by `lodestream shot`, from the camera that was written beside its picture.
pub fn compare(world: &World, picture: &Path, arguments: &[&str]) {
    let shown = read(picture);
    let size = format!("{}x{}", shown.width, shown.height);
    let camera = picture.with_extension("camera.json").display().to_string();
    let drawn = world.path("drawn.png");
    let drawn_name = drawn.display().to_string();
    let mut command = Command::new(PROGRAM);
    command.args([
        "shot",
        &world.source(),
        "-o",
        &drawn_name,
        "--size",
        &size,
        "--camera",
        &camera,
    ]);
    let report = world.file("drawn.json");
    run(command.args(arguments).args(["--report", &report]));
    let similarity = ssim(&shown, &read(&drawn)).expect("the same size");
    let [picture, drawn] = [picture, &drawn].map(|path| path.display().to_string());
    let report = std::fs::read_to_string(report).expect("a report");
    assert!(
        similarity > SAME,
        "SSIM {similarity}: {picture} against {drawn} {arguments:?}, {report}"
    );
}

/// Where screenshots go: for the documentation, or beside the build.
fn screenshots() -> PathBuf {
    let folder = std::env::var_os("LODESTREAM_SCREENSHOTS").map(PathBuf::from);
    let folder = folder.unwrap_or_else(|| Path::new(env!("CARGO_TARGET_TMPDIR")).join("viewer"));
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

#[test]
fn a_person_explores_a_served_dataset_and_finds_everything_again() {
    if is_without_gpu() {
        return;
    }
    let mut world = World::of("sim:courtyard?points=1M&seed=3");
    let source = world.source();
    let folder = world.file("out");
    let screen = Screen::new(1280, 900);
    let photographs = screenshots();
    // What is drawn last is on the screen a moment later.
    let photograph = |name: &str| {
        screen.hand(&["sleep", "0.6"]);
        screen.write(&photographs.join(name));
    };
    let mut arguments = vec![source.as_str(), "--folder", &folder, "--settings", "-"];
    arguments.extend(["--size", "1280x900", "--budget", BUDGET, "--theme", "dark"]);
    arguments.extend(LOOK);
    let mut window = Window::open(&screen, PROGRAM, &arguments);

    // Opens, and shows what `shot` draws.
    let opened = window.wait("opened", |event| event["cloud"] == 0);
    assert_eq!(opened["points"], 1_000_000);
    let first = window.settled();
    let look = [&LOOK[..], &["--budget", BUDGET]].concat();
    photograph("overview.png");
    let picture = window.picture();
    compare(&world, &picture, &look);

    // Orbit: the eye moves around the target, at the same distance.
    let [x, y] = middle(&first);
    window.drag(1, [x, y], [9, 2]);
    let orbited = window.wait("settled", |event| distance(eye(event), eye(&first)) > 1.0);
    let target = |event: &Value| place(&event["camera"]["target"]);
    assert!(distance(target(&orbited), target(&first)) < 1e-6);
    let radius = |event: &Value| distance(eye(event), target(event));
    assert!((radius(&orbited) - radius(&first)).abs() < 1e-6 * radius(&first));

    // Pan: both move alike.
    window.drag(3, [x, y], [-4, 3]);
    let panned = window.wait("settled", |event| distance(target(event), target(&orbited)) > 0.1);
    let moved = |a: [f64; 3], b: [f64; 3]| std::array::from_fn::<f64, 3, _>(|i| a[i] - b[i]);
    let (of_eye, of_target) =
        (moved(eye(&panned), eye(&orbited)), moved(target(&panned), target(&orbited)));
    assert!(distance(of_eye, of_target) < 1e-6);

    // Zoom: nearer.
    window.wheel(x, y, 4, 4);
    let zoomed = window.wait("settled", |event| radius(event) < 0.8 * radius(&panned));
    let picture = window.picture();
    compare(&world, &picture, &look);

    // Pick: a point of the dataset, to the last digit, with all its values.
    window.forget_past();
    window.click_at(x, y, 1);
    let picked = window.wait("picked", |event| event["cloud"] == 0);
    let values = window.wait("values", |event| !event["values"].is_null());
    is_a_point_of(&world.path("courtyard.lods"), &picked, &values);
    window.keys(&["ctrl+c"]);
    let copied = window.wait("copied", |_| true);
    let text: Vec<_> =
        picked["text"].as_array().expect("texts").iter().map(|t| t.as_str()).collect();
    assert_eq!(
        copied["text"].as_str().map(str::to_owned),
        Some(text.into_iter().flatten().collect::<Vec<_>>().join(" "))
    );
    photograph("picked.png");

    // A double click sets the pivot: the camera looks at that very point.
    window.forget_past();
    window.click_at(x, y, 2);
    let pivoted =
        window.wait("settled", |event| distance(target(event), place(&picked["world"])) < 1e-9);

    // Fly: ahead, along the view direction.
    window.keys(&["g"]);
    window.hold("w", "0.4");
    let flown = window.wait("settled", |event| distance(eye(event), eye(&pivoted)) > 0.02);
    let ahead = moved(target(&pivoted), eye(&pivoted));
    let way = moved(eye(&flown), eye(&pivoted));
    let along: f64 = (0..3).map(|i| ahead[i] * way[i]).sum();
    let lengths = distance(ahead, [0.0; 3]) * distance(way, [0.0; 3]);
    assert!(along / lengths > 0.999, "{ahead:?} {way:?}");
    window.keys(&["g"]);

    // Measure between two points.
    window.keys(&["m"]);
    window.click_at(x - 60, y + 40, 1);
    window.wait("picked", |event| event["cloud"] == 0);
    window.forget_past();
    window.click_at(x + 70, y + 20, 1);
    let measured = window.wait("measured", |_| true);
    assert!(measured["distance"].as_f64() > Some(0.0), "{measured}");
    photograph("measured.png");
    window.keys(&["m"]);

    // Another splat and another colour, by the panel.
    window.choose("circle", "square");
    window.choose("rgb", "elevation");
    window.keys(&["f"]);
    window.settled();
    let picture = window.picture();
    let other =
        [&LOOK[2..], &["--splat", "square", "--color", "elevation", "--budget", BUDGET]].concat();
    compare(&world, &picture, &other);
    photograph("elevation.png");

    // Clip: fewer points, and all of them inside.
    let before = window.last_settled();
    window.keys(&["c"]);
    let is_less = |event: &Value| event["points"].as_u64() < before["points"].as_u64();
    window.press("Button", "Around the point");
    let clipped = window.wait("settled", is_less);
    assert!(clipped["points"].as_u64() > Some(0), "{clipped}");
    photograph("clipped.png");
    window.keys(&["c"]);
    window.wait("settled", |event| event["points"].as_u64() > clipped["points"].as_u64());

    // Another size of the window.
    window.resize(1000, 640);
    let resized = window.wait("settled", |event| event["size"] != first["size"]);
    let picture = window.picture();
    let shown = read(&picture);
    assert_eq!(resized["size"], serde_json::json!([shown.width, shown.height]));
    compare(&world, &picture, &other);

    // A second cloud, typed into the dialog.
    world.add("sim:courtyard?points=20k&seed=5", "second");
    window.keys(&["ctrl+o"]);
    window.see("Label", "A file, a folder, a URL, or a server and a dataset");
    window.text(&world.file("second.lods"));
    window.keys(&["Return"]);
    let opened = window.wait("opened", |event| event["cloud"] == 1);
    assert_eq!(opened["points"], 20_000);
    window.settled();

    // The server goes away: what is there stays, the trouble is told, nothing ends. What was not loaded
    // before is asked for, until the server is back.
    world.stop_server();
    window.keys(&["n", "n"]);
    window.wait("cloud", |event| event["cloud"] == 0 && event["trouble"].is_string());
    photograph("trouble.png");
    window.forget_past();
    world.restart_server();
    window.wait("cloud", |event| event["cloud"] == 0 && event["trouble"].is_null());
    window.settled();

    // Saved, closed and opened again, it looks the same.
    window.keys(&["b"]);
    window.wait("bookmark", |_| true);
    let picture_before = window.picture();
    window.keys(&["ctrl+s"]);
    let saved = window.wait("session", |event| event["saved"].is_string());
    let session = saved["saved"].as_str().expect("a file").to_owned();
    window.close();
    let again =
        ["--session", &session, "--folder", &folder, "--settings", "-", "--size", "1000x640"];
    let mut window = Window::open(&screen, PROGRAM, &again);
    window.wait("opened", |event| event["cloud"] == 1);
    let reopened = window.wait("settled", |event| event["points"].as_u64() > Some(20_000));
    assert_eq!(reopened["size"], resized["size"]);
    let picture_after = window.picture();
    let similarity = ssim(&read(&picture_before), &read(&picture_after)).expect("the same size");
    assert!(similarity > SAME, "SSIM {similarity} before and after");
    photograph("reopened.png");
    window.close();
    let _ = (zoomed, flown);
}

/// The event tells of a point that the file has, with the colour that it has there.
fn is_a_point_of(file: &Path, picked: &Value, values: &Value) {
    let bytes = std::fs::read(file).expect("the dataset");
    let dataset = Dataset::open(bytes).expect("a dataset");
    let manifest = dataset.manifest();
    let color = manifest.attributes.iter().position(|a| a.name == "color").expect("colours");
    let size = manifest.attributes[color].value_bytes() / 3;
    let world = place(&picked["world"]);
    let told = values["values"].as_array().expect("values");
    let told = told.iter().find(|pair| pair[0] == "color").expect("a colour");
    let nodes = dataset.hierarchy().expect("a hierarchy");
    let found = nodes.iter().any(|node| {
        if u64::from(node.key.level()) != picked["level"].as_u64().expect("a level") {
            return false;
        }
        let points = dataset.read_node(node, &[]).expect("a node");
        let corner = manifest.lattice.node_min(node.key);
        let column = &points.column(color).expect("in the first group").bytes;
        points.positions.iter().enumerate().any(|(index, q)| {
            let q = std::array::from_fn(|axis| corner[axis] + q[axis]);
            let value = &column[3 * size * index..][..3 * size];
            let components =
                value.chunks(size).map(|c| manifest.attributes[color].scalar.to_f64(c));
            let text: Vec<String> = components.map(|c| c.to_string()).collect();
            manifest.lattice.world(q) == world && told[1] == text.join(", ")
        })
    });
    assert!(found, "no such point: {picked} {values}");
}
