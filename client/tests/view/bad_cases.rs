//! What is wrong from the start, or goes wrong: each has a clear end or a calm message.

use crate::{
    PROGRAM, is_without_gpu,
    screen::{Screen, Window},
    world::World,
};

fn refusal(outcome: (Option<i32>, String)) -> String {
    let (code, said) = outcome;
    assert_eq!(code, Some(1), "{said}");
    let lines: Vec<_> = said.lines().filter(|line| line.starts_with("error: ")).collect();
    let [line] = lines[..] else { panic!("one line: {said}") };
    line.to_owned()
}

#[test]
fn without_a_screen_or_an_adapter_one_line_says_what_to_do() {
    let screen = Screen::new(320, 240);
    let none = [("DISPLAY", "")];
    let said = refusal(Window::start(&screen, PROGRAM, &["--settings", "-"], &none).end());
    assert!(said.contains("DISPLAY") && said.contains("lodestream shot"), "{said}");
    let away = [("DISPLAY", ":987")];
    let said = refusal(Window::start(&screen, PROGRAM, &["--settings", "-"], &away).end());
    assert!(said.contains("cannot open a window"), "{said}");
    // No Vulkan driver is found where there is no such file.
    let none = [("VK_DRIVER_FILES", "/nowhere.json"), ("VK_ICD_FILENAMES", "/nowhere.json")];
    let said = refusal(Window::start(&screen, PROGRAM, &["--settings", "-"], &none).end());
    assert!(said.contains("no graphics adapter") && said.contains("mesa"), "{said}");
}

#[test]
fn two_sessions_at_once_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let sessions = ["a.json", "b.json"].map(|name| {
        let path = folder.path().join(name);
        std::fs::write(&path, "{}").expect("written");
        path.display().to_string()
    });
    let screen = Screen::new(640, 480);
    let [a, b] = &sessions;
    let arguments = [a, b, "--settings", "-"];
    let said = refusal(Window::start(&screen, PROGRAM, &arguments, &[]).end());
    assert!(said.contains("one session at a time") && said.contains("b.json"), "{said}");
}

#[test]
fn what_cannot_be_opened_is_told_in_a_window_that_stays() {
    if is_without_gpu() {
        return;
    }
    let world = World::new();
    let screen = Screen::new(640, 480);
    let typo = world.source().replace("courtyard", "courtyrad");
    // A dataset of the next version of the format: the version is behind the file's magic bytes.
    let mut newer = std::fs::read(world.path("courtyard.lods")).expect("the dataset");
    let at = lodestream_protocol::MAGIC.len();
    newer[at] = newer[at].wrapping_add(1);
    std::fs::write(world.path("newer.lods"), newer).expect("written");
    std::fs::write(world.path("text.lods"), "no dataset").expect("written");
    let (newer, text) = (world.file("newer.lods"), world.file("text.lods"));
    let arguments =
        [typo.as_str(), &newer, &text, "no/such.lods", &world.source(), "--settings", "-"];
    let mut window = Window::open(&screen, PROGRAM, &arguments);
    let missing = window.wait("message", |event| event["warning"] == true);
    assert!(missing["text"].as_str().is_some_and(|t| t.contains("no such file")), "{missing}");
    for (cloud, what) in [(0, "not found"), (1, "version"), (2, "text.lods")] {
        window.wait("cloud", |event| {
            let told = event["trouble"].as_str();
            event["cloud"] == cloud && told.is_some_and(|told| told.contains(what))
        });
    }
    // What can be opened is.
    window.wait("opened", |event| event["cloud"] == 3);
    window.wait("settled", |event| event["points"].as_u64() > Some(0));
    window.close();
}

#[test]
fn a_bad_settings_file_is_put_aside_and_good_ones_are_kept() {
    if is_without_gpu() {
        return;
    }
    let world = World::new();
    let screen = Screen::new(900, 600);
    let settings = world.file("viewer.json");
    std::fs::write(&settings, "{ \"theme\": 7").expect("written");
    let source = world.source();
    let arguments = [source.as_str(), "--settings", &settings, "--size", "900x600"];
    // Fonts are the program's own: the system needs none.
    let no_fonts = [("FONTCONFIG_FILE", "/nowhere"), ("FONTCONFIG_PATH", "/nowhere")];
    let mut window = Window::start(&screen, PROGRAM, &arguments, &no_fonts);
    window.wait("ready", |_| true);
    window.focus();
    let told = window.wait("message", |event| event["warning"] == true);
    assert!(told["text"].as_str().is_some_and(|t| t.contains("viewer.json.bad")), "{told}");
    window.wait("settled", |event| event["points"].as_u64() > Some(0));
    window.keys(&["t", "l"]);
    window.settled();
    window.close();
    let kept = std::fs::read_to_string(&settings).expect("kept");
    let kept: serde_json::Value = serde_json::from_str(&kept).expect("JSON");
    assert_eq!((&kept["theme"], &kept["look"]["eye_dome"]), (&"light".into(), &true.into()));
    assert_eq!(kept["recent"][0].as_str(), Some(source.as_str()));
    let bad = std::fs::read_to_string(world.file("viewer.json.bad")).expect("kept");
    assert_eq!(bad, "{ \"theme\": 7");
}

