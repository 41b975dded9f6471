//! The edges of the clip box.

use egui::{Painter, Stroke};
use glam::DVec3;

use super::Projector;
use crate::{engine::ClipBox, viewer::theme::Palette};

pub fn draw(painter: &Painter, projector: &Projector, clip: &ClipBox, palette: Palette) {
    let corner = |bits: usize| {
        let pick =
            |axis: usize| if bits >> axis & 1 == 1 { clip.max[axis] } else { clip.min[axis] };
        DVec3::new(pick(0), pick(1), pick(2))
    };
    for from in 0..8 {
        for axis in 0..3 {
            let to = from | 1 << axis;
            if to == from {
                continue;
            }
            if let Some(line) = projector.line(corner(from), corner(to)) {
                painter.line_segment(line, Stroke::new(1.2, palette.accent.gamma_multiply(0.8)));
            }
        }
    }
}
