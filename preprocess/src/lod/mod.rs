//! Level-of-detail methods: one file each, all turning a [`Tree`](crate::tree::Tree) of points into
//! the list of points that each node keeps.

pub mod poisson;
