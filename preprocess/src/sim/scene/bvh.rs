//! A tree of boxes over the scene's primitives, four children to a node.
//!
//! Built top-down by the surface area heuristic on 16 bins (Wald, *On fast Construction of SAH-based
//! Bounding Volume Hierarchies*, 2007), two binary splits at a time. Four boxes are tested at once
//! in SIMD lanes: half a scan's time goes into this file.

use glam::{DVec3, Vec3, Vec4};

use crate::sim::shape::{Bounds, Ray, reciprocal};

/// A leaf holds no more primitives than this unless their centres coincide.
const LEAF_PRIMITIVES: usize = 4;
const BINS: usize = 16;
/// Deeper nodes are split at the median, so that the stack below always suffices.
const SAH_DEPTH: usize = 12;
/// Three siblings wait per level; median splits quarter 2^24 primitives in 12 levels.
const STACK: usize = 3 * (SAH_DEPTH + 12) + 1;

const LEAF: u32 = 1 << 31;
const COUNT_SHIFT: u32 = 24;
const FIRST_MASK: u32 = (1 << COUNT_SHIFT) - 1;

/// Four children: boxes as lanes, and where each leads. Unused lanes hold boxes that nothing meets.
#[derive(Debug, Clone)]
struct Node {
    low: [Vec4; 3],
    high: [Vec4; 3],
    /// A node's index; or `LEAF`, a count and the first primitive.
    child: [u32; 4],
}

/// The tree. Primitives are numbered in its own order: see [`Bvh::build`].
#[derive(Debug)]
pub struct Bvh {
    nodes: Vec<Node>,
}

/// Ray constants for the box tests.
struct Probe {
    origin: [Vec4; 3],
    inverse: [Vec4; 3],
    downward: [bool; 3],
}

impl Probe {
    fn new(ray: &Ray) -> Self {
        Self {
            origin: [0, 1, 2].map(|i| Vec4::splat(ray.origin[i])),
            inverse: [0, 1, 2].map(|i| Vec4::splat(reciprocal(ray.direction[i]))),
            downward: [0, 1, 2].map(|i| reciprocal(ray.direction[i]) < 0.0),
        }
    }

    /// Entry distances, and a mask of the lanes whose boxes lie within `limit`.
    #[inline]
    fn test(&self, node: &Node, limit: f32) -> (Vec4, u32) {
        let mut enter = Vec4::ZERO;
        let mut leave = Vec4::splat(limit);
        for axis in 0..3 {
            let (near, far) = if self.downward[axis] {
                (node.high[axis], node.low[axis])
            } else {
                (node.low[axis], node.high[axis])
            };
            enter = enter.max((near - self.origin[axis]) * self.inverse[axis]);
            leave = leave.min((far - self.origin[axis]) * self.inverse[axis]);
        }
        (enter, enter.cmple(leave).bitmask())
    }
}

impl Bvh {
    /// A tree over boxes, and the order in which it wants the primitives: primitive `i` of the
    /// tree is box `order[i]`.
    ///
    /// # Panics
    /// With 2^24 boxes or more.
    #[must_use]
    pub fn build(bounds: &[Bounds]) -> (Self, Vec<u32>) {
        assert!(bounds.len() < 1 << COUNT_SHIFT, "a scene has fewer than 2^24 primitives");
        let mut order: Vec<u32> = (0..).take(bounds.len()).collect();
        let mut tree = Self { nodes: Vec::new() };
        // The root is a node even where one leaf would do.
        let builder = Builder { bounds };
        builder.node(&mut tree.nodes, &mut order, 0, 0);
        (tree, order)
    }

