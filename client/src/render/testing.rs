//! Synthetic clouds for the tests of this module.

use std::{collections::BTreeMap, sync::Arc};

use glam::DVec3;
use lodestream_protocol::{
    Attribute, Column, GroupInfo, Lattice, LatticeBox, Manifest, NodeKey, NodePoints, ScalarType,
    Storage,
};

use crate::{engine::DrawNode, render::Scene};
pub(crate) use crate::{engine::testing::manifest, path::Random};

/// A point of a synthetic cloud.
#[derive(Debug, Clone, Copy)]
pub struct Point {
    /// Lattice units relative to the root cube.
    pub q: [u32; 3],
    /// Red, green, blue.
    pub rgb: [u8; 3],
    /// Strength of the return.
    pub intensity: u16,
}

/// Clouds and their nodes.
#[derive(Debug, Clone)]
pub struct TestScene {
    pub clouds: Vec<Arc<Manifest>>,
    pub nodes: Vec<DrawNode>,
}

/// A cloud of one node of 256 steps a side, far from the origin, with colours and intensities.
pub fn small_cube(points: &[[u32; 3]]) -> TestScene {
    let offset = [500_000.25, 5_000_000.5, 100.0];
    let lattice = Lattice { scale: 0.01, offset, origin: [0; 3], side_bits: 8 };
    let points: Vec<Point> = points
        .iter()
        .enumerate()
        .map(|(index, q)| Point { q: *q, rgb: [index as u8; 3], intensity: index as u16 })
        .collect();
    cloud(lattice, 1, &points)
}

impl TestScene {
    pub fn scene(&self) -> Scene<'_> {
        Scene { clouds: &self.clouds, nodes: &self.nodes }
    }

    /// The scene with another cloud in it.
    pub fn and(mut self, other: Self) -> Self {
        let first = self.clouds.len();
        self.clouds.extend(other.clouds);
        let nodes = other.nodes.into_iter();
        self.nodes.extend(nodes.map(|node| DrawNode { cloud: node.cloud + first, ..node }));
        self
    }
}

/// A cloud of the points on the lattice, spread over `levels` levels of nodes.
pub fn cloud(lattice: Lattice, levels: u8, points: &[Point]) -> TestScene {
    let mut by_node: BTreeMap<NodeKey, Vec<Point>> = BTreeMap::new();
    let mut bounds = LatticeBox::EMPTY;
    for (index, point) in points.iter().enumerate() {
        let level = (index % usize::from(levels)) as u8;
        let coords =
            point.q.map(|c| c.checked_shr(u32::from(lattice.node_bits(level))).unwrap_or(0));
        let key = NodeKey::new(level, coords).expect("a point of the root cube");
        bounds.grow(point.q);
        by_node.entry(key).or_default().push(*point);
    }
    let attribute = |name: &str, scalar, components: u8, group, max| Attribute {
        name: name.into(),
        scalar,
        components,
        domain: Default::default(),
        storage: Storage::Column { group },
        min: vec![0.0; usize::from(components)],
        max: vec![max; usize::from(components)],
    };
    let group = |name: &str, columns| GroupInfo { name: name.into(), columns };
    let manifest = Manifest {
        points: points.len() as u64,
        nodes: by_node.len() as u64,
        levels,
        lattice,
        bounds,
        attributes: vec![
            attribute("color", ScalarType::U16, 3, 0, 65_535.0),
            attribute("intensity", ScalarType::U16, 1, 1, 1000.0),
        ],
        groups: vec![group("base", vec![0, 0]), group("intensity", vec![0])],
        ..manifest()
    };
    let nodes = by_node.into_iter().map(|(key, points)| {
        let corner = lattice.node_min(key);
        let relative = |p: &Point| std::array::from_fn(|a| p.q[a] - corner[a]);
        // 16-bit colours, as scanners that scale them up write them.
        let colors =
            points.iter().flat_map(|p| p.rgb).flat_map(|c| (u16::from(c) << 8).to_le_bytes());
        let intensities = points.iter().flat_map(|p| p.intensity.to_le_bytes());
        let node = NodePoints {
            key,
            cell_bits: 0,
            has_coarse_colors: false,
            positions: points.iter().map(relative).collect(),
            columns: vec![
                Column { attribute: 0, bytes: colors.collect() },
                Column { attribute: 1, bytes: intensities.collect() },
            ],
        };
        DrawNode {
            cloud: 0,
            key,
            spacing: manifest.spacing_world(key.level()) as f32,
            points: Arc::new(node),
            part: 0,
        }
    });
    TestScene { nodes: nodes.collect(), clouds: vec![Arc::new(manifest)] }
}