#[test]
fn windows_of_one_pixel_and_of_4k_work() {
    if is_without_gpu() {
        return;
    }
    let world = World::new();
    let source = world.source();
    let screen = Screen::new(3840, 2160);
    for size in ["1x1", "3840x2160"] {
        let arguments = [source.as_str(), "--settings", "-", "--size", size];
        let mut window = Window::open(&screen, PROGRAM, &arguments);
        let settled = window.wait("settled", |event| event["points"].as_u64() > Some(0));
        if size == "1x1" {
            assert_eq!(settled["size"], serde_json::json!([1, 1]));
            window.resize(640, 400);
            window.wait("settled", |event| event["size"][0].as_u64() > Some(300));
        } else {
            assert!(settled["size"][0].as_u64() > Some(3000), "{settled}");
        }
        window.close();
    }
}

#[test]
fn where_the_gpu_is_not_wanted_the_cpu_draws_the_picture() {
    if is_without_gpu() {
        return;
    }
    let world = World::new();
    let screen = Screen::new(800, 600);
    let (source, folder) = (world.source(), world.file("out"));
    let mut arguments = vec![source.as_str(), "--settings", "-", "--renderer", "cpu"];
    arguments.extend([
        "--folder",
        &folder,
        "--size",
        "800x600",
        "--splat",
        "circle",
        "--splat-size",
        "2px",
    ]);
    arguments.extend(["--theme", "dark"]);
    let mut window = Window::open(&screen, PROGRAM, &arguments);
    window.wait("settled", |event| event["points"].as_u64() > Some(0));
    let picture = crate::world::read(&window.picture());
    let camera = std::path::Path::new(&folder).join("lodestream-0001.camera.json");
    let size = format!("{}x{}", picture.width, picture.height);
    let mut command = std::process::Command::new(PROGRAM);
    command.args(["shot", &source, "-o", &world.file("cpu.png"), "--renderer", "cpu"]);
    crate::world::run(command.args(["--size", &size, "--camera"]).arg(camera));
    assert_eq!(world.picture("cpu").rgba8, picture.rgba8);
    window.close();
}

#[test]
fn a_servers_list_is_shown_and_opened_from() {
    if is_without_gpu() {
        return;
    }
    let mut world = World::new();
    world.add("sim:courtyard?points=5k&seed=9", "second");
    let screen = Screen::new(900, 700);
    let server = world.server_url();
    let mut window =
        Window::open(&screen, PROGRAM, &[&server, "--settings", "-", "--size", "900x700"]);
    window.wait("list", |event| event["datasets"] == 2);
    window.press("Button", "Open all");
    window.wait("opened", |event| event["cloud"] == 0);
    window.wait("opened", |event| event["cloud"] == 1);
    window.settled();
    window.close();
}

#[test]
fn what_is_no_session_is_not_written_over_and_what_is_missing_stays_in_one() {
    if is_without_gpu() {
        return;
    }
    let world = World::of("sim:courtyard?points=2k&seed=3");
    let path = world.file("path.json");
    std::fs::write(&path, r#"{"format":"lodestream-path"}"#).expect("written");
    let session = world.file("session.json");
    let text = r#"{"format":"lodestream-session","version":1,"clouds":[
        {"source":"courtyard.lods"},{"source":"/no/such.lods","hidden_classes":[7]}]}"#;
    std::fs::write(&session, text).expect("written");
    let screen = Screen::new(640, 480);
    let folder = world.file("out");
    let arguments = ["--settings", "-", "--folder", &folder, "--size", "640x480"];
    for file in [&path, &session] {
        let mut window =
            Window::open(&screen, PROGRAM, &[&["--session", file], &arguments[..]].concat());
        window.wait("message", |event| event["warning"] == true);
        window.keys(&["Escape", "ctrl+s"]);
        window.wait("session", |event| event["saved"].is_string());
        window.close();
    }
    let read = |file: &str| std::fs::read_to_string(file).expect("there");
    assert_eq!(read(&path), r#"{"format":"lodestream-path"}"#);
    let kept: serde_json::Value = serde_json::from_str(&read(&session)).expect("JSON");
    assert_eq!(kept["clouds"][0]["source"], "courtyard.lods", "as it lies beside the session");
    assert_eq!(kept["clouds"][1]["source"], "/no/such.lods");
    assert_eq!(kept["clouds"][1]["hidden_classes"][0], 7);
}
