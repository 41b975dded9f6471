//! The courtyard: what stands where.
//!
//! Metres, x east, y north, z up. The courtyard is the ground from (0, 0) to (22, 16). The house stands
//! along its north side, an arcade with a terrace on top along its east side, a neighbour's wall with
//! ivy along the west; a garden wall with a gate closes it to the south, where the street passes with a
//! park beyond.

mod arcade;
mod car;
mod court;
mod facade;
mod furniture;
mod ground;
mod house;
mod interior;
mod neighbours;
mod palette;
mod plants;
mod roof;
mod street;
mod tree;

use super::scene::Builder;

/// Builds everything.
pub fn build(b: &mut Builder) {
    ground::build(b);
    court::build(b);
    arcade::build(b);
    house::build(b);
    interior::build(b);
    neighbours::build(b);
    street::build(b);
    plants::build(b);
}
