//! The algorithms that are tried: a file each.

mod camera_path;
mod codec;
mod covariance;
mod eigen;
mod ellipse;
mod frustum;
mod keys;
mod lattice;
mod metrics;
mod normals;
mod plane;
mod poisson;
mod priority;
mod transform;

use super::{Row, StabilityError};

/// Rows, or why a case could not be tried.
type Rows = Result<Vec<Row>, StabilityError>;

/// An algorithm with its cases.
#[derive(Debug, Clone, Copy)]
pub struct Algorithm {
    /// Unique; lower-case words.
    pub name: &'static str,
    /// What it does, and what stands in the way.
    pub about: &'static str,
    cases: fn() -> Rows,
}

impl Algorithm {
    /// Tries it on all its cases.
    ///
    /// # Errors
    /// [`StabilityError`], where a case cannot be tried at all.
    pub fn rows(&self) -> Rows {
        let mut rows = (self.cases)()?;
        rows.iter_mut().for_each(|row| row.algorithm = self.name);
        Ok(rows)
    }
}

/// All of them, in the order that data takes.
pub const ALGORITHMS: [Algorithm; 14] = [
    Algorithm {
        name: "lattice",
        about: "A file's coordinates become lattice integers and, in the client, world coordinates \
                again. The whole way is taken: a file is written, built, opened and decoded.",
        cases: lattice::cases,
    },
    Algorithm {
        name: "keys",
        about: "Node keys, octants and Morton codes are shifts and masks. Programs that halve boxes \
                of floats put points into cubes that do not hold them.",
        cases: keys::cases,
    },
    Algorithm {
        name: "poisson",
        about: "No two sampled points of a level and the levels above are nearer than the level's \
                distance, in any shape of cloud, and none of the input is lost. Whole builds, each \
                pair of points looked at with 128-bit integers.",
        cases: poisson::cases,
    },
    Algorithm {
        name: "codec",
        about: "What is encoded is decoded bit by bit: every width of position, every type of value, \
                NaN with its payload, denormal numbers, both zeros.",
        cases: codec::cases,
    },
    Algorithm {
        name: "frustum",
        about: "What is in the picture is never culled, and appears as large as it is, at any field \
                of view, distance and offset. Points at the picture's edges are classified exactly.",
        cases: frustum::cases,
    },
    Algorithm {
        name: "priority",
        about: "How much a node matters (Fraiss 2017, eqs. 3.3 and 3.4). Rounding takes the cosine \
                straight ahead beyond one, and its acos was no number: the node in the middle of the \
                picture came last. And what a point budget of one, or of all there is, lets through.",
        cases: priority::cases,
    },
    Algorithm {
        name: "transform",
        about: "From the lattice to the camera: the difference of large coordinates, kept to the last \
                digit; and the distances that pictures hold, over ten orders of magnitude.",
        cases: transform::cases,
    },
    Algorithm {
        name: "covariance",
        about: "Sums of exact integers about the node (Moments, Covariance), and their merging from \
                parts with origins of their own. Entries are measured against the largest one. \
                Shortcuts get world coordinates, as they do in practice.",
        cases: covariance::cases,
    },
    Algorithm {
        name: "eigen",
        about: "The 3 x 3 symmetric eigenproblem by Jacobi's rotations. The residual bounds the error \
                of the eigenvalues; that, and how far the vectors are from orthonormal, is measured \
                in units of the largest entry.",
        cases: eigen::cases,
    },
    Algorithm {
        name: "plane",
        about: "Normals and curvatures: the plane of all points, and around each point over k \
                nearest, a radius, or both. What has no plane says so.",
        cases: plane::cases,
    },
    Algorithm {
        name: "ellipse",
        about: "The bounding ellipse in a tangent plane, from the homogeneous covariance (Pajarola \
                2003, eqs. 1 to 6). As printed, eq. 5 gives eigenvalues of the wrong sign, and axes \
                that go with eigenvalues instead of their roots are too long.",
        cases: ellipse::cases,
    },
    Algorithm {
        name: "normals",
        about: "Unit vectors of normals of any length, and the cones around them. What has no \
                direction is refused.",
        cases: normals::cases,
    },
    Algorithm {
        name: "metrics",
        about: "Structural similarity on constant and extreme pictures: variances that cancel, sizes \
                at which there is nothing to compare.",
        cases: metrics::cases,
    },
    Algorithm {
        name: "camera path",
        about: "Where the camera is between key frames: far from the origin, with steps of a \
                microsecond, with none.",
        cases: camera_path::cases,
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Tries an algorithm; every case must pass, and be the same when it is tried again.
    fn holds(name: &str) {
        let algorithm = ALGORITHMS.iter().find(|a| a.name == name).expect("an algorithm");
        let rows = algorithm.rows().expect("all cases can be tried");
        assert!(!rows.is_empty());
        let missed: Vec<&Row> = rows.iter().filter(|row| !row.passed).collect();
        assert!(missed.is_empty(), "{missed:#?}");
        // As text, since NaN differs from itself.
        let again = algorithm.rows().expect("all cases can be tried");
        assert_eq!(format!("{rows:?}"), format!("{again:?}"));
    }

    macro_rules! each {
        ($($test:ident: $name:literal,)*) => {
            $(#[test]
            fn $test() {
                holds($name);
            })*

            #[test]
            fn every_algorithm_has_a_test() {
                assert_eq!(ALGORITHMS.map(|a| a.name), [$($name),*]);
            }
        };
    }

    each! {
        lattice_quantisation_holds: "lattice",
        keys_and_octants_hold: "keys",
        poisson_distances_hold: "poisson",
        codec_round_trips_hold: "codec",
        frustum_and_projected_size_hold: "frustum",
        priorities_hold: "priority",
        camera_relative_transform_and_depth_hold: "transform",
        covariance_sums_and_merges_hold: "covariance",
        the_eigenproblem_holds: "eigen",
        planes_normals_and_curvatures_hold: "plane",
        ellipses_hold: "ellipse",
        normals_of_any_length_hold: "normals",
        picture_metrics_hold: "metrics",
        camera_paths_hold: "camera path",
    }
}
