//! The metrics against values of scikit-image, recorded by `tests/fixtures/metrics/make.py`.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::{
    MetricsError, PictureError, ssim,
    ssim::{Window, color_mean, luma_map},
    ssim_color,
};
use crate::render::Picture;

const TOLERANCE: f64 = 1e-6;

/// What scikit-image says of two pictures.
#[derive(Debug, Deserialize)]
struct Recorded {
    a: String,
    b: String,
    /// `None` where the pictures are too small.
    ssim_luma: Option<f64>,
    ssim_color: Option<f64>,
    mse: f64,
    /// `None` where the pictures are equal.
    psnr_db: Option<f64>,
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/fixtures/metrics")
}

fn recorded() -> Vec<(Recorded, [Picture; 2])> {
    let text = std::fs::read_to_string(folder().join("values.json")).expect("values.json");
    let all: Vec<Recorded> = serde_json::from_str(&text).expect("values as make.py writes them");
    let picture = |name: &str| Picture::read_png(&folder().join(name)).expect(name);
    let pairs = all.into_iter().map(|recorded| {
        let pictures = [picture(&recorded.a), picture(&recorded.b)];
        (recorded, pictures)
    });
    pairs.collect()
}

#[test]
fn metrics_are_those_of_scikit_image() {
    let pairs = recorded();
    assert!(pairs.len() >= 20, "{} pairs", pairs.len());
    for (expected, [a, b]) in &pairs {
        let error = PictureError::between(a, b).expect("of one size");
        let near = |found: f64, expected: f64| {
            (found - expected).abs() <= TOLERANCE * expected.abs().max(1.0)
        };
        assert_eq!(error.ssim.is_some(), expected.ssim_luma.is_some(), "{expected:?}");
        if let (Some(found), Some(luma)) = (error.ssim, expected.ssim_luma) {
            assert!((found - luma).abs() <= TOLERANCE, "{found}: {expected:?}");
        }
        match (ssim_color(a, b), expected.ssim_color) {
            (Ok(found), Some(color)) => {
                assert!((found - color).abs() <= TOLERANCE, "{found}: {expected:?}");
            }
            (Err(MetricsError::TooSmall(_)), None) => {}
            (other, _) => panic!("{other:?}: {expected:?}"),
        }
        let (mse, psnr) = (error.mse.expect("pixels"), error.psnr_db.expect("pixels"));
        assert!(near(mse, expected.mse), "{mse}: {expected:?}");
        match expected.psnr_db {
            Some(db) => assert!(near(psnr, db), "{psnr}: {expected:?}"),
            None => assert_eq!(psnr, f64::INFINITY, "{expected:?}"),
        }
    }
}

#[test]
fn another_sigma_or_window_would_miss() {
    let pairs = recorded();
    // Flat pictures and equal ones are alike in every window.
    let structured: Vec<_> = pairs
        .iter()
        .filter(|(r, [a, b])| a.rgba8 != b.rgba8 && r.ssim_luma.is_some() && !is_flat(a, b))
        .collect();
    assert!(structured.len() >= 20, "{}", structured.len());
    let windows = [(11, 1.4), (11, 1.6), (10, 1.5), (12, 1.5), (9, 1.5), (13, 1.5)];
    for (size, sigma) in windows {
        let window = Window::gaussian(size, sigma);
        let misses = |found: Result<f64, MetricsError>, expected: Option<f64>| match found {
            Ok(found) => expected.is_none_or(|e| (found - e).abs() > TOLERANCE),
            // No such window fits: that is seen.
            Err(_) => true,
        };
        let in_luma = structured.iter().filter(|(expected, [a, b])| {
            misses(luma_map(a, b, &window).map(|map| map.mean()), expected.ssim_luma)
        });
        let in_color = structured
            .iter()
            .filter(|(expected, [a, b])| misses(color_mean(a, b, &window), expected.ssim_color));
        // A pair in ten may be as alike in another window, by chance.
        for missed in [in_luma.count(), in_color.count()] {
            assert!(10 * missed >= 9 * structured.len(), "{size} {sigma}: {missed}");
        }
    }
    let right = Window::of_wang();
    for (_, [a, b]) in &structured {
        assert_eq!(luma_map(a, b, &right).map(|map| map.mean()), ssim(a, b));
    }
}

fn is_flat(a: &Picture, b: &Picture) -> bool {
    [a, b].iter().all(|p| p.rgba8.chunks_exact(4).all(|pixel| pixel == &p.rgba8[..4]))
}
