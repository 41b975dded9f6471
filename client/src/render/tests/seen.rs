//! What is told to be seen on a pixel is what the picture has there.

use crate::{
    camera::{Camera, Projection},
    render::{
        CpuRenderer, RenderSettings, Splat, SplatSize,
        testing::Random,
        tests::{looking_at_landscape, settings, small_world},
    },
};

#[test]
fn the_point_that_is_seen_has_the_pictures_depth_under_every_splat_size_and_projection() {
    let world = small_world();
    let perspective = looking_at_landscape();
    let projection = Projection::Orthographic { height: 14.0 };
    let orthographic = Camera { projection, ..perspective };
    let sizes = [SplatSize::Pixels(1.0), SplatSize::Pixels(7.0), SplatSize::World(0.2)];
    let more = [SplatSize::Level(1.3), SplatSize::Adaptive(1.6), SplatSize::Own];
    let mut random = Random::new(7);
    for camera in [perspective, orthographic] {
        for (splat, name) in Splat::ALL {
            for size in sizes.into_iter().chain(more) {
                let settings = RenderSettings { splat, splat_size: size, ..settings(camera) };
                let frame = CpuRenderer.render(&world.scene(), &settings).expect("drawn");
                let picture = frame.picture;
                for _ in 0..12 {
                    let [x, y] = [picture.width, picture.height]
                        .map(|side| (random.unit() * f64::from(side)) as u32);
                    let seen = CpuRenderer.seen(&world.scene(), &settings, [x, y], 0);
                    let seen = seen.expect("possible");
                    let depth = picture.depth[(y * picture.width + x) as usize];
                    match seen {
                        Some(seen) => {
                            assert_eq!(seen.distance as f32, depth, "{name} of {size} at {x}, {y}")
                        }
                        None => assert!(depth.is_infinite(), "{name} of {size} at {x}, {y}"),
                    }
                }
            }
        }
    }
}

#[test]
fn where_nothing_is_drawn_the_nearest_pixel_within_reach_counts() {
    let (world, settings) = super::one_point();
    let seen =
        |at, reach| CpuRenderer.seen(&world.scene(), &settings, at, reach).expect("possible");
    let middle = [15, 10];
    assert!(seen(middle, 0).is_some_and(|seen| seen.point == 0));
    let beside = [15 + 5, 10 + 3];
    assert_eq!(seen(beside, 0), None);
    assert!(seen(beside, 6).is_some());
    assert_eq!(seen([0, 0], 6), None);
}