    /// Visits leaves in the ray's order until none can be nearer than the nearest crossing so far.
    ///
    /// `cross(first..last, limit)` returns the new limit: the distance of the nearest crossing.
    #[inline]
    pub fn nearest(
        &self,
        ray: &Ray,
        limit: f32,
        mut cross: impl FnMut(std::ops::Range<usize>, f32) -> f32,
    ) {
        let probe = Probe::new(ray);
        let mut limit = limit;
        let mut stack = [(0u32, 0f32); STACK];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let (child, entry) = stack[waiting];
            if entry >= limit {
                continue;
            }
            if child & LEAF != 0 {
                limit = cross(leaf_range(child), limit);
                continue;
            }
            let node = &self.nodes[child as usize];
            let (enter, mut mask) = probe.test(node, limit);
            let enter = enter.to_array();
            let first = waiting;
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                // Insertion keeps the nearest on top.
                let mut place = waiting;
                while place > first && stack[place - 1].1 < enter[lane] {
                    stack[place] = stack[place - 1];
                    place -= 1;
                }
                stack[place] = (node.child[lane], enter[lane]);
                waiting += 1;
            }
        }
    }

    /// Whether `blocks` says yes for any leaf that the ray meets before `limit`.
    #[inline]
    pub fn any(
        &self,
        ray: &Ray,
        limit: f32,
        mut blocks: impl FnMut(std::ops::Range<usize>) -> bool,
    ) -> bool {
        let probe = Probe::new(ray);
        let mut stack = [0u32; STACK];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let child = stack[waiting];
            if child & LEAF != 0 {
                if blocks(leaf_range(child)) {
                    return true;
                }
                continue;
            }
            let node = &self.nodes[child as usize];
            let (_, mut mask) = probe.test(node, limit);
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                stack[waiting] = node.child[lane];
                waiting += 1;
            }
        }
        false
    }

    /// Smallest of `distance(primitive)` over all, in f64, skipping boxes that are farther.
    pub fn closest(&self, point: DVec3, mut distance: impl FnMut(usize) -> f64) -> f64 {
        let mut best = f64::INFINITY;
        let mut stack = vec![(0u32, 0f64)];
        while let Some((child, bound)) = stack.pop() {
            if bound >= best {
                continue;
            }
            if child & LEAF != 0 {
                best = leaf_range(child).map(&mut distance).fold(best, f64::min);
                continue;
            }
            let node = &self.nodes[child as usize];
            let first = stack.len();
            for lane in 0..4 {
                let corner =
                    |side: &[Vec4; 3]| Vec3::new(side[0][lane], side[1][lane], side[2][lane]);
                let bounds = Bounds { low: corner(&node.low), high: corner(&node.high) };
                if bounds.low.x <= bounds.high.x {
                    stack.push((node.child[lane], bounds.distance(point)));
                }
            }
            stack[first..].sort_by(|a, b| b.1.total_cmp(&a.1));
        }
        best
    }
}

#[inline]
fn leaf_range(child: u32) -> std::ops::Range<usize> {
    let first = (child & FIRST_MASK) as usize;
    first..first + ((child & !LEAF) >> COUNT_SHIFT) as usize
}

struct Builder<'a> {
    bounds: &'a [Bounds],
}

impl Builder<'_> {
    fn around(&self, order: &[u32]) -> Bounds {
        order.iter().fold(Bounds::EMPTY, |all, &i| all.join(self.bounds[i as usize]))
    }

    fn centre(&self, i: u32) -> Vec3 {
        let b = &self.bounds[i as usize];
        (b.low + b.high) * 0.5
    }

    /// Appends the node over `order`, whose first primitive is number `first`; returns its index.
    fn node(&self, nodes: &mut Vec<Node>, order: &mut [u32], first: usize, depth: usize) -> u32 {
        let index = nodes.len();
        nodes.push(Node {
            low: [Vec4::INFINITY; 3],
            high: [Vec4::NEG_INFINITY; 3],
            child: [LEAF; 4],
        });
        // Split in two, and the halves in two.
        let middle = self.split(order, depth);
        let (left, right) = order.split_at_mut(middle);
        let quarters = [self.split(left, depth), middle, middle + self.split(right, depth)];
        let ends = [0, quarters[0], quarters[1], quarters[2], left.len() + right.len()];
        for lane in 0..4 {
            let part = &mut order[ends[lane]..ends[lane + 1]];
            if part.is_empty() {
                continue;
            }
            let bounds = self.around(part);
            let start = first + ends[lane];
            let child = if part.len() <= LEAF_PRIMITIVES {
                let (count, start) = (part.len() as u32, start as u32);
                LEAF | (count << COUNT_SHIFT) | start
            } else {
                self.node(nodes, part, start, depth + 1)
            };
            let node = &mut nodes[index];
            for axis in 0..3 {
                node.low[axis][lane] = bounds.low[axis];
                node.high[axis][lane] = bounds.high[axis];
            }
            node.child[lane] = child;
        }
        u32::try_from(index).expect("fewer nodes than primitives")
    }

    /// Orders primitives so that a cut is good, and returns where to cut. Small sets stay whole.
    fn split(&self, order: &mut [u32], depth: usize) -> usize {
        if order.len() <= LEAF_PRIMITIVES {
            return order.len();
        }
        let centres = order.iter().fold(Bounds::EMPTY, |all, &i| {
            let c = self.centre(i);
            all.join(Bounds { low: c, high: c })
        });
        let extent = centres.high - centres.low;
        let mut best: Option<(f32, usize, f32)> = None;
        for axis in (0..3).filter(|&axis| extent[axis] > 1e-6 && depth < SAH_DEPTH) {
            let bin_of = |i: u32| {
                let t = (self.centre(i)[axis] - centres.low[axis]) / extent[axis];
                ((t * BINS as f32) as usize).min(BINS - 1)
            };
            let mut bins = [(Bounds::EMPTY, 0usize); BINS];
            for &i in order.iter() {
                let bin = &mut bins[bin_of(i)];
                *bin = (bin.0.join(self.bounds[i as usize]), bin.1 + 1);
            }
            let join = |a: (Bounds, usize), b: &(Bounds, usize)| (a.0.join(b.0), a.1 + b.1);
            for cut in 1..BINS {
                let left = bins[..cut].iter().fold((Bounds::EMPTY, 0), join);
                let right = bins[cut..].iter().fold((Bounds::EMPTY, 0), join);
                if left.1 == 0 || right.1 == 0 {
                    continue;
                }
                let cost =
                    left.0.half_area() * left.1 as f32 + right.0.half_area() * right.1 as f32;
                if best.is_none_or(|(least, ..)| cost < least) {
                    let plane = centres.low[axis] + extent[axis] * (cut as f32 / BINS as f32);
                    best = Some((cost, axis, plane));
                }
            }
        }
        if let Some((_, axis, plane)) = best {
            order.sort_unstable_by_key(|&i| (self.centre(i)[axis] >= plane, i));
            let middle = order.partition_point(|&i| self.centre(i)[axis] < plane);
            if middle > 0 && middle < order.len() {
                return middle;
            }
        }
        let axis = if extent.x >= extent.y.max(extent.z) {
            0
        } else {
            1 + usize::from(extent.z > extent.y)
        };
        order.sort_unstable_by(|&a, &b| {
            self.centre(a)[axis].total_cmp(&self.centre(b)[axis]).then(a.cmp(&b))
        });
        order.len() / 2
    }
}

