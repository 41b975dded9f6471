//! The command line as scripts rely on it: real programs, real files, a real server on a free port.

use std::{
    fs,
    io::{BufRead, BufReader, Read},
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
};

use lodestream_tests::program;

fn lodestream(arguments: &[&str]) -> Output {
    let program = program("lodestream").expect("built beside the tests");
    Command::new(program).args(arguments).output().expect("starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn succeeds(arguments: &[&str]) -> String {
    let output = lodestream(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

/// Runs and expects exit 1 with one line that starts with `error: `.
fn fails(arguments: &[&str]) -> String {
    let output = lodestream(arguments);
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {stderr}");
    let errors: Vec<&str> = stderr.lines().filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(errors.len(), 1, "{arguments:?}: {stderr}");
    assert!(!stderr.contains("panicked"), "{stderr}");
    errors[0].to_owned()
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).display().to_string()
    }

    fn file(&self, name: &str, bytes: &[u8]) -> String {
        fs::write(self.0.path().join(name), bytes).expect("written");
        self.path(name)
    }

    fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(self.0.path()).expect("listed");
        let name = |e: std::io::Result<fs::DirEntry>| e.expect("listed").file_name();
        let mut names: Vec<String> =
            entries.map(|e| name(e).to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
}

/// A program that ends with its guard.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn serve(folder: &str) -> (Running, String) {
    let mut child = Command::new(program("lodestream-server").expect("built"))
        .args(["serve", folder, "--listen", "127.0.0.1:0"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("starts");
    let mut line = String::new();
    let stdout = child.stdout.take().expect("piped");
    BufReader::new(stdout).read_line(&mut line).expect("prints its address");
    let start = line.find("http://").expect("an address");
    (Running(child), line[start..].trim().to_owned())
}

fn fixture(name: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    root.join("fixtures").join(name).display().to_string()
}

const SCAN: &str = "sim:courtyard?points=30k&seed=3";

#[test]
fn what_is_built_is_sound_and_comes_back_from_las_laz_and_ply() {
    let folder = Folder::new();
    let dataset = folder.path("scan.lods");
    let report = folder.path("report.json");
    succeeds(&["build", SCAN, "-o", &dataset, "--report", &report]);
    let report: serde_json::Value =
        serde_json::from_slice(&fs::read(report).expect("written")).expect("JSON");
    assert_eq!(report["points_written"], 30_000);
    succeeds(&["verify", &dataset, "--against", SCAN]);
    for name in ["out.las", "out.laz", "out.ply"] {
        let exported = folder.path(name);
        succeeds(&["export", &dataset, "-o", &exported]);
        let again = folder.path("again.lods");
        succeeds(&["build", &exported, "-o", &again]);
        let described: serde_json::Value =
            serde_json::from_str(&succeeds(&["inspect", &again, "--json"])).expect("JSON");
        assert_eq!(described["points"], 30_000, "{name}");
    }
}

/// What `inspect` tells of a dataset built of an exported file.
fn described(dataset: &str) -> serde_json::Value {
    serde_json::from_str(&succeeds(&["inspect", dataset, "--json"])).expect("JSON")
}

#[test]
fn upper_levels_and_boxes_are_exported_to_the_point() {
    let folder = Folder::new();
    let [dataset, part, again] = ["a.lods", "part.las", "again.lods"].map(|n| folder.path(n));
    succeeds(&["build", SCAN, "-o", &dataset, "--grid", "32"]);
    let whole = described(&dataset);
    let exported = |option: &str, value: &str| {
        succeeds(&["export", &dataset, "-o", &part, option, value]);
        succeeds(&["build", &part, "-o", &again]);
        described(&again)["points"].as_u64().expect("a number")
    };
    let levels = whole["levels"].as_array().expect("a list");
    assert!(levels.len() > 2, "{levels:?}");
    let mut points = 0;
    for (number, level) in levels.iter().enumerate() {
        points += level["points"].as_u64().expect("a number");
        assert_eq!(exported("--level", &number.to_string()), points, "level {number}");
    }
    // Two boxes that share a face between two steps of the lattice have every point once.
    let step = whole["lattice"]["scale"].as_f64().expect("a number");
    let bounds = |corner: &str| -> Vec<f64> {
        let numbers = whole["bounds"][corner].as_array().expect("three numbers").iter();
        numbers.map(|n| n.as_f64().expect("a number")).collect()
    };
    let (min, max) = (bounds("min"), bounds("max"));
    let face = ((min[0] + max[0]) / 2.0 / step).floor() * step + step / 2.0;
    let left = format!("{},{},{},{face},{},{}", min[0] - 1.0, min[1], min[2], max[1], max[2]);
    let right = format!("{face},{},{},{},{},{}", min[1], min[2], max[0] + 1.0, max[1], max[2]);
    let halves = [left, right].map(|bounds| exported("--bounds", &bounds));
    assert!(halves.iter().all(|&points| points > 1000), "{halves:?}");
    assert_eq!(halves[0] + halves[1], 30_000);
}

#[test]
fn real_scans_are_built_and_verified_against_their_files() {
    let folder = Folder::new();
    let dataset = folder.path("scan.lods");
    for name in ["las/autzen.las", "las/autzen.laz", "las/autzen.copc.laz", "las/extrabytes.laz"] {
        succeeds(&["build", &fixture(name), "-o", &dataset, "--threads", "3"]);
        let output = lodestream(&["verify", &dataset, "--against", &fixture(name)]);
        assert!(output.status.success(), "{name}: {}", text(&output.stdout));
        let other = folder.path("other.lods");
        succeeds(&["build", &fixture(name), "-o", &other, "--threads", "1", "--memory", "1MiB"]);
        assert!(fs::read(&dataset).expect("there") == fs::read(&other).expect("there"), "{name}");
    }
}

#[test]
fn bad_input_is_one_line_and_exit_1() {
    let folder = Folder::new();
    let las = fs::read(fixture("las/autzen.las")).expect("a fixture");
    let laz = fs::read(fixture("las/autzen.laz")).expect("a fixture");
    let mut lying = las.clone();
    // The point count of a LAS 1.2 header.
    lying[107..111].copy_from_slice(&u32::MAX.to_le_bytes());
    let ply = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
                property float z\nend_header\n1 2 3\n";
    let cases: [(&str, &[u8], &str); 9] = [
        ("empty.las", b"", "empty"),
        ("cut.las", &las[..las.len() - 100], "cut.las"),
        ("cut.laz", &laz[..laz.len() / 2], "cut.laz"),
        ("header.las", &las[..50], "header.las"),
        ("lying.las", &lying, "4294967295"),
        ("cut.ply", ply, "3"),
        ("nan.xyz", b"nan 1 2\ninf 1 2\n", "unusable"),
        (
            "none.ply",
            b"ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\n\
          property float y\nproperty float z\nend_header\n",
            "no points",
        ),
        ("photo.jpg", b"\xff\xd8\xff\xe0 not a point cloud", "not a point cloud"),
    ];
    for (name, bytes, expected) in cases {
        let input = folder.file(name, bytes);
        let output = folder.path("out.lods");
        let error = fails(&["build", &input, "-o", &output]);
        assert!(error.contains(expected), "{name}: {error}");
        assert!(error.contains(name), "{name} is not named: {error}");
        assert!(!Path::new(&output).exists(), "{name}: an output was left");
    }
    let good = fixture("las/autzen.las");
    fails(&["build", &good, "-o", &folder.path("no/such/folder/out.lods")]);
    fails(&["build", "sim:nowhere?points=1", "-o", &folder.path("out.lods")]);
    fails(&["inspect", &good]);
    fails(&["verify", &folder.path("not-there.lods")]);
}

#[test]
fn one_point_and_a_million_equal_ones_are_clouds() {
    let folder = Folder::new();
    let dataset = folder.path("out.lods");
    for (name, points) in [("one.xyz", 1), ("same.xyz", 1_000_000)] {
        let input = folder.file(name, "1.5 2.5 3.5\n".repeat(points).as_bytes());
        succeeds(&["build", &input, "-o", &dataset]);
        succeeds(&["verify", &dataset, "--against", &input]);
    }
}

#[test]
fn bad_usage_is_exit_2() {
    for arguments in [
        &["build"][..],
        &["build", "a.las", "-o", "a.txt"],
        &["build", "a.las", "-o", "a.lods", "--grid", "100"],
        &["shot", "a.lods", "-o", "a.png", "--splat", "blob"],
        &["export", "a.lods", "-o", "a.las", "--bounds", "1,2,3"],
        &["nonsense"],
    ] {
        assert_eq!(lodestream(arguments).status.code(), Some(2), "{arguments:?}");
    }
}

#[test]
fn a_picture_over_http_is_the_picture_of_the_file() {
    let folder = Folder::new();
    let dataset = folder.path("scan.lods");
    succeeds(&["build", SCAN, "-o", &dataset]);
    let (server, address) = serve(&folder.path(""));
    let url = format!("{address}/datasets/scan.lods");
    let mut pictures = Vec::new();
    for (name, source) in [("file.png", &dataset), ("http.png", &url)] {
        let picture = folder.path(name);
        let size = ["--size", "320x200", "--renderer", "cpu"];
        let mut arguments = vec!["shot", source, "-o", &picture];
        arguments.extend(size);
        succeeds(&arguments);
        pictures.push(fs::read(picture).expect("drawn"));
    }
    assert!(pictures[0] == pictures[1], "the pictures differ");
    let described = succeeds(&["inspect", &url, "--json"]);
    let described: serde_json::Value = serde_json::from_str(&described).expect("JSON");
    assert_eq!(described["points"], 30_000);
    let exported = folder.path("out.ply");
    succeeds(&["export", &url, "-o", &exported, "--level", "0"]);
    assert!(fs::metadata(exported).expect("written").len() > 0);
    drop(server);
    fails(&["inspect", &url]);
}

/// Starts a long build and hands it over once it has read its input.
fn build_under_way(output: &str) -> (Child, BufReader<impl Read + use<>>) {
    let mut child = Command::new(program("lodestream").expect("built"))
        .args(["build", "sim:courtyard?points=400k&seed=1", "-o", output])
        .stderr(Stdio::piped())
        .spawn()
        .expect("starts");
    let mut stderr = BufReader::new(child.stderr.take().expect("piped"));
    let mut line = String::new();
    while !line.starts_with("read") {
        line.clear();
        assert!(stderr.read_line(&mut line).expect("told") > 0, "ended before it had read");
    }
    (child, stderr)
}

#[test]
fn a_killed_build_leaves_nothing_that_looks_whole() {
    let folder = Folder::new();
    let output = folder.path("out.lods");
    let (mut child, _stderr) = build_under_way(&output);
    child.kill().expect("killed");
    child.wait().expect("ended");
    let whole: Vec<String> = folder.names().into_iter().filter(|n| n.ends_with(".lods")).collect();
    assert!(whole.is_empty(), "{whole:?}");
}

#[cfg(unix)]
#[test]
fn an_interrupted_build_says_so_and_cleans_up() {
    let folder = Folder::new();
    let output = folder.path("out.lods");
    let (mut child, mut stderr) = build_under_way(&output);
    let interrupted = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(interrupted.expect("kill runs").success());
    let mut rest = String::new();
    stderr.read_to_string(&mut rest).expect("told");
    assert_eq!(child.wait().expect("ended").code(), Some(1), "{rest}");
    assert!(rest.contains("error: interrupted"), "{rest}");
    assert_eq!(folder.names(), Vec::<String>::new());
}

/// Runs with files of at most `blocks` times 512 bytes: to a program the same as a disk that fills up,
/// but no administrator is needed to set it up.
#[cfg(unix)]
fn with_small_files(blocks: u32, arguments: &[&str]) -> Output {
    let program = program("lodestream").expect("built beside the tests");
    Command::new("sh")
        .args(["-c", "trap '' XFSZ; ulimit -f \"$0\"; exec \"$@\"", &blocks.to_string()])
        .arg(program)
        .args(arguments)
        .output()
        .expect("starts")
}

#[cfg(unix)]
#[test]
fn a_disk_that_fills_up_is_one_line_and_leaves_nothing() {
    let folder = Folder::new();
    let [scan, dataset] = ["scan.las", "scan.lods"].map(|name| folder.path(name));
    succeeds(&["build", SCAN, "-o", &dataset]);
    succeeds(&["export", &dataset, "-o", &scan]);
    let whole = fs::read(&dataset).expect("built");
    fs::remove_file(&dataset).expect("there");
    let bytes = whole.len() as u64;
    let before = folder.names();

    // The dataset itself; the points on their way, which take more.
    let build = ["build", &scan, "-o", &dataset];
    let spilled = [&build[..], &["--memory", "1MiB"]].concat();
    for (arguments, bytes, expected) in [
        (&build[..], bytes - 1000, "scan.lods: cannot write: "),
        (&spilled, bytes / 2, "cannot write a temporary file: "),
    ] {
        let blocks = u32::try_from(bytes / 512).expect("small");
        let output = with_small_files(blocks, arguments);
        let stderr = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{stderr}");
        let errors: Vec<&str> = stderr.lines().filter(|l| l.starts_with("error: ")).collect();
        assert!(errors.len() == 1 && errors[0].contains(expected), "{stderr}");
        assert_eq!(folder.names(), before);
    }
    // What was there before stays as it was.
    fs::write(&dataset, &whole).expect("writable");
    let output = with_small_files(100, &build);
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    assert!(fs::read(&dataset).expect("there") == whole);
}

#[test]
fn the_demo_writes_pictures_and_a_page() {
    let folder = Folder::new();
    let out = PathBuf::from(folder.path("demo"));
    let said = succeeds(&["demo", &fixture("las/autzen.las"), "-o", &out.display().to_string()]);
    assert!(said.contains("index.html"), "{said}");
    let page = fs::read_to_string(out.join("index.html")).expect("written");
    for name in ["overview.png", "near.png"] {
        assert!(page.contains(name) && out.join(name).is_file(), "{name}");
    }
}
