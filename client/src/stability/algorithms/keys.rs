//! Node keys, octants, Morton codes.

use std::collections::HashSet;

use fastrand::Rng;
use lodestream_protocol::{Lattice, MAX_SIDE_BITS, MortonCode, NodeKey};

use super::Rows;
use crate::stability::{
    Row, StabilityError,
    dataset::{Built, Digits, FEW_CELLS, Placed},
    exact::{big, whole},
};

const REFERENCE: &str = "bit by bit, in 128-bit integers";
const EXACT: &str = "integers: shifts and masks";

pub(super) fn cases() -> Rows {
    let mut rng = Rng::with_seed(3);
    let ends = [0, 1, (1 << 21) - 1, 1 << 21, u32::MAX - 1, u32::MAX];
    let mut points: Vec<[u32; 3]> = ends
        .into_iter()
        .flat_map(|x| ends.into_iter().flat_map(move |y| ends.map(|z| [x, y, z])))
        .collect();
    points.extend((0..2000).map(|_| [rng.u32(..), rng.u32(..), rng.u32(..)]));
    let count = |wrong: usize| wrong as f64;

    let codes = points.iter().filter(|&&q| {
        let expected = interleaved(q);
        u128::encode(q) != expected
            || expected.decode() != q
            || u64::encode(q.map(|c| c & 0x1f_ffff)).decode() != q.map(|c| c & 0x1f_ffff)
    });
    let morton = Row::new(
        "Morton codes of 21 and 32 bits, ends of the range",
        (count(codes.count()), "points"),
        (0.0, EXACT),
        REFERENCE,
    );

    // Down to the finest level: 33 keys each.
    let lattice =
        Lattice { scale: 1.0, offset: [0.0; 3], origin: [0; 3], side_bits: MAX_SIDE_BITS };
    let lost = points.iter().filter(|&&q| {
        let mut key = NodeKey::ROOT;
        (0..MAX_SIDE_BITS).any(|level| {
            let Some(child) = key.child(octant(q, level)) else { return true };
            let side = 1u128 << (MAX_SIDE_BITS - level - 1);
            let corner = lattice.node_min(child);
            let holds = (0..3).all(|a| {
                let from_corner = u128::from(q[a]).checked_sub(u128::from(corner[a]));
                from_corner.is_some_and(|inside| inside < side)
            });
            let wrong = !holds
                || child.parent() != Some(key)
                || child.octant() != octant(q, level)
                || child.ancestor(0) != Some(NodeKey::ROOT);
            key = child;
            wrong
        })
    });
    let keys = Row::new(
        "keys of all 32 levels hold their points",
        (count(lost.count()), "points"),
        (0.0, EXACT),
        REFERENCE,
    );

    let beyond = NodeKey::new(33, [0; 3]).is_some()
        || NodeKey::new(4, [16, 0, 0]).is_some()
        || NodeKey::new(32, [u32::MAX; 3]).is_none_or(|key| key.child(0).is_some());
    let refused = Row::holds(
        "keys beyond the tree",
        !beyond,
        "what is no cube of the tree is no key",
        "2^level cubes a side, levels 0 to 32",
    );
    let mut rows = vec![morton, keys, refused];
    let offsets =
        [("octants at 10^7 m, 1 mm detail", 10_000_000), ("octants at 10^9 m", 1_000_000_000)];
    for (case, offset) in offsets {
        rows.push(octants(case, offset, &mut rng)?);
    }
    Ok(rows)
}

/// Octants of a cloud of 4 m, `offset` metres from the origin: in which nodes a build puts its points.
fn octants(case: &'static str, offset: i64, rng: &mut Rng) -> Result<Row, StabilityError> {
    const LEVELS: u8 = 12;
    const MM: i64 = 1000;
    let within: Vec<[u32; 3]> =
        (0..2000).map(|_| std::array::from_fn(|_| rng.u32(..1 << LEVELS))).collect();
    let points = within.iter().map(|q| q.map(|c| offset * MM + i64::from(c))).collect();
    let digits = Digits { name: case, decimals: 3, points };
    let built = Built::of("case.xyz", digits.text().as_bytes(), FEW_CELLS)?;
    let lattice = built.dataset.manifest().lattice;
    let (placed, half) = (built.points()?, whole(1) / whole(2));
    let is_held = |point: &Placed| {
        let (corner, level) = (lattice.node_min(point.node), point.node.level());
        let exact = digits.exact(point.number);
        (0..3).all(|a| {
            // The lattice's scale is a double: a step is not quite a millimetre.
            let steps = (&exact[a] - big(lattice.offset[a])) / big(lattice.scale)
                - whole(lattice.origin[a].into())
                - whole(corner[a].into());
            steps >= -&half && steps < whole(1 << lattice.node_bits(level)) - &half
        })
    };
    let held: HashSet<usize> = placed.iter().filter(|p| is_held(p)).map(|p| p.number).collect();
    let halves_astray = |cube_of: &dyn Fn([f64; 3]) -> [Option<u32>; 3]| {
        let world = |q: [u32; 3]| q.map(|c| (offset * MM + i64::from(c)) as f64 / MM as f64);
        within.iter().filter(|&&q| cube_of(world(q)) != q.map(Some)).count() as f64
    };
    let side = f64::from(1u32 << LEVELS) / MM as f64;
    let low = offset as f64;
    let row = Row::new(
        case,
        ((within.len() - held.len()) as f64, "points of 2000"),
        (0.0, EXACT),
        "the file's decimals, in 512-bit floats, within the cube of their node",
    );
    let single = halves_astray(&|world| halved::<f32>(world, low as f32, side, LEVELS));
    let double = halves_astray(&|world| halved::<f64>(world, low, side, LEVELS));
    Ok(row
        .beside("boxes halved in single precision", single)
        .beside("boxes halved in double precision", double))
}

/// The cube of the finest level that halving a box of floats finds, as lattice coordinates.
fn halved<F: Float>(world: [f64; 3], low: F, side: f64, levels: u8) -> [Option<u32>; 3] {
    world.map(|c| {
        let c = F::of(c);
        let (mut low, mut high) = (low, low.plus(F::of(side)));
        let mut cube = 0u32;
        for _ in 0..levels {
            let middle = low.middle(high);
            let is_upper = c >= middle;
            cube = cube << 1 | u32::from(is_upper);
            if is_upper {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some(cube)
    })
}

/// What halving needs of a float.
trait Float: Copy + PartialOrd {
    fn of(value: f64) -> Self;
    fn plus(self, other: Self) -> Self;
    fn middle(self, other: Self) -> Self;
}

impl Float for f32 {
    fn of(value: f64) -> Self {
        value as Self
    }
    fn plus(self, other: Self) -> Self {
        self + other
    }
    fn middle(self, other: Self) -> Self {
        0.5 * (self + other)
    }
}

impl Float for f64 {
    fn of(value: f64) -> Self {
        value
    }
    fn plus(self, other: Self) -> Self {
        self + other
    }
    fn middle(self, other: Self) -> Self {
        0.5 * (self + other)
    }
}

/// Which half of the cube at `level` a point is in, per axis.
fn octant(q: [u32; 3], level: u8) -> u8 {
    let bit = |a: usize| (u128::from(q[a]) >> (MAX_SIDE_BITS - 1 - level) & 1) as u8;
    bit(0) | bit(1) << 1 | bit(2) << 2
}

fn interleaved(q: [u32; 3]) -> u128 {
    (0..32).fold(0, |code, bit| {
        (0..3).fold(code, |code, a| code | u128::from(q[a] >> bit & 1) << (3 * bit + a))
    })
}
