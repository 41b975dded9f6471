//! From the world to places of the window.

use egui::{Pos2, Rect};
use glam::DVec3;

use crate::camera::{Camera, Projection, ViewBasis};

/// Projects places.
#[derive(Debug, Clone, Copy)]
pub struct Projector {
    eye: DVec3,
    basis: ViewBasis,
    projection: Projection,
    rect: Rect,
    /// Logical pixels of a world unit, at a distance of 1 where that matters.
    scale: f64,
}

impl Projector {
    /// Of a camera whose picture fills a part of the window.
    #[must_use]
    pub fn new(camera: &Camera, rect: Rect) -> Self {
        let height = f64::from(rect.height());
        let scale = match camera.projection {
            Projection::Perspective { fov_y } => 0.5 * height / (0.5 * fov_y).tan(),
            Projection::Orthographic { height: world } => height / world,
        };
        let (basis, projection) = (camera.basis(), camera.projection);
        Self { eye: camera.eye, basis, projection, rect, scale }
    }

    /// Right, up, ahead.
    fn view(&self, place: DVec3) -> DVec3 {
        let from_eye = place - self.eye;
        DVec3::new(
            from_eye.dot(self.basis.right),
            from_eye.dot(self.basis.up),
            from_eye.dot(self.basis.forward),
        )
    }

    fn on_window(&self, view: DVec3) -> Pos2 {
        let scale = match self.projection {
            Projection::Perspective { .. } => self.scale / view.z,
            Projection::Orthographic { .. } => self.scale,
        };
        let middle = self.rect.center();
        // Casts saturate: what is far beside is far beside.
        Pos2::new(middle.x + (view.x * scale) as f32, middle.y - (view.y * scale) as f32)
    }

    /// Where a place is; `None` where it is not before the eye.
    #[must_use]
    pub fn place(&self, place: DVec3) -> Option<Pos2> {
        let view = self.view(place);
        (view.z > 0.0).then(|| self.on_window(view))
    }

    /// The part of a line that is before the eye.
    #[must_use]
    pub fn line(&self, from: DVec3, to: DVec3) -> Option<[Pos2; 2]> {
        let (mut a, mut b) = (self.view(from), self.view(to));
        let nearest = 1e-4 * a.z.abs().max(b.z.abs());
        let cut = |inside: DVec3, outside: DVec3| {
            let t = (inside.z - nearest) / (inside.z - outside.z);
            inside + t * (outside - inside)
        };
        match (a.z > nearest, b.z > nearest) {
            (true, true) => {}
            (true, false) => b = cut(a, b),
            (false, true) => a = cut(b, a),
            (false, false) => return None,
        }
        Some([self.on_window(a), self.on_window(b)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_where_pictures_have_them() {
        let camera = Camera {
            eye: DVec3::ZERO,
            target: DVec3::Y,
            up: DVec3::Z,
            projection: Projection::Perspective { fov_y: std::f64::consts::FRAC_PI_2 },
        };
        let rect = Rect::from_min_size(Pos2::new(100.0, 50.0), egui::vec2(200.0, 100.0));
        let projector = Projector::new(&camera, rect);
        assert_eq!(projector.place(DVec3::new(1.0, 4.0, 2.0)), Some(Pos2::new(212.5, 75.0)));
        assert_eq!(projector.place(DVec3::NEG_Y), None);
        let line = projector.line(DVec3::new(0.0, 1.0, 0.0), DVec3::new(0.0, -1.0, 0.0));
        assert!(line.is_some_and(|[a, b]| a == rect.center() && b == rect.center()));
        assert_eq!(projector.line(DVec3::NEG_Y, 2.0 * DVec3::NEG_Y), None);
    }
}