/// A room-sized scene in a cube of 2^`side_bits` lattice units: rolling ground, a ball, a wall.
pub fn landscape(side_bits: u8, count: usize) -> Vec<Point> {
    let mut random = Random::new(7);
    let side = f64::from(side_bits).exp2();
    let mut points = Vec::with_capacity(count);
    for index in 0..count {
        let (u, v) = (random.unit(), random.unit());
        let (place, rgb) = match index % 4 {
            0 => {
                let angle = u * std::f64::consts::TAU;
                let z = 2.0 * v - 1.0;
                let r = (1.0 - z * z).sqrt();
                let ball =
                    [0.3 + 0.15 * r * angle.cos(), 0.4 + 0.15 * r * angle.sin(), 0.4 + 0.15 * z];
                (ball, [200, (v * 255.0) as u8, 40])
            }
            1 => ([0.1 + 0.8 * u, 0.85, 0.1 + 0.5 * v], [60, 90, (u * 255.0) as u8]),
            _ => {
                let height = 0.1 + 0.05 * (9.0 * u).sin() * (7.0 * v).cos();
                ([u, v, height], [(u * 255.0) as u8, 160, (v * 255.0) as u8])
            }
        };
        let q = place.map(|c| (c * (side - 1.0)) as u32);
        let intensity = (1000.0 * (0.5 + 0.5 * (20.0 * u).sin() * (20.0 * v).sin())) as u16;
        points.push(Point { q, rgb, intensity });
    }
    points
}

impl TestScene {
    /// The scene with `normal`, `axis_u`, `axis_v`, `radius` and `classification` of every point:
    /// directions that turn with the place, ellipses three times as long as wide, a few classes.
    pub fn with_surface(self) -> Self {
        let float = |name: &str, components| Attribute {
            name: name.into(),
            scalar: ScalarType::F32,
            components,
            domain: Default::default(),
            storage: Storage::Column { group: 2 },
            min: Vec::new(),
            max: Vec::new(),
        };
        let class = Attribute {
            scalar: ScalarType::U8,
            max: vec![18.0],
            min: vec![0.0],
            ..float("classification", 1)
        };
        let added =
            [float("normal", 3), float("axis_u", 3), float("axis_v", 3), float("radius", 1), class];
        let clouds = self.clouds.iter().map(|cloud| {
            let mut cloud = Manifest::clone(cloud);
            cloud.attributes.extend(added.clone());
            cloud.groups.push(GroupInfo { name: "surface".into(), columns: vec![0; 5] });
            Arc::new(cloud)
        });
        let clouds: Vec<_> = clouds.collect();
        let nodes = self.nodes.into_iter().map(|node| {
            let (lattice, first) = (&clouds[node.cloud].lattice, 2);
            let mut columns: Vec<_> = (0..added.len())
                .map(|i| Column { attribute: first + i, bytes: Vec::new() })
                .collect();
            let corner = lattice.node_min(node.key);
            for q in &node.points.positions {
                let place: [f64; 3] = std::array::from_fn(|a| {
                    lattice.scale * (f64::from(corner[a]) + f64::from(q[a]))
                });
                let turned = DVec3::from(place) * 0.7;
                let normal =
                    DVec3::new(turned.x.sin(), -0.8 + 0.3 * turned.z.cos(), turned.y.cos());
                let normal = normal.normalize();
                let u = normal.any_orthonormal_vector();
                let radius = 0.1 + 0.05 * turned.x.cos();
                let axes = [u * radius, normal.cross(u) * (radius / 3.0)];
                let vectors = [normal, axes[0], axes[1]];
                for (column, vector) in columns.iter_mut().zip(vectors) {
                    let bytes =
                        vector.to_array().into_iter().flat_map(|c| (c as f32).to_le_bytes());
                    column.bytes.extend(bytes);
                }
                columns[3].bytes.extend((radius as f32).to_le_bytes());
                columns[4].bytes.push((turned.x + 10.0) as u8 % 19);
            }
            let mut points = NodePoints::clone(&node.points);
            points.columns.extend(columns);
            DrawNode { points: Arc::new(points), ..node }
        });
        let nodes = nodes.collect();
        Self { clouds, nodes }
    }
}
