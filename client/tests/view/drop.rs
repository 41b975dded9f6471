//! Files that are dragged onto the window from another program.

use crate::{
    PROGRAM,
    drag::{Dragger, Kind},
    is_without_gpu,
    screen::{Screen, Window},
    world::World,
};

#[test]
fn files_are_dropped_on_the_window_and_opened() {
    if is_without_gpu() {
        return;
    }
    let mut world = World::of("sim:courtyard?points=5k&seed=3");
    world.add("sim:courtyard?points=2k&seed=5", "with space");
    std::fs::write(world.path("letter.lods"), "Dear reader").expect("written");
    let screen = Screen::new(640, 480);
    let mut window = Window::open(&screen, PROGRAM, &["--settings", "-", "--size", "640x480"]);
    let dragger = Dragger::new(screen.display());
    let address = |name: &str| format!("file://{}\r\n", world.file(name).replace(' ', "%20"));

    // Over the window, a hint says what will come of it; away again, it is gone.
    window.forget_past();
    assert!(dragger.hover(Kind::Files, &address("with space.lods")));
    window.see("Label", "Drop it to open it");
    dragger.leave();
    window.miss("Label", "Drop it to open it");

    // Let go: opened.
    assert!(dragger.hover(Kind::Files, &address("with space.lods")));
    dragger.drop();
    let opened = window.wait("opened", |event| event["cloud"] == 0);
    assert_eq!(opened["points"], 2000, "{opened}");

    // Two at once, one of which is no dataset: it is told, and the other is opened.
    let two = address("letter.lods") + &address("courtyard.lods");
    assert!(dragger.hover(Kind::Files, &two));
    dragger.drop();
    window.wait("opened", |event| event["points"] == 5000);
    window.wait("cloud", |event| {
        event["cloud"] == 1 && event["trouble"].as_str().is_some_and(|t| t.contains("letter.lods"))
    });

    // A text is no file.
    assert!(!dragger.hover(Kind::Text, "courtyard.lods"));
    window.close();
}
