use proptest::prelude::*;

use super::*;
use crate::{
    numbers::{Decimal, gcd},
    readers::Positions,
};

/// All decimals here have at most this many places.
const PLACES: i32 = -9;

fn exact(value: f64) -> i128 {
    Decimal::of(value).and_then(|d| d.at_exponent(PLACES)).expect("few decimals")
}

fn scaled(scale: [f64; 3], offset: [f64; 3], points: &[[i32; 3]]) -> InputCoordinates {
    let mut input = InputCoordinates {
        kind: CoordinateKind::Scaled { scale, offset },
        bounds: NativeBounds::EMPTY,
        steps: NativeSteps::default(),
    };
    points.iter().for_each(|p| input.bounds.grow(p.map(f64::from)));
    input.steps.look(points);
    input
}

fn float(decimals: Option<u8>, single_precision: bool, points: &[[f64; 3]]) -> InputCoordinates {
    let mut bounds = NativeBounds::EMPTY;
    points.iter().for_each(|&p| bounds.grow(p));
    let kind = CoordinateKind::Float { decimals, single_precision };
    InputCoordinates { kind, bounds, steps: NativeSteps::default() }
}

fn place(choice: &Choice, input: usize, points: Positions) -> (Vec<[u32; 3]>, f64) {
    choice.placements[input].place(&choice.lattice, points)
}

/// A scale and an offset per axis, and integer points that use every `stride`th step.
#[derive(Debug, Clone)]
struct Part {
    scale: [f64; 3],
    offset: [f64; 3],
    points: Vec<[i32; 3]>,
}

fn part() -> impl Strategy<Value = Part> {
    let scale = prop::sample::select(vec![0.01, 0.001, 0.0001, 0.005, 0.025, 0.1]);
    let offset = prop::sample::select(vec![0.0, 99.9, -3.5, 0.125, 17.03, 2.001]);
    let stride = prop::sample::select(vec![1, 1, 2, 10, 100, 1000]);
    let point = [-900..900i32, -900..900, -900..900];
    let all = (prop::array::uniform3(scale), prop::array::uniform3(offset), stride);
    (all, prop::array::uniform3(-5..5i32), prop::collection::vec(point, 0..6)).prop_map(
        |((scale, offset, stride), first, points)| {
            let points = points.into_iter();
            let points =
                points.map(|p| std::array::from_fn(|a| first[a] + stride * p[a])).collect();
            // Far from zero, but near one another.
            Part { scale, offset: [offset[0] + 500_000.0, offset[1], offset[2]], points }
        },
    )
}

proptest! {
    #[test]
    fn the_lattice_holds_all_points_exactly_and_no_larger_power_of_ten_does(
        parts in prop::collection::vec(part(), 1..4),
    ) {
        let inputs: Vec<InputCoordinates> =
            parts.iter().map(|p| scaled(p.scale, p.offset, &p.points)).collect();
        let points: usize = parts.iter().map(|p| p.points.len()).sum();
        let choice = choose(&inputs, points as u64, None).expect("near one another");
        let lattice = choice.lattice;
        let mut worlds = Vec::new();
        for (index, part) in parts.iter().enumerate() {
            let (placed, rounding) = place(&choice, index, Positions::Scaled(part.points.clone()));
            prop_assert_eq!(rounding, 0.0);
            for (q, native) in placed.iter().zip(&part.points) {
                let means: [i128; 3] = std::array::from_fn(|a| {
                    exact(part.offset[a]) + exact(part.scale[a]) * i128::from(native[a])
                });
                let holds = std::array::from_fn(|a| {
                    let steps = i128::from(lattice.origin[a]) + i128::from(q[a]);
                    exact(lattice.offset[a]) + exact(lattice.scale) * steps
                });
                prop_assert_eq!(means, holds, "{:?} {:?}", lattice, choice.placements[index]);
                prop_assert!(q.iter().all(|&c| u64::from(c) < 1 << lattice.side_bits));
                worlds.push(means);
            }
        }
        let apart = |a: usize| worlds.iter().map(move |w| w[a]).zip(worlds.iter().skip(1).map(move |w| w[a]));
        let used = (0..3).flat_map(apart).map(|(a, b)| a - b).fold(0, gcd);
        let mut larger = 1;
        while larger <= exact(lattice.scale) {
            larger *= 10;
        }
        prop_assert!(used == 0 || used % larger != 0, "{:?}: all differ by multiples of {}", lattice, larger);
    }

    #[test]
    fn text_is_exact_as_long_as_its_decimals_fit(
        points in prop::collection::vec(prop::array::uniform3(-2_000_000_000..2_000_000_000i64), 1..9),
        decimals in 0..=9u8,
    ) {
        let power = 10f64.powi(i32::from(decimals));
        let world: Vec<[f64; 3]> = points.iter().map(|p| p.map(|c| c as f64 / power)).collect();
        let choice = choose(&[float(Some(decimals), false, &world)], 9, None).expect("fits");
        prop_assert_eq!(exact(choice.lattice.scale), 10i128.pow(9 - u32::from(decimals)));
        let (placed, rounding) = place(&choice, 0, Positions::Float(world));
        prop_assert_eq!(rounding, 0.0);
        for (q, point) in placed.iter().zip(&points) {
            let holds: [i64; 3] = std::array::from_fn(|a| choice.lattice.origin[a] + i64::from(q[a]));
            prop_assert_eq!(holds, *point);
        }
    }
}

