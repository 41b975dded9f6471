//! The list of clouds by hand: what each shows of itself, and what happens when one is replaced.

use lodestream_client::metrics::ssim;
use lodestream_protocol::Dataset;
use serde_json::Value;

use crate::{
    PROGRAM,
    explore::{LOOK, compare},
    is_without_gpu,
    screen::{Screen, Window},
    world::{World, read},
};

/// Of buildings, in the simulated scan.
const BUILDING: u8 = 6;

/// Fewer points than there are.
const BUDGET: [&str; 2] = ["--budget", "60000"];

/// How many points of a file are of a class.
fn of_class(file: &str, class: u8) -> u64 {
    let dataset = Dataset::open(std::fs::read(file).expect("the dataset")).expect("a dataset");
    let attributes = &dataset.manifest().attributes;
    let index = attributes.iter().position(|a| a.name == "classification").expect("classes");
    let group = attributes[index].group().expect("a column");
    let nodes = dataset.hierarchy().expect("a hierarchy");
    let count = |node| {
        let points = dataset.read_node(node, &[group]).expect("a node");
        let classes = &points.column(index).expect("its group was read").bytes;
        classes.iter().filter(|found| **found == class).count() as u64
    };
    nodes.iter().map(count).sum()
}

fn points(event: &Value) -> u64 {
    event["points"].as_u64().expect("a number")
}

#[test]
fn each_cloud_has_classes_colours_and_visibility_of_its_own() {
    if is_without_gpu() {
        return;
    }
    let mut world = World::of("sim:courtyard?points=20k&seed=3");
    world.add("sim:courtyard?points=5k&seed=5", "second");
    let screen = Screen::new(900, 900);
    let (first, second, folder) = (world.source(), world.file("second.lods"), world.file("out"));
    let mut arguments = vec![first.as_str(), &second, "--settings", "-", "--folder", &folder];
    arguments.extend(["--size", "900x900", "--min-node", "1"]);
    let mut window = Window::open(&screen, PROGRAM, &arguments);
    window.wait("settled", |event| points(event) == 25_000);

    // Classes: of the first alone, as many points as the file has of them.
    window.press("Button", "Classes of courtyard");
    window.press("CheckBox", &format!("{BUILDING}  building"));
    let buildings = of_class(&world.file("courtyard.lods"), BUILDING);
    assert!(buildings > 0);
    window.wait("settled", |event| points(event) == 25_000 - buildings);
    window.press("CheckBox", &format!("{BUILDING}  building"));
    window.wait("settled", |event| points(event) == 25_000);
    window.keys(&["Escape"]);

    // The second alone, as the look says.
    let alone = |window: &mut Window| {
        window.press("CheckBox", "Show courtyard");
        window.wait("settled", |event| points(event) == 5_000);
        let picture = read(&window.picture());
        window.press("CheckBox", "Show courtyard");
        window.wait("settled", |event| points(event) == 25_000);
        picture
    };
    let second_before = alone(&mut window);

    // Colours: the picture is another, and with the same colour for all of them another again.
    let by_colour = window.picture();
    window.choose("Colour of courtyard", "elevation");
    window.settled();
    let of_one = window.picture();
    let similarity = ssim(&second_before, &alone(&mut window)).expect("the same size");
    assert!(similarity > 0.999, "the second has kept its colours: SSIM {similarity}");
    window.choose("Colour of second", "elevation");
    window.settled();
    let of_both = window.picture();
    let [by_colour, of_one, of_both] = [by_colour, of_one, of_both].map(|file| read(&file));
    for (a, b) in [(&by_colour, &of_one), (&of_one, &of_both)] {
        let similarity = ssim(a, b).expect("the same size");
        assert!(similarity < 0.999, "SSIM {similarity}");
    }

    // Visibility, and closing.
    window.press("CheckBox", "Show courtyard");
    window.wait("settled", |event| points(event) == 5_000);
    window.press("CheckBox", "Show courtyard");
    window.wait("settled", |event| points(event) == 25_000);
    window.press("Button", "More of courtyard");
    window.press("Button", "Close");
    window.wait("settled", |event| points(event) == 5_000);
    window.miss("CheckBox", "Show courtyard");
    window.close();
}

#[test]
fn a_dataset_that_is_replaced_is_shown_anew() {
    if is_without_gpu() {
        return;
    }
    let mut world = World::of("sim:courtyard?points=300k&seed=3");
    let screen = Screen::new(900, 700);
    let (source, folder) = (world.source(), world.file("out"));
    let mut arguments = vec![source.as_str(), "--settings", "-", "--folder", &folder];
    arguments.extend(["--size", "900x700"]);
    arguments.extend(LOOK.iter().chain(&BUDGET));
    let mut window = Window::open(&screen, PROGRAM, &arguments);
    window.wait("opened", |event| event["version"] == 0 && event["points"] == 300_000);
    window.settled();

    world.add("sim:courtyard?points=200k&seed=9", "courtyard");
    // By another colour and one more: intensities, which were not loaded before and are not there any more.
    window.keys(&["n", "n"]);
    window.wait("message", |event| {
        event["warning"] == false && event["text"] == "courtyard has changed; this is the new one"
    });
    window.wait_from("opened", |event| event["version"] == 1 && event["points"] == 200_000);
    window.settled();
    // As one who comes now sees it.
    let picture = window.picture();
    compare(&world, &picture, &[&LOOK[..], &BUDGET, &["--color", "intensity"]].concat());
    window.close();
}
