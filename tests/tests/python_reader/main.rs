//! A second reader, written in Python from FORMAT.md alone, decodes datasets to the same elements
//! as ours: the document says all that there is to know.

mod handmade;
mod python;
mod summary;

use std::{path::Path, sync::Arc};

use lodestream_preprocess::{BuildConfig, Method, Progress};
use lodestream_protocol::Dataset;
use summary::Summary;

struct Quiet;

impl Progress for Quiet {
    fn phase(&self, _: &str, _: u64, _: &str) {}
    fn advance(&self, _: u64) {}
    fn warn(&self, _: &str) {}
}

/// Builds a dataset and gives its bytes.
fn build(input: &str, grid: u32) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let output = folder.path().join("built.lods");
    let config = BuildConfig {
        inputs: vec![input.to_owned()],
        output: output.clone(),
        method: Method::Poisson,
        grid,
        memory_bytes: 1 << 30,
        threads: None,
        drop_attributes: Vec::new(),
        columns: None,
        scale: None,
        cells_per_spacing: lodestream_preprocess::CELLS_PER_SPACING,
        cancel: Arc::default(),
    };
    lodestream_preprocess::build(&config, &Quiet).expect("a dataset");
    std::fs::read(output).expect("the dataset")
}

fn fixture(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name);
    path.to_str().expect("a path of text").to_owned()
}

/// Both readers' summaries, Python's first.
fn both(bytes: &[u8]) -> (Summary, Summary) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("some.lods");
    std::fs::write(&path, bytes).expect("space");
    let printed = python::read_lods(&path, &["--json"]).expect("a dataset that Python can read");
    let theirs = serde_json::from_str(&printed).expect("a summary");
    let ours = Summary::of(&Dataset::open(bytes.to_vec()).expect("a dataset")).expect("sound");
    (theirs, ours)
}

#[test]
fn a_scan_in_several_pages_is_read_alike() {
    // So small a grid makes more nodes than one hierarchy page holds.
    let bytes = build("sim:courtyard?points=60k&seed=2", 4);
    let dataset = Dataset::open(bytes.clone()).expect("a dataset");
    assert!((dataset.boot().root_page.nodes.len() as u64) < dataset.manifest().nodes);
    let (theirs, ours) = both(&bytes);
    assert_eq!(theirs, ours);
}

#[test]
fn every_attribute_of_a_real_scan_is_read_alike() {
    for name in ["las/extrabytes.laz", "las/autzen.las"] {
        let (theirs, ours) = both(&build(&fixture(name), 16));
        assert_eq!(theirs, ours, "{name}");
        assert!(ours.attributes.len() > 8, "{name}: {:?}", ours.attributes);
    }
}

#[test]
fn all_types_encodings_and_primitives_are_read_alike() {
    for dataset in handmade::all() {
        let (theirs, ours) = both(&dataset.bytes);
        assert_eq!(theirs, ours, "{}", dataset.name);
    }
}

#[test]
fn the_table_that_it_writes_holds_every_point() {
    let bytes = build(&fixture("las/extrabytes.laz"), 16);
    let folder = tempfile::tempdir().expect("a folder");
    let (path, table) = (folder.path().join("some.lods"), folder.path().join("some.csv"));
    std::fs::write(&path, &bytes).expect("space");
    python::read_lods(&path, &["--csv", table.to_str().expect("text")]).expect("a table");

    let table = std::fs::read_to_string(table).expect("a table");
    let mut lines = table.lines();
    assert!(lines.next().is_some_and(|names| names.starts_with("x,y,z,")));
    let number = |field: &str| field.parse::<f64>().expect("a number").to_bits();
    let mut theirs: Vec<Vec<u64>> =
        lines.map(|line| line.split(',').map(number).collect()).collect();
    let mut ours = summary::rows(&Dataset::open(bytes).expect("a dataset")).expect("sound");
    theirs.sort_unstable();
    ours.sort_unstable();
    assert_eq!(theirs, ours);
}

#[test]
fn it_refuses_a_dataset_with_one_wrong_bit() {
    let mut bytes = build(&fixture("las/extrabytes.laz"), 16);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("some.lods");
    let last = bytes.len() - 1;
    // In the header, in the manifest, in the last payload.
    for at in [17, 200, last] {
        bytes[at] ^= 4;
        std::fs::write(&path, &bytes).expect("space");
        let message = python::read_lods(&path, &[]).expect_err("refused");
        assert!(message.contains("damaged"), "byte {at}: {message}");
        bytes[at] ^= 4;
    }
}
