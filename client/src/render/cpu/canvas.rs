//! What the CPU draws on: one 64-bit key per pixel, taken by the smallest.
//!
//! A key is the distance (its f32 bits order like the number, as it is not negative) above the
//! number of the point in the batch being drawn. Threads offer keys with an atomic minimum, so that
//! the outcome does not hang on their order: the nearest point is seen and, of points equally near,
//! the first. Colours are looked up only for points that are seen, when the batch is done; then
//! the number of the pixel's point becomes 0, which is before all points of the next batch.

use std::sync::{
    Arc,
    atomic::{AtomicU64, Ordering},
};

use lodestream_protocol::Manifest;
use rayon::prelude::*;

use super::footprint::for_each_pixel;
use crate::{
    engine::DrawNode,
    render::{
        RenderSettings, Splat, VisibleTree,
        color::NodeColor,
        scene::Surroundings,
        size::NodeSize,
        surface::NodeSurface,
        view::{NodeView, View},
    },
};

/// A pixel on which nothing was drawn: behind everything.
const EMPTY: u64 = u64::MAX;

/// Points that one task draws: enough to make its set-up cheap, few enough to share the work out.
const TASK_POINTS: usize = 8192;

/// Most points in a batch: their numbers, from 1, fit the lower half of a key.
pub(super) const BATCH_POINTS: usize = u32::MAX as usize - 1;

pub(super) struct Canvas {
    size: [usize; 2],
    keys: Vec<AtomicU64>,
    colors: Vec<[u8; 3]>,
}

impl Canvas {
    pub fn new(size: [usize; 2]) -> Self {
        let pixels = size[0] * size[1];
        let mut keys = Vec::new();
        keys.resize_with(pixels, || AtomicU64::new(EMPTY));
        Self { size, keys, colors: vec![[0; 3]; pixels] }
    }

    /// Draws nodes of `clouds` with at most [`BATCH_POINTS`] points in all.
    pub fn draw(
        &mut self,
        view: &View,
        settings: &RenderSettings,
        tree: &VisibleTree,
        clouds: &[Arc<Manifest>],
        around: &Surroundings,
        nodes: &[&DrawNode],
    ) {
        let mut starts = Vec::with_capacity(nodes.len());
        let mut tasks = Vec::new();
        let mut next = 1;
        for (index, node) in nodes.iter().enumerate() {
            let count = node.points.positions.len();
            starts.push(next);
            let firsts = (0..count).step_by(TASK_POINTS);
            tasks.extend(firsts.map(|first| (index, first, (first + TASK_POINTS).min(count))));
            next += count;
        }
        debug_assert!(next - 1 <= BATCH_POINTS);
        tasks.par_iter().for_each(|&(index, first, end)| {
            let node = nodes[index];
            let cloud = &clouds[node.cloud];
            let node_view = view.node(&cloud.lattice, node.key, [0; 3]);
            let surface = NodeSurface::of(settings, cloud, &node.points);
            let bits = cloud.lattice.node_bits(node.key.level());
            let place = tree.place(node.cloud, node.key).unwrap_or(u32::MAX);
            let (size, spacing) = (settings.splat_size, node.spacing);
            let size = NodeSize::of(size, spacing, tree, place, bits, &surface);
            let positions = &node.points.positions[first..end];
            let number = (starts[index] + first) as u64;
            self.draw_points(view, settings.splat, &node_view, &size, positions, first, number);
        });
        self.take_colors(settings, clouds, around, nodes, &starts);
    }

    fn draw_points(
        &self,
        view: &View,
        splat: Splat,
        node: &NodeView,
        size: &NodeSize,
        positions: &[[u32; 3]],
        first: usize,
        first_number: u64,
    ) {
        let [width, height] = self.size;
        let limits = [width as f64, height as f64];
        let one_pixel = splat == Splat::Point && view.smallest_size_px <= 1.0;
        for (offset, (q, number)) in positions.iter().zip(first_number..).enumerate() {
            let place = node.origin + node.step * glam::DVec3::from_array(q.map(f64::from));
            let Some(at) = view.project(place) else { continue };
            let key = u64::from((at.distance as f32).abs().to_bits()) << 32 | number;
            if one_pixel {
                if at.x >= 0.0 && at.y >= 0.0 && at.x < limits[0] && at.y < limits[1] {
                    offer(&self.keys[at.y as usize * width + at.x as usize], key);
                }
            } else {
                let size = view.size(&at, size.world(first + offset, *q));
                for_each_pixel(splat, &at, size, self.size, |pixel| {
                    offer(&self.keys[pixel], key);
                });
            }
        }
    }

    /// Looks up the colours of the batch's points that are seen.
    fn take_colors(
        &mut self,
        settings: &RenderSettings,
        clouds: &[Arc<Manifest>],
        around: &Surroundings,
        nodes: &[&DrawNode],
        starts: &[usize],
    ) {
        let colors: Vec<_> = nodes
            .iter()
            .map(|n| {
                let surface = NodeSurface::of(settings, &clouds[n.cloud], &n.points);
                NodeColor::of(around, n.cloud, &clouds[n.cloud].lattice, &n.points, &surface)
            })
            .collect();
        self.keys.par_iter_mut().zip(&mut self.colors).with_min_len(4096).for_each(
            |(key, color)| {
                let key = key.get_mut();
                let number = (*key & u64::from(u32::MAX)) as usize;
                if number == 0 || *key == EMPTY {
                    return;
                }
                let node = starts.partition_point(|start| *start <= number) - 1;
                let index = number - starts[node];
                *color = colors[node].color(index, nodes[node].points.positions[index][2]);
                *key &= !u64::from(u32::MAX);
            },
        );
    }

    /// Colour and distance of a pixel; `None` where nothing was drawn.
    pub fn pixel(&self, index: usize) -> Option<([u8; 3], f32)> {
        let key = self.keys[index].load(Ordering::Relaxed);
        (key != EMPTY).then(|| (self.colors[index], f32::from_bits((key >> 32) as u32)))
    }
}

#[inline]
fn offer(pixel: &AtomicU64, key: u64) {
    // Most points are hidden: a plain load is cheaper than a read-modify-write.
    if key < pixel.load(Ordering::Relaxed) {
        pixel.fetch_min(key, Ordering::Relaxed);
    }
}
