//! A camera path: recorded by hand, played, saved, exported as pictures.

use crate::{
    PROGRAM,
    explore::{distance, eye},
    is_without_gpu,
    screen::{Screen, Window},
    world::{World, read},
};

#[test]
fn a_path_is_recorded_played_and_exported() {
    if is_without_gpu() {
        return;
    }
    let world = World::of("sim:courtyard?points=5k&seed=3");
    let screen = Screen::new(620, 820);
    let (source, folder) = (world.source(), world.file("out"));
    let arguments = [source.as_str(), "--settings", "-", "--folder", &folder, "--size", "620x820"];
    let mut window = Window::open(&screen, PROGRAM, &arguments);
    window.settled();
    window.keys(&["r"]);
    window.drag(1, [450, 300], [6, 2]);
    let moved = window.settled();
    window.keys(&["r"]);
    let recorded = window.wait("recorded", |_| true);
    assert!(recorded["keys"].as_u64() >= Some(2), "{recorded}");
    window.keys(&["space"]);
    window.wait("played", |_| true);

    window.press("DisclosureTriangle", "Look");
    window.press("DisclosureTriangle", "Detail");
    window.press("DisclosureTriangle", "Views and paths");
    window.press("Button", "Export");
    window.wait("exported", |_| true);
    window.close();

    let frame = |number: u32| world.path(&format!("out/frames/frame_{number:04}.png"));
    let (first, last) = (read(&frame(0)), read(&frame(119)));
    assert!(first.rgba8 != last.rgba8, "the camera moved");
    assert!(!frame(120).exists());
    assert_eq!(serde_json::json!([last.width, last.height]), moved["size"]);
}

#[test]
fn a_path_of_the_command_line_is_played_at_once() {
    if is_without_gpu() {
        return;
    }
    let world = World::of("sim:courtyard?points=5k&seed=3");
    let path = world.file("path.json");
    let key = |time: u32, x: u32| {
        format!(r#"{{"time":{time},"position":[{x},-40,20],"target":[8,3,2],"fov_y_degrees":50}}"#)
    };
    let keys = [key(0, 0), key(1, 30)].join(",");
    let text = format!(r#"{{"format":"lodestream-path","version":1,"keys":[{keys}]}}"#);
    std::fs::write(&path, text).expect("written");
    let screen = Screen::new(400, 300);
    let source = world.source();
    let arguments = [source.as_str(), "--settings", "-", "--path", &path, "--size", "400x300"];
    let mut window = Window::open(&screen, PROGRAM, &arguments);
    window.wait("played", |_| true);
    // It ends where the path does.
    window.wait("settled", |event| distance(eye(event), [30.0, -40.0, 20.0]) < 1e-6);
    window.close();
}

#[test]
fn a_path_that_is_no_path_is_refused_before_a_window_opens() {
    let screen = Screen::new(100, 100);
    let window = Window::start(&screen, PROGRAM, &["--path", "no-such.json"], &[]);
    let (code, said) = window.end();
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("no-such.json"), "{said}");
}
