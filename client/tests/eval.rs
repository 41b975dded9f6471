//! `lodestream eval`: the real binary, from an input to reports, and two reports side by side.

#[path = "common/world.rs"]
mod world;

use std::{
    path::Path,
    process::{Command, Output},
};

use lodestream_client::{
    engine::Policy,
    eval::{BuildRow, Report, SavingRow, StreamRun, SubjectReport},
};

use world::World;

fn eval(args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lodestream"));
    command.arg("eval").args(args).output().expect("the binary runs")
}

/// Evaluates and expects success.
fn evaluated(args: &[&str]) {
    let output = eval(args);
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// Expects this exit code and one line that says why.
fn refused(args: &[&str], code: i32) -> String {
    let output = eval(args);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {said}");
    assert_eq!(said.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{said}");
    said
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn report(folder: &Path) -> Report {
    serde_json::from_str(&read(&folder.join("eval.json"))).expect("a report")
}

/// The report without what hangs on the machine's clock and memory.
fn repeatable(mut report: Report) -> String {
    report.command.clear();
    for subject in &mut report.subjects {
        subject.build = None;
        for row in &mut subject.frames {
            (row.ms, row.ms_spread, row.on_front) = (0.0, 0.0, false);
        }
        for cost in subject.left_out.iter_mut().flat_map(|row| [&mut row.with, &mut row.without]) {
            (cost.decode_ms, cost.draw_ms) = (0.0, 0.0);
        }
    }
    report.json()
}

const SMALL: &str = "sim:courtyard?points=60k&seed=3";

#[test]
fn a_report_is_written_and_repeats_to_the_last_digit() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let folders = ["first", "second"].map(|name| folder.path().join(name));
    let options =
        ["--quick", "--sizes", "near,far", "--budgets", "5000,100000", "--paths", "orbit"];
    for output in &folders {
        let output = output.display().to_string();
        evaluated(&[&[SMALL, "-o", &output], &options[..]].concat());
    }
    let [first, second] = folders.each_ref().map(|folder| report(folder));
    assert_eq!(first.json(), read(&folders[0].join("eval.json")), "nothing is lost by reading");
    assert_eq!(repeatable(first.clone()), repeatable(second));

    let subject = &first.subjects[0];
    assert_eq!((subject.name.as_str(), subject.points), ("courtyard", 60_000));
    let build = subject.build.as_ref().expect("it was built");
    assert_eq!((build.points_in, build.points_out), (60_000, 60_000));
    assert_eq!(subject.frames.len(), 2 * 2 * 4, "views, budgets, ways");
    for run in &subject.streams {
        let settled = run.settled_ms.expect("settled");
        assert!(settled + 1.0 >= run.bound_ms, "{run:?}");
        assert!(run.samples.iter().all(|sample| (0.0..=1.0).contains(&sample.holes)));
    }
    assert!(subject.streams.iter().any(|run| run.from == "near"), "a jump");
    heavier_nodes_come_later(subject);

    let html = read(&folders[0].join("eval.html"));
    // Without the pictures, whose letters are any.
    let parts = html.split("data:image/png;base64,");
    let html: String = parts
        .enumerate()
        .map(|(i, p)| if i == 0 { p } else { &p[p.find('"').unwrap_or(0)..] })
        .collect();
    for wrong in ["NaN", "http:", "https:", "<script", "url("] {
        assert!(!html.contains(wrong), "{wrong}");
    }
    for (name, text) in first.tables() {
        assert_eq!(read(&folders[0].join(name)), text, "{name}");
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let header = reader.headers().expect("a header").iter().collect::<Vec<_>>().join("`, `");
        let document = include_str!("../../docs/EVALUATION.md");
        assert!(document.contains(&format!("`{header}`")), "{name}: `{header}` is documented");
        assert!(reader.records().all(|line| line.is_ok()) && !text.contains("NaN"), "{name}");
    }
    compares(&folders[0], &first);
}

/// Potree's way with the bytes of its own encoding asks for the same nodes, and waits for what they weigh.
fn heavier_nodes_come_later(subject: &SubjectReport) {
    let all = subject.potree_bytes.expect("weighed");
    let mut seen = 0;
    for race in subject.races() {
        let of = |policy| race.runs.iter().find(|e| e.run.policy == policy).map(|e| e.run);
        let (light, heavy) = (of(Policy::Potree), of(Policy::PotreeBrotli));
        let (light, heavy) = (light.expect("a run"), heavy.expect("a run"));
        let drawn = |run: &StreamRun| (run.requests, run.points, run.ssim.to_bits());
        assert_eq!(drawn(light), drawn(heavy), "{}", race.view);
        if light.bytes == 0 {
            continue;
        }
        assert!(heavy.bytes > light.bytes && heavy.bytes < all + 100_000, "{heavy:?}");
        assert!(heavy.bound_ms > light.bound_ms, "{heavy:?}");
        assert!(heavy.settled_ms >= light.settled_ms, "{heavy:?}");
        seen += 1;
    }
    assert!(seen > 1, "races in which something came");
}

fn build(report: &mut Report) -> &mut BuildRow {
    report.subjects[0].build.as_mut().expect("it was built")
}

fn saving(report: &mut Report) -> &mut SavingRow {
    &mut report.subjects[0].left_out[0]
}

/// A report against itself, and against worse ones.
fn compares(folder: &Path, report: &Report) {
    let before = folder.join("eval.json").display().to_string();
    let against = |change: &dyn Fn(&mut Report)| {
        let mut changed = report.clone();
        change(&mut changed);
        let path = folder.join("changed.json");
        std::fs::write(&path, changed.json()).expect("written");
        let output = eval(&["--compare", &before, &path.display().to_string()]);
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        (output.status.code(), said + &String::from_utf8_lossy(&output.stderr))
    };
    let (code, said) = against(&|_| {});
    assert_eq!((code, said.lines().count()), (Some(0), 1), "{said}");
    assert!(said.starts_with("0 worse or gone, 0 different"), "{said}");

    type Worse<'a> = (&'a str, &'a dyn Fn(&mut Report));
    let worse: [Worse; 18] = [
        ("near point 1px 5000 ssim", &|r| {
            r.subjects[0].frames[0].error.ssim =
                r.subjects[0].frames[0].error.ssim.map(|s| s - 0.01);
        }),
        ("ours bytes", &|r| r.subjects[0].streams[0].bytes *= 2),
        ("ours settled_ms", &|r| r.subjects[0].streams[0].settled_ms = None),
        ("ours area", &|r| r.subjects[0].streams[0].samples.iter_mut().for_each(|s| s.ssim -= 0.1)),
        ("near point 1px 5000", &|r| drop(r.subjects[0].frames.remove(0))),
        ("courtyard file bytes", &|r| r.subjects[0].bytes += r.subjects[0].bytes / 50),
        ("build points lost", &|r| build(r).points_out -= 1),
        ("build seconds", &|r| build(r).seconds *= 10.0),
        ("build by poisson", &|r| r.subjects[0].build = None),
        ("orbit by 20mbit/40ms ours mean_ssim", &|r| r.subjects[0].paths[0].mean_ssim -= 0.01),
        ("ours worst_ssim", &|r| r.subjects[0].paths[0].worst_ssim -= 0.01),
        ("ours popping_rms", &|r| {
            r.subjects[0].paths[0].popping_rms =
                r.subjects[0].paths[0].popping_rms.map(|p| 2.0 * p);
        }),
        ("load_ms", &|r| saving(r).with.load_ms *= 2.0),
        ("build peak_bytes", &|r| build(r).peak_bytes = build(r).peak_bytes.map(|b| 2 * b)),
        ("orbit by 20mbit/40ms potree", &|r| {
            r.subjects[0].paths.retain(|run| run.policy != Policy::Potree);
        }),
        ("near without behind what is drawn", &|r| saving(r).with.bytes *= 2),
        ("GONE  courtyard near without behind", &|r| drop(r.subjects[0].left_out.remove(0))),
        ("shader bytes", &|r| r.subjects[0].not_stored.shader_bytes[0] *= 2),
    ];
    for (what, change) in worse {
        let (code, said) = against(change);
        assert_eq!(code, Some(1), "{what}: {said}");
        let told = said.lines().filter(|l| l.starts_with("WORSE") || l.starts_with("GONE"));
        assert!(
            told.clone().count() >= 1 && told.clone().any(|l| l.contains(what)),
            "{what}: {said}"
        );
    }
    let (code, said) = against(&|r| r.subjects[0].streams[0].bytes /= 2);
    assert_eq!(code, Some(0), "fewer bytes are no loss: {said}");
    let (code, said) = against(&|r| {
        build(r).seconds *= 10.0;
        r.machine.push_str(", another");
    });
    assert_eq!(code, Some(0), "another machine takes other times: {said}");
    let (code, said) = against(&|r| r.seed += 1);
    assert!(code == Some(1) && said.contains("evaluate both alike"), "{said}");
}

#[test]
fn a_hosted_dataset_is_evaluated_as_its_file_is() {
    let mut world = World::new();
    let narrow =
        ["--quick", "--sizes", "medium", "--budgets", "1000", "--splats", "circle:2px", "-o"];
    let [hosted, local] = ["hosted", "local"].map(|name| world.file(name));
    evaluated(&[&[&*world.source()], &narrow[..], &[&hosted]].concat());
    evaluated(&[&[&*world.file("courtyard.lods")], &narrow[..], &[&local]].concat());
    let [hosted, local] = [hosted, local].map(|folder| report(Path::new(&folder)));
    assert_eq!(hosted.subjects[0].name, "courtyard");
    assert_eq!(repeatable(hosted), repeatable(local));

    let absent = world.source().replace("courtyard", "absent");
    assert!(refused(&[&absent, "-o", &world.file("out")], 1).contains("absent"));
    assert!(refused(&["http://", "-o", &world.file("out")], 1).contains("not a URL"));
    world.stop_server();
    let dead = refused(&[&world.source(), "-o", &world.file("out")], 1);
    assert!(dead.contains("courtyard"), "{dead}");
}

#[test]
fn a_bare_cloud_does_without_what_it_does_not_have() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut text = String::new();
    for index in 0..5000_u32 {
        let (x, y) = (f64::from(index % 100) * 0.1, f64::from(index / 100) * 0.1);
        text += &format!("{x:.1} {y:.1} {:.1}\n", (x * 0.7).sin() + (y * 0.9).cos());
    }
    let bare = folder.path().join("bare.xyz");
    std::fs::write(&bare, text).expect("written");
    let output = folder.path().join("out");
    let paths = [&bare, &output].map(|path| path.display().to_string());
    let narrow = ["--quick", "--sizes", "medium", "--budgets", "1000", "--splats", "circle:2px"];
    evaluated(&[&[SMALL, &*paths[0], "-o", &*paths[1]], &narrow[..]].concat());
    let report = report(&output);
    let [coloured, bare] = report.subjects.as_slice() else { panic!("two datasets") };
    let shader = |subject: &SubjectReport| subject.not_stored.shader_bytes;
    for subject in [bare, coloured] {
        assert!(shader(subject)[0] < shader(subject)[1], "{:?}", shader(subject));
    }
    assert!(!coloured.not_stored.not_fetched.is_empty(), "intensities are not shown");
    assert!(coloured.not_stored.not_fetched.iter().all(|(_, bytes)| *bytes > 0));
    // There is nothing but positions: asking for all attributes brings not a byte more.
    assert_eq!(bare.not_stored.not_fetched, []);
    let attributes = |subject: &SubjectReport| {
        let row = subject.left_out.iter().find(|row| row.saving.starts_with("attributes"));
        row.map(|row| (row.with.bytes, row.without.bytes)).expect("a row")
    };
    let (with, without) = attributes(bare);
    assert_eq!(with, without);
    let (with, without) = attributes(coloured);
    assert!(with < without, "{with} {without}");
}

#[test]
fn a_cloud_of_which_everything_has_come_is_its_truth_whatever_it_is_coloured_by() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut text = String::from("x y z intensity\n");
    for index in 0..4000_u32 {
        let (x, y) = (f64::from(index % 80) * 0.1, f64::from(index / 80) * 0.1);
        text += &format!("{x:.1} {y:.1} {:.1} {}\n", (x * 0.7).sin(), (index * 37) % 251);
    }
    let input = folder.path().join("grey.xyz");
    std::fs::write(&input, text).expect("written");
    let output = folder.path().join("out");
    let paths = [&input, &output].map(|path| path.display().to_string());
    let options = ["--quick", "--sizes", "medium", "--budgets", "9000", "--splats", "circle:2px"];
    evaluated(&[&[&*paths[0], "-o", &*paths[1]], &options[..]].concat());
    let report = report(&output);
    let [subject] = report.subjects.as_slice() else { panic!("one dataset") };
    let whole = subject.streams.iter().filter(|run| run.points == subject.points);
    let similar: Vec<_> = whole.map(|run| run.ssim).collect();
    assert!(!similar.is_empty() && similar.iter().all(|ssim| *ssim == 1.0), "{similar:?}");
}