#[cfg(test)]
mod tests {
    use glam::Mat3;

    use super::*;
    use crate::sim::random::Random;
    use crate::sim::shape::{Block, Frame, Shape};

    fn cloud_of_boxes(count: usize) -> Vec<Shape> {
        let mut random = Random::of([9, 0, 0, 0]);
        (0..count)
            .map(|_| {
                let frame =
                    Frame::turned(random.direction() * random.range(0.0, 10.0), Mat3::IDENTITY);
                Shape::Block(Block { frame, half: Vec3::splat(random.range(0.01, 0.4)) })
            })
            .collect()
    }

    #[test]
    fn finds_what_testing_every_primitive_finds() {
        for count in [1, 3, 5, 700] {
            let shapes = cloud_of_boxes(count);
            let bounds: Vec<Bounds> = shapes.iter().map(Shape::bounds).collect();
            let (bvh, order) = Bvh::build(&bounds);
            let shape = |i: usize| &shapes[order[i] as usize];
            let mut random = Random::of([10, 0, 0, 0]);
            let mut hits = 0;
            for _ in 0..3000 {
                let origin = random.direction() * 12.0;
                let ray =
                    Ray { origin, direction: (random.direction() * 6.0 - origin).normalize() };
                let all = shapes.iter().filter_map(|s| s.cross(&ray, 50.0)).map(|c| c.distance);
                let expected = all.fold(50.0, f32::min);
                let mut nearest = 50.0f32;
                bvh.nearest(&ray, 50.0, |range, mut limit| {
                    for i in range {
                        limit = shape(i).cross(&ray, limit).map_or(limit, |c| c.distance);
                    }
                    nearest = nearest.min(limit);
                    limit
                });
                assert_eq!(nearest, expected);
                let blocked =
                    bvh.any(&ray, 50.0, |mut r| r.any(|i| shape(i).cross(&ray, 50.0).is_some()));
                assert_eq!(blocked, expected < 50.0);
                hits += u32::from(blocked);
                let point = origin.as_dvec3();
                let closest =
                    shapes.iter().map(|s| s.distance(point)).fold(f64::INFINITY, f64::min);
                assert_eq!(bvh.closest(point, |i| shape(i).distance(point)), closest);
            }
            assert!(count < 100 || hits > 500);
        }
    }

    #[test]
    fn copes_with_coinciding_primitives() {
        let bounds = vec![Bounds { low: Vec3::ZERO, high: Vec3::ONE }; 1000];
        let (bvh, order) = Bvh::build(&bounds);
        let ray = Ray { origin: Vec3::splat(-1.0), direction: Vec3::ONE.normalize() };
        let mut seen = vec![0; order.len()];
        bvh.nearest(&ray, 10.0, |range, limit| {
            range.for_each(|i| seen[i] += 1);
            limit
        });
        assert!(seen.iter().all(|&n| n == 1));
    }
}
