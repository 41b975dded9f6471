//! Patterns in the plane that materials are made of: courses of stones, cobbles, boards.

use glam::Vec2;

use super::noise::{lattice, smoothstep, split};

/// What a pattern says about one spot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piece {
    /// A number of its own for the brick, slab or board that the spot belongs to, in [0, 1).
    pub own: f32,
    /// 0 in a joint, 1 on the piece, between at its edge.
    pub body: f32,
}

/// Courses of equal pieces `size` in metres, `joint` metres between them, each course shifted by
/// `bond` of a length against the one below.
#[inline]
pub fn courses(p: Vec2, size: Vec2, joint: f32, bond: f32) -> Piece {
    let (row, across) = split(p.y / size.y);
    let (column, along) = split(p.x / size.x + row as f32 * bond);
    let edge_x = (0.5 - (along - 0.5).abs()) * size.x;
    let edge_y = (0.5 - (across - 0.5).abs()) * size.y;
    let edge = edge_x.min(edge_y);
    Piece {
        own: lattice(column, row, 0, 11),
        body: smoothstep(joint * 0.4, joint * 0.4 + 0.008, edge),
    }
}

/// Boards of `width` along x, cut at irregular lengths of about `length`.
#[inline]
pub fn boards(p: Vec2, width: f32, length: f32) -> Piece {
    let (row, across) = split(p.y / width);
    let (column, along) = split(p.x / length + 7.3 * lattice(row, 0, 0, 5));
    let edge_y = (0.5 - (across - 0.5).abs()) * width;
    let edge_x = (0.5 - (along - 0.5).abs()) * length;
    Piece { own: lattice(column, row, 0, 12), body: smoothstep(0.0005, 0.0035, edge_x.min(edge_y)) }
}

/// Irregular stones about one unit across: cells around jittered points (Worley 1996, F2 - F1).
#[inline]
pub fn cobbles(p: Vec2, jitter: f32, gap: f32) -> Piece {
    let ((cx, fx), (cy, fy)) = (split(p.x), split(p.y));
    let (mut first, mut second, mut own) = (f32::MAX, f32::MAX, 0.0);
    for y in -1..=1 {
        for x in -1..=1 {
            let (a, b) = (lattice(cx + x, cy + y, 0, 21), lattice(cx + x, cy + y, 1, 21));
            let dx = x as f32 + 0.5 + jitter * (a - 0.5) - fx;
            let dy = y as f32 + 0.5 + jitter * (b - 0.5) - fy;
            let distance = dx * dx + dy * dy;
            if distance < first {
                (second, first, own) = (first, distance, lattice(cx + x, cy + y, 2, 21));
            } else if distance < second {
                second = distance;
            }
        }
    }
    let border = second.sqrt() - first.sqrt();
    Piece { own, body: smoothstep(gap * 0.5, gap, border) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn courses_have_joints_at_their_edges_and_bodies_between() {
        let size = Vec2::new(0.25, 0.08);
        assert_eq!(courses(Vec2::new(0.125, 0.04), size, 0.01, 0.5).body, 1.0);
        assert_eq!(courses(Vec2::new(0.125, 0.0801), size, 0.01, 0.5).body, 0.0);
        // The next course is shifted by half a brick.
        assert_eq!(courses(Vec2::new(0.125, 0.12), size, 0.01, 0.5).body, 0.0);
        assert_eq!(courses(Vec2::new(0.25, 0.12), size, 0.01, 0.5).body, 1.0);
    }

    #[test]
    fn one_cobble_has_one_number() {
        let middle = cobbles(Vec2::new(4.5, 7.5), 0.0, 0.1);
        assert_eq!(middle.body, 1.0);
        assert_eq!(middle.own, cobbles(Vec2::new(4.6, 7.4), 0.0, 0.1).own);
        assert_ne!(middle.own, cobbles(Vec2::new(5.5, 7.5), 0.0, 0.1).own);
        assert_eq!(cobbles(Vec2::new(5.0, 7.5), 0.0, 0.1).body, 0.0);
    }
}
