//! Passes and batches of the truth.

use super::*;
use crate::{
    metrics::PictureError,
    render::{ColorMode, TruthRenderer, testing::landscape},
};

fn truth(scene: &TestScene, settings: &RenderSettings, samples: u32) -> TruthRenderer {
    TruthRenderer::new(settings, &scene.clouds, scene.scene().tree(), samples).expect("possible")
}

fn add_all(truth: &mut TruthRenderer, scene: &TestScene) {
    for node in &scene.nodes {
        truth.add_node(node.clone()).expect("a node of the scene");
    }
}

fn world() -> (TestScene, RenderSettings) {
    let lattice =
        Lattice { scale: 1.0 / 4096.0, offset: [-8.0, 1.0, -4.0], origin: [0; 3], side_bits: 16 };
    let scene = cloud(lattice, 3, &landscape(16, 30_000));
    (scene, RenderSettings { splat_size: SplatSize::World(0.2), ..perspective([96, 64]) })
}

#[test]
fn every_splat_is_drawn_alike_in_one_batch_and_in_many() {
    let (scene, settings) = world();
    // 30,000 points many times over: more than are gathered. Equal splats weigh alike.
    let many = TestScene {
        nodes: (0..80).flat_map(|_| scene.nodes.iter().cloned()).collect(),
        clouds: scene.clouds.clone(),
    };
    for splat in [Splat::Circle, Splat::Cone, Splat::Disc, Splat::Blended] {
        let settings = RenderSettings { splat, ..settings };
        let mut truth = truth(&many, &settings, 1);
        for pass in 0..truth.passes() {
            if pass > 0 {
                truth.next_pass().expect("a further pass");
            }
            add_all(&mut truth, &many);
        }
        let frame = truth.finish().expect("complete");
        assert_eq!(frame.statistics.points, 80 * 30_000);
        assert!(frame.picture == render(&scene, &settings).picture, "{splat:?}");
    }
}

#[test]
fn every_splat_has_the_passes_that_it_needs() {
    let (scene, settings) = world();
    for (splat, _) in Splat::ALL {
        let passes = truth(&scene, &RenderSettings { splat, ..settings }, 2).passes();
        assert_eq!(passes, if splat.is_blended() { 2 } else { 1 }, "{splat:?}");
        let density = RenderSettings { splat, color: ColorMode::Density, ..settings };
        assert_eq!(truth(&scene, &density, 2).passes(), 1);
    }
}

#[test]
fn a_pass_too_few_or_too_many_and_other_points_are_refused() {
    let (scene, settings) = world();
    let blended = RenderSettings { splat: Splat::Blended, ..settings };
    let begun = |settings| {
        let mut truth = truth(&scene, settings, 1);
        add_all(&mut truth, &scene);
        truth
    };
    let error = begun(&blended).finish().expect_err("a pass is missing").to_string();
    assert!(error.contains("2 passes") && error.contains("[30000]"), "{error}");
    assert!(begun(&settings).next_pass().is_err());
    let mut other = begun(&blended);
    other.next_pass().expect("a second pass");
    other.add_node(scene.nodes[0].clone()).expect("a node of the scene");
    assert!(other.next_pass().is_err());
    let error = other.finish().expect_err("fewer points").to_string();
    assert!(error.contains("[30000, "), "{error}");
}

#[test]
fn blended_truth_is_the_blended_picture_better_sampled() {
    let (scene, settings) = world();
    let settings = RenderSettings { splat: Splat::Blended, ..settings };
    let mut sampled = truth(&scene, &settings, 3);
    add_all(&mut sampled, &scene);
    sampled.next_pass().expect("a second pass");
    add_all(&mut sampled, &scene);
    let sampled = sampled.finish().expect("complete").picture;
    let picture = render(&scene, &settings).picture;
    let similarity = crate::metrics::ssim(&sampled, &picture).expect("same size");
    assert!(similarity > 0.85 && similarity < 1.0, "{similarity}");
}

