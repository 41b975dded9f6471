//! The point under the cursor, exactly.

use glam::DVec3;
use lodestream_protocol::{Lattice, NodeKey};

use super::filter::Shown;
use crate::{
    engine::FramePlan,
    render::{CpuRenderer, RenderError, RenderSettings, Scene},
};

/// How far beside a point a click may be, pixels.
pub const REACH_PX: u32 = 6;

/// A point that was picked.
#[derive(Debug, Clone, PartialEq)]
pub struct Picked {
    /// Number of the cloud.
    pub cloud: usize,
    /// The node that holds it.
    pub key: NodeKey,
    /// Which of the node's points.
    pub point: usize,
    /// Whether the coordinates are those of the dataset. Else they are those of the middle of the cell that
    /// the point was drawn in.
    pub is_exact: bool,
    /// World coordinates.
    pub world: [f64; 3],
    /// The same as text, with as many decimals as the dataset has.
    pub text: [String; 3],
}

impl Picked {
    /// World coordinates.
    #[must_use]
    pub fn place(&self) -> DVec3 {
        self.world.into()
    }

    /// Puts the point where it lies in its node, lattice units.
    pub fn put(&mut self, lattice: &Lattice, within_node: [u32; 3]) {
        let corner = lattice.node_min(self.key);
        let q = std::array::from_fn(|axis| corner[axis].saturating_add(within_node[axis]));
        self.world = lattice.world(q);
        let decimals = decimals(lattice);
        self.text = self.world.map(|c| coordinate(c, decimals));
    }
}

/// The point that is seen at a pixel, or within a few pixels of it.
///
/// # Errors
/// Where the picture could not be drawn either.
pub fn pick(
    plan: &FramePlan,
    shown: &Shown,
    settings: &RenderSettings,
    at: [u32; 2],
) -> Result<Option<Picked>, RenderError> {
    let scene = Scene { clouds: &plan.clouds, nodes: &shown.nodes };
    let Some(seen) = CpuRenderer.seen(&scene, settings, at, REACH_PX)? else { return Ok(None) };
    let node = &shown.nodes[seen.node];
    let mut picked = Picked {
        cloud: node.cloud,
        key: node.key,
        point: shown.original(seen.node, seen.point),
        is_exact: node.points.cell_bits == 0,
        world: [0.0; 3],
        text: Default::default(),
    };
    picked.put(&plan.clouds[node.cloud].lattice, node.points.positions[seen.point]);
    Ok(Some(picked))
}

/// Decimals that tell all coordinates of a lattice apart; `None` where it is not one of decimal steps.
fn decimals(lattice: &Lattice) -> Option<usize> {
    let is_whole = |number: f64, power: f64| {
        let scaled = number * power;
        (scaled - scaled.round()).abs() <= 1e-6 * scaled.abs().clamp(1.0, 1e3)
    };
    (0..=12)
        .find(|decimals| {
            let power = 10f64.powi(*decimals);
            let step = lattice.scale * power;
            step >= 1.0 - 1e-9
                && is_whole(lattice.scale, power)
                && lattice.offset.iter().all(|offset| is_whole(*offset, power))
        })
        .map(|decimals| decimals as usize)
}

/// A coordinate with those decimals, or as short as it can be read back.
fn coordinate(number: f64, decimals: Option<usize>) -> String {
    match decimals {
        Some(decimals) => format!("{number:.decimals$}"),
        None => format!("{number}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice(scale: f64, offset: f64) -> Lattice {
        Lattice { scale, offset: [offset; 3], origin: [0; 3], side_bits: 20 }
    }

    #[test]
    fn coordinates_have_the_decimals_of_their_lattice() {
        assert_eq!(decimals(&lattice(0.01, 0.0)), Some(2));
        assert_eq!(decimals(&lattice(0.001, 500_000.0)), Some(3));
        assert_eq!(decimals(&lattice(0.025, 0.0)), Some(3));
        assert_eq!(decimals(&lattice(1.0, 0.5)), Some(1));
        assert_eq!(decimals(&lattice(2.0, 0.0)), Some(0));
        assert_eq!(decimals(&lattice(1e-7, 0.0)), Some(7));
        assert_eq!(decimals(&lattice(1.0 / 4_194_304.0, 0.0)), None);
        let fine = lattice(0.01, 635_577.79);
        let [x, ..] = fine.world([1_234_567, 0, 0]);
        assert_eq!(coordinate(x, decimals(&fine)), "647923.46");
        assert_eq!(coordinate(0.125, None), "0.125");
    }
}