#[test]
fn wrong_inputs_are_refused_in_one_line() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("written");
        path.display().to_string()
    };
    let output = folder.path().join("out").display().to_string();
    let to = ["-o", &*output];
    let refused = |args: &[&str], code| refused(&[args, &to[..]].concat(), code);
    let missing = folder.path().join("missing.lods").display().to_string();
    assert!(refused(&[&missing], 1).contains("missing.lods"));
    assert!(refused(&["no-such.las"], 1).contains("no-such.las"));
    let text = file("text.lods", "not a dataset, but a text that is long enough to be one\n");
    assert!(refused(&[&text], 1).contains("text.lods"));
    // The good one is not evaluated first.
    assert!(!refused(&[SMALL, &missing], 1).contains("truth"));
    let empty = file("empty.xyz", "");
    assert!(refused(&[&empty], 1).contains("empty"));
    assert!(refused(&[SMALL, "--budgets", "0"], 1).contains("budget of 0"));
    assert!(refused(&[SMALL, "--stream-budget", "0"], 1).contains("budget of 0"));
    assert!(refused(&[SMALL, "--links", "20"], 2).contains("20mbit/40ms"));
    assert!(
        refused(&[SMALL, "--policies", "best"], 2)
            .contains("ours, potree, fraiss and potree-brotli")
    );
    assert!(refused(&[SMALL, "--splats", "star:1px"], 2).contains("star"));
    assert!(self::refused(&[SMALL, "-o", &text], 1).contains("cannot create"));
    for other in [file("other.json", "{}"), text.clone(), missing] {
        let said = self::refused(&["--compare", &other, &other], 1);
        assert!(said.contains(&other), "{said}");
    }
    assert_eq!(eval(&["--compare", &text]).status.code(), Some(2));
}
