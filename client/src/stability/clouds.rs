//! The clouds that algorithms over points are tried on.

use fastrand::Rng;
use lodestream_protocol::{Lattice, MortonCode};

/// A cloud.
pub(super) struct Cloud {
    /// What is stiff or extreme about it.
    pub name: &'static str,
    /// Where it is, and how fine.
    pub lattice: Lattice,
    /// In Morton order.
    pub points: Vec<[u32; 3]>,
    /// Across the plane that all points lie in, of any length; `None` where they lie in none.
    pub normal: Option<[i32; 3]>,
}

/// Where a million points are.
const DUPLICATES: usize = 1_000_000;

impl Cloud {
    fn new(name: &'static str, scale: f64, offset: [f64; 3], mut points: Vec<[u32; 3]>) -> Self {
        points.sort_by_key(|&q| u128::encode(q));
        let lattice = Lattice { scale, offset, origin: [0; 3], side_bits: 32 };
        Self { name, lattice, points, normal: None }
    }

    fn plane(name: &'static str, scale: f64, offset: [f64; 3], step: u32) -> Self {
        // z = x / 4 + y / 2, in whole numbers.
        let across = (0..41u32).flat_map(|i| (0..41u32).map(move |j| [i, j]));
        let points = across.map(|[i, j]| [4 * i, 4 * j, i + 2 * j].map(|c| c * step)).collect();
        Self { normal: Some([-1, -2, 4]), ..Self::new(name, scale, offset, points) }
    }

    /// World coordinates, as a program that knows no lattice has them.
    pub fn world(&self) -> Vec<[f64; 3]> {
        self.points.iter().map(|&q| self.lattice.world(q)).collect()
    }
}

/// All of them; the same each time.
pub(super) fn all() -> Vec<Cloud> {
    let mut rng = Rng::with_seed(1);
    let mut random = |count: usize, most: [u32; 3]| -> Vec<[u32; 3]> {
        (0..count).map(|_| most.map(|most| rng.u32(..=most))).collect()
    };
    let cube = |side: [u32; 3]| -> Vec<[u32; 3]> {
        (0..8u32).map(|i| std::array::from_fn(|a| 1000 + (i >> a & 1) * side[a])).collect()
    };
    let millimetre = 0.001;
    let far = [1e7, -1e7, 1e3];
    let ecef = [4_027_881.628, 306_998.785, 4_919_498.981];
    let needle = (0..1001u32).zip(random(1001, [0, 2, 2]));
    let needle = needle.map(|(i, q)| [2000 * i, q[1], q[2]]).collect();
    let spacings = random(1000, [30; 3]).into_iter().chain(
        (0..1000u32).map(|i| [i % 10, i / 10 % 10, i / 100].map(|c| 1_000_000 + 100_000_000 * c)),
    );
    let coplanar = random(500, [400, 400, 0])
        .into_iter()
        .map(|[i, j, _]| [3 * i + 7 * j, 5 * i + 2 * j, 11 * i + 13 * j].map(|c| c + 5_000_000));
    let coplanar = Cloud::new("coplanar, aslant", millimetre, far, coplanar.collect());
    let thin = random(500, [u32::MAX, u32::MAX, 136]);
    let collinear = (0..400u32).map(|i| [3000 * i, 5000 * i, 7000 * i]).collect();
    vec![
        Cloud::plane("offset of 10^7 m, 1 mm detail", millimetre, far, 10),
        Cloud::plane("earth-centred (ECEF), 1 mm detail", millimetre, ecef, 10),
        Cloud::plane("cloud at 10^9 m", millimetre, [1e9; 3], 10),
        Cloud::plane("extent of 10^-6 m", 1e-10, [0.0; 3], 60),
        Cloud::plane("extent of 10^9 m", 1.0, [0.0; 3], 6_000_000),
        Cloud::plane("scale of 10^-9 m", 1e-9, [12.345_678_901; 3], 10),
        Cloud::new("needle, aspect 10^6", millimetre, far, needle),
        Cloud::new("sheet, aspect 10^6", millimetre, far, random(1000, [2_000_000, 2_000_000, 2])),
        Cloud::new("a million duplicates", millimetre, far, vec![[123_456_789; 3]; DUPLICATES]),
        Cloud::new("collinear", millimetre, far, collinear),
        // (3, 5, 11) x (7, 2, 13)
        Cloud { normal: Some([43, 38, -29]), ..coplanar },
        Cloud::new("repeated eigenvalues (a cube)", millimetre, far, cube([1_000_000; 3])),
        Cloud::new(
            "nearly equal eigenvalues (1 part in 10^6)",
            millimetre,
            far,
            cube([1_000_000, 1_000_000, 1_000_001]),
        ),
        Cloud::new("eigenvalues 1 : 10^-15", millimetre, [0.0; 3], thin),
        Cloud::new("spacings 10^8 apart in one cloud", millimetre, far, spacings.collect()),
        Cloud::new("one point", millimetre, far, vec![[4_294_967_295, 0, 77]]),
        Cloud::new("no point", millimetre, far, Vec::new()),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_planes() {
        for cloud in all() {
            let Some(normal) = cloud.normal else { continue };
            let heights = cloud.points.iter().map(|q| {
                q.iter().zip(normal).map(|(&c, n)| i128::from(c) * i128::from(n)).sum::<i128>()
            });
            let mut heights: Vec<i128> = heights.collect();
            heights.dedup();
            assert_eq!(heights.len(), 1, "{}", cloud.name);
        }
    }

    #[test]
    fn names_are_unique() {
        let mut names: Vec<_> = all().iter().map(|cloud| cloud.name).collect();
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), count);
    }
}
