//! Which steps the integer coordinates of an input really take.
//!
//! Many files declare finer steps than they use: centimetres written at a scale of a millimetre, parts
//! of a scan with offsets of their own. The lattice need not be finer than what is used.

use crate::numbers::gcd;

/// Where an input's integer coordinates lie: per axis at `first` plus multiples of `step`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct NativeSteps {
    /// The first point's coordinates; `None` before there is one.
    pub first: Option<[i32; 3]>,
    /// Greatest common divisor of all differences; zero where all coordinates are the same.
    pub step: [u32; 3],
}

impl NativeSteps {
    /// Takes in more coordinates. Costs nothing once the steps are known to be ones, which for
    /// most files takes a few points.
    pub fn look(&mut self, positions: &[[i32; 3]]) {
        let Some(&start) = positions.first() else { return };
        let first = *self.first.get_or_insert(start);
        for (a, step) in self.step.iter_mut().enumerate() {
            if *step == 1 {
                continue;
            }
            for position in positions {
                let apart = position[a].abs_diff(first[a]);
                // No remainder is the rule, and much cheaper than a divisor.
                if *step == 0 || !apart.is_multiple_of(*step) {
                    let common = gcd(i128::from(apart), i128::from(*step));
                    *step = u32::try_from(common).expect("a divisor of a u32, or that itself");
                    if *step == 1 {
                        break;
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_coordinate_is_a_whole_number_of_steps_from_the_first(
            blocks in prop::collection::vec(prop::collection::vec([-20i32..20, -20..20, 7..8], 0..9), 0..5),
            factor in [1i32..90_000_000, 1..7, 1..9],
        ) {
            let scaled = |p: [i32; 3]| std::array::from_fn(|a| p[a] * factor[a]);
            let blocks: Vec<Vec<[i32; 3]>> =
                blocks.into_iter().map(|block| block.into_iter().map(scaled).collect()).collect();
            let mut steps = NativeSteps::default();
            blocks.iter().for_each(|block| steps.look(block));
            let all: Vec<[i32; 3]> = blocks.concat();
            prop_assert_eq!(steps.first, all.first().copied());
            for a in 0..3 {
                let apart = all.iter().map(|p| i128::from(p[a]) - i128::from(all[0][a]));
                let expected = apart.fold(0, gcd);
                prop_assert_eq!(i128::from(steps.step[a]), expected);
            }
        }
    }

    #[test]
    fn coordinates_at_both_ends_of_their_type_are_no_trouble() {
        let mut steps = NativeSteps::default();
        steps.look(&[[i32::MIN; 3], [i32::MAX; 3]]);
        assert_eq!(steps.step, [u32::MAX; 3]);
    }
}
