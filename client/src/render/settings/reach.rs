//! How far splats reach around their points.

use super::{RenderSettings, SizeLimits, Splat, SplatSize, color::ColorMode};
use crate::engine::SplatReach;

impl RenderSettings {
    /// How far splats reach at most, for [leaving out](crate::engine::Engine::set_depth) what lies behind
    /// others; `None` for pictures in which hidden points are seen (counts, and blended splats, in which
    /// those just behind count), and for splats of which it is not known before they are
    /// loaded (oriented ones, meshes, and sizes of the points' own).
    #[must_use]
    pub fn splat_reach(&self) -> Option<SplatReach> {
        let is_plain = matches!(
            self.splat,
            Splat::Point | Splat::Square | Splat::Circle | Splat::Cone | Splat::Paraboloid
        );
        if !is_plain || self.color == ColorMode::Density {
            return None;
        }
        let SizeLimits { min_px, max_px } = self.size_limits;
        let reach =
            SplatReach { px: 0.5 * min_px.max(1.0), world: 0.0, spacings: 0.0, is_adaptive: false };
        if self.splat == Splat::Point {
            return Some(reach);
        }
        match self.splat_size {
            SplatSize::Pixels(size) => {
                let px = 0.5 * f64::from(size).clamp(min_px, max_px);
                Some(SplatReach { px, ..reach })
            }
            SplatSize::World(size) => Some(SplatReach { world: 0.5 * size, ..reach }),
            SplatSize::Level(factor) => Some(SplatReach { spacings: 0.5 * factor, ..reach }),
            SplatSize::Adaptive(factor) => {
                Some(SplatReach { spacings: 0.5 * factor, is_adaptive: true, ..reach })
            }
            SplatSize::Own => None,
        }
    }
}
