//! A short soak; the long one is `./dev bench soak`.

use std::time::Duration;

use lodestream_protocol::Refinement;

use crate::common::{
    dataset::{Recipe, dataset, write},
    soak::Soak,
};

#[test]
fn after_a_wild_walk_on_a_bad_line_everything_is_as_after_a_cold_start() {
    let recipes = [
        Recipe::default(),
        Recipe { seed: 2, refinement: Refinement::Replace, ..Recipe::default() },
        Recipe { seed: 3, ..Recipe::default() },
    ];
    let files = recipes.map(|recipe| write(&dataset(recipe)));
    let [first, second, other] = files.each_ref().map(|(_, path)| path.clone());
    let soak = Soak {
        clouds: [first, second],
        other,
        length: Duration::from_secs(6),
        seed: 1,
        link: "8mbit/5ms".parse().expect("a link"),
        size_px: [96, 64],
        budgets: [2_000, 60_000],
        cache_bytes: 1 << 20,
        step: Duration::from_millis(100),
        death: Duration::from_millis(700),
    };
    let mut seen = 0;
    let outcome = soak
        .run(|frame| {
            seen += 1;
            assert!(frame.call_ms >= 0.0 && frame.draw_ms >= 0.0);
            assert!(frame.plan.points <= soak.budgets[1]);
            assert_eq!(frame.settings.size_px, soak.size_px);
        })
        .expect("settles");
    assert!(outcome.teleports > 0 && outcome.deaths > 1, "{outcome:?}");
    assert_eq!(seen, outcome.frames);
    assert!(outcome.replaced > 0, "its host came back with another dataset");
    assert!(outcome.cached_bytes <= outcome.cache_limit);
    assert!(outcome.most_bytes > 0);
    assert!(outcome.picture == outcome.expected, "the picture is another");
    assert_eq!((outcome.stats.queued, outcome.stats.in_flight), (0, 0));
}
