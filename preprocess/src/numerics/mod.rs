//! The numeric kernels that level-of-detail methods and attributes stand on.
//!
//! Points are lattice integers here as everywhere: means and covariances come from exact integer
//! sums, and become floats once, after everything that could cancel has cancelled. So there is no
//! variance below zero, no plane that hangs on where the origin is, and sums of children are those
//! of their parent to the last digit, in whatever order they are added.
//!
//! The way through: [`Neighbours`] (who is near) → [`Moments`] (exact sums) → [`Covariance`] →
//! [`Eigen`] → [`Plane`] (normal, curvature) or [`Ellipse`]. [`surfaces`] goes all of it for every
//! point of a set. Everything is in lattice units; a world unit is [`Lattice::scale`] of them.
//!
//! [`Lattice::scale`]: lodestream_protocol::Lattice::scale

mod covariance;
mod eigen;
mod ellipse;
mod moments;
mod neighbours;
mod plane;
mod surface;
mod symmetric;

pub use covariance::Covariance;
pub use eigen::{Eigen, RANK_TOLERANCE, Rank};
pub use ellipse::Ellipse;
pub use moments::Moments;
pub use neighbours::{Neighbours, distance_squared};
pub use plane::{NoPlane, Plane, SMALLEST_GAP};
pub use surface::{Neighbourhood, surfaces};
pub use symmetric::Symmetric3;