#[test]
fn a_pixel_is_as_far_as_the_median_of_its_samples() {
    // The nearer point covers a column of samples of the pixel at the left, three of the middle one;
    // or two and two.
    for (left, depths) in [(-0.2, [f32::INFINITY, 10.0, 12.0]), (-0.5, [10.0, 10.0, 12.0])] {
        let surfels = [Surfel::at(left, 0.0, 10.0), Surfel::at(0.6, 0.0, 12.0)];
        let scene = scene(&surfels, &[]);
        let mut truth = truth(&scene, &with(Splat::Point, 1.0, orthographic([5, 5])), 4);
        add_all(&mut truth, &scene);
        let picture = truth.finish().expect("complete").picture;
        assert_eq!([1, 2, 3].map(|column| depth_at(&picture, column, 2)), depths, "{left}");
        assert_ne!(color_at(&picture, 1, 2), BACKGROUND, "colours are of all samples");
    }
}

#[test]
fn a_seed_moves_the_samples_by_less_than_one() {
    let surfel = Surfel::at(0.4, 0.3, 10.0);
    let scene = scene(&[surfel], &[]);
    let settings = with(Splat::Square, 4.0, orthographic([9, 9]));
    let picture = |jitter: Option<u64>| {
        let truth = truth(&scene, &settings, 4);
        let mut truth = jitter.into_iter().fold(truth, TruthRenderer::jittered);
        add_all(&mut truth, &scene);
        truth.finish().expect("complete").picture
    };
    let still = picture(None);
    let all: Vec<_> = (0..64).map(|seed| picture(Some(seed))).collect();
    assert_eq!(all[7], picture(Some(7)), "the same seed, the same picture");
    assert!(all.iter().any(|jittered| *jittered != all[0]), "another seed, another picture");
    // 4 by 4 pixels, whatever the seed.
    let [ink, paper] = [30, BACKGROUND[2]].map(f64::from);
    for jittered in all.iter().chain([&still]) {
        let shares =
            jittered.rgba8.chunks_exact(4).map(|p| (f64::from(p[2]) - paper) / (ink - paper));
        let area: f64 = shares.sum();
        assert!((area - 16.0).abs() < 0.5, "{area}");
    }
}

#[test]
fn truths_of_two_seeds_are_farther_apart_than_either_is_from_a_better_one() {
    let (scene, settings) = world();
    let picture = |samples, seed: Option<u64>| {
        let mut truth =
            seed.into_iter().fold(truth(&scene, &settings, samples), TruthRenderer::jittered);
        add_all(&mut truth, &scene);
        truth.finish().expect("complete").picture
    };
    let error = |a: &Picture, b: &Picture| PictureError::between(a, b).expect("of one size");
    let better = picture(16, None);
    let truths: Vec<_> = (0..4).map(|seed| picture(4, Some(seed))).collect();
    for pair in truths.windows(2) {
        let floor = error(&pair[0], &pair[1]);
        let from_better = error(&pair[0], &better);
        assert!(floor.mse > from_better.mse, "{floor:?} {from_better:?}");
        assert!(floor.ssim < from_better.ssim, "{floor:?} {from_better:?}");
        // What the truth is to be better than: a picture of one sample.
        let rough = error(&picture(1, None), &better);
        assert!(rough.mse > Some(4.0 * floor.mse.expect("pixels")), "{floor:?} {rough:?}");
        // Only at rims is a pixel covered by one and not by the other.
        let holes = floor.coverage.holes.of_covered.expect("covered");
        assert!(holes < 0.03, "{floor:?}");
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let (scene, settings) = world();
    for splat in [Splat::Circle, Splat::Blended] {
        let settings = RenderSettings { splat, ..settings };
        let draw = || {
            let mut truth = truth(&scene, &settings, 4).jittered(3);
            for pass in 0..truth.passes() {
                if pass > 0 {
                    truth.next_pass().expect("a further pass");
                }
                add_all(&mut truth, &scene);
            }
            truth.finish().expect("complete")
        };
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads").install(draw)
        };
        assert!(with(1) == with(5), "{splat:?}");
    }
}
