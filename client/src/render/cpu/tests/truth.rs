//! Passes and batches of the truth.

use super::*;
use crate::render::{ColorMode, TruthRenderer, testing::landscape};

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
    let similarity = crate::render::ssim(&sampled, &picture).expect("same size");
    assert!(similarity > 0.85 && similarity < 1.0, "{similarity}");
}

#[test]
fn a_pixel_is_as_far_as_its_nearest_sample() {
    // A fifth of a pixel from the left and from the right edge of the same one.
    for nearer in [-0.3, 0.3] {
        let surfels = [Surfel::at(nearer, 0.0, 10.0), Surfel::at(-nearer, 0.0, 12.0)];
        let scene = scene(&surfels, &[]);
        let mut truth = truth(&scene, &with(Splat::Point, 1.0, orthographic([5, 5])), 4);
        add_all(&mut truth, &scene);
        let picture = truth.finish().expect("complete").picture;
        assert_eq!(depth_at(&picture, 2, 2), 10.0);
        let beside = if nearer < 0.0 { 3 } else { 1 };
        assert_eq!(
            [depth_at(&picture, beside, 2), depth_at(&picture, 4 - beside, 2)],
            [12.0, 10.0]
        );
    }
}