#[test]
fn parts_of_a_scan_with_finer_scales_than_they_use_get_the_step_that_they_use() {
    let parts = [
        scaled([0.01; 3], [500_000.0, 0.0, 0.0], &[[1, 2, 3], [50, 60, 71]]),
        scaled([0.001; 3], [500_000.5, -1.0, 0.125], &[[120, 70, -5], [20, 50, 5]]),
        scaled([0.0001; 3], [0.0; 3], &[[100, 100, 100]]),
    ];
    let lattice = choose(&parts, 5, None).expect("near").lattice;
    assert_eq!(lattice.scale, 0.01);
}

#[test]
fn a_file_that_uses_all_its_steps_keeps_its_scale_and_offset() {
    let input = scaled([0.01, 0.01, 0.02], [637_000.03, 851_000.0, 0.0], &[[0, 0, 0], [1, 5, 9]]);
    let lattice = choose(&[input], 2, None).expect("near").lattice;
    assert_eq!((lattice.scale, lattice.offset), (0.01, [637_000.03, 851_000.0, 0.0]));
}

#[test]
fn decimals_that_do_not_fit_keep_as_many_as_do() {
    // 265 units with 8 decimals are 2.65e10 steps.
    let points = [[-138.556_780_12, 0.5, 2.0], [126.950_551_37, -0.25, 3.123_456_78]];
    for single_precision in [false, true] {
        let input = float(Some(8), single_precision, &points);
        let choice = choose(&[input], 2, None).expect("rounded");
        assert_eq!(choice.lattice.scale, 1e-7);
        let (_, rounding) = place(&choice, 0, Positions::Float(points.to_vec()));
        assert!(rounding > 1e-9 && rounding < 0.51e-7, "{rounding}");
    }
}

#[test]
fn single_precision_is_rounded_no_coarser_than_it_is() {
    let points = [[-138.5, 0.1, 2.0], [126.9, -0.2, 3.1]];
    let step =
        |single| choose(&[float(None, single, &points)], 2, None).expect("fits").lattice.scale;
    assert_eq!(step(true), f64::from(138.5f32.next_up() - 138.5));
    assert!(step(false) > step(true));
    // Small and near, beside large and far: the cube must hold both.
    let inputs = [float(None, true, &[[0.0, 0.0, 1e-9]]), float(None, false, &[[1e6, 0.0, 0.0]])];
    assert!(choose(&inputs, 2, None).is_ok());
}

#[test]
fn points_beyond_the_cube_are_not_taken_for_those_inside() {
    let inside = scaled([0.01; 3], [0.0; 3], &[[0; 3], [1 << 20; 3]]);
    let lattice = choose(&[inside], 2, None).expect("fits").lattice;
    // 2^32 steps away, which 32 bits cannot tell from none.
    let away = scaled([0.01; 3], [42_949_672.96, 0.0, 0.0], &[[0; 3], [1 << 20; 3]]);
    assert!(matches!(placement_on(&lattice, &inside), Placement::Exact { .. }));
    assert!(matches!(placement_on(&lattice, &away), Placement::Nearest { exact: false, .. }));
}

#[test]
fn an_asked_step_that_holds_the_points_rounds_nothing() {
    let points = vec![[3, 5, 7], [100, 200, 300]];
    let input = scaled([0.01; 3], [17.25, 0.0, 0.0], &points);
    let choice = choose(&[input], 2, Some(0.01)).expect("fits");
    assert_eq!(choice.lattice.scale, 0.01);
    assert_eq!(place(&choice, 0, Positions::Scaled(points)).1, 0.0);
    let choice = choose(&[input], 2, Some(0.5)).expect("fits");
    assert!(place(&choice, 0, Positions::Scaled(vec![[3, 5, 7]])).1 > 0.1);
}
