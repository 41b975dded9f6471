//! Previews of small scans.

use super::*;
use crate::{BuildConfig, Method, build};
use std::sync::Arc;

struct Quiet;

impl crate::Progress for Quiet {
    fn phase(&self, _: &str, _: u64, _: &str) {}
    fn advance(&self, _: u64) {}
    fn warn(&self, _: &str) {}
}

fn built(folder: &Path, input: &str) -> PathBuf {
    let output = folder.join("a.lods");
    let config = BuildConfig {
        inputs: vec![input.to_owned()],
        output: output.clone(),
        method: Method::Poisson,
        grid: 64,
        memory_bytes: 1 << 28,
        threads: Some(1),
        drop_attributes: vec![],
        columns: None,
        scale: None,
        cells_per_spacing: crate::CELLS_PER_SPACING,
        cancel: Arc::default(),
    };
    build(&config, &Quiet).expect("built");
    output
}

fn decode(picture: &[u8]) -> Vec<u8> {
    let mut reader = png::Decoder::new(Cursor::new(picture)).read_info().expect("a PNG");
    let mut pixels = vec![0; reader.output_buffer_size().expect("small")];
    reader.next_frame(&mut pixels).expect("a picture");
    pixels
}

#[test]
fn a_preview_shows_its_dataset_and_names_it() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let dataset = built(folder.path(), "sim:courtyard?points=60k&seed=1");
    let path = write_preview(&dataset).expect("drawn").expect("points");
    assert_eq!(path, folder.path().join("a.preview.png"));
    let picture = std::fs::read(&path).expect("written");
    assert!(picture.len() < MAX_PREVIEW_BYTES, "{} bytes", picture.len());
    let header = Dataset::open(FileSource::open(&dataset).expect("there")).expect("sound");
    let id = header.boot().header.content_id_hex();
    assert_eq!(preview_content_id(&picture), Some(id));
    let pixels = decode(&picture);
    let covered = pixels.chunks(4).filter(|pixel| pixel[3] > 0).count();
    let share = covered as f64 / f64::from(PREVIEW_SIZE[0] * PREVIEW_SIZE[1]);
    assert!((0.2..0.95).contains(&share), "{share} of the picture is covered");
    let colors: std::collections::HashSet<_> = pixels.chunks(4).map(|pixel| &pixel[..3]).collect();
    assert!(colors.len() > 100, "{} colours", colors.len());
    assert_eq!(draw_preview(&dataset).expect("drawn"), Some(picture), "the same picture again");
}

#[test]
fn points_without_colour_are_shown_by_height() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scan = folder.path().join("scan.xyz");
    let lines: String = (0..100).map(|i| format!("{} {} {}\n", i % 10, i / 10, i % 7)).collect();
    std::fs::write(&scan, lines).expect("written");
    let dataset = built(folder.path(), scan.to_str().expect("a plain path"));
    let picture = draw_preview(&dataset).expect("drawn").expect("points");
    let pixels = decode(&picture);
    let colors: std::collections::HashSet<_> =
        pixels.chunks(4).filter(|pixel| pixel[3] > 0).map(|pixel| &pixel[..3]).collect();
    assert!(colors.len() > 5, "{colors:?}");
}

#[test]
fn what_is_no_preview_of_ours_is_not_taken_for_one() {
    assert_eq!(preview_content_id(b""), None);
    assert_eq!(preview_content_id(b"\x89PNG\r\n\x1a\n"), None);
    let mut foreign = Vec::new();
    let mut encoder = png::Encoder::new(&mut foreign, 1, 1);
    encoder.set_color(png::ColorType::Grayscale);
    encoder
        .write_header()
        .and_then(|mut writer| writer.write_image_data(&[0]))
        .expect("a picture of one pixel");
    assert_eq!(preview_content_id(&foreign), None);
    assert_eq!(preview_content_id(&vec![0; MAX_PREVIEW_BYTES + 1]), None);
}
