//! Which pixels a splat covers: the rule, in f64. The WGSL twins are `shaders/footprint_*.wgsl`.

use crate::render::{settings::Splat, view::Projected};

/// Calls `cover` with the index (row by row) of every covered pixel of a picture of the given size.
///
/// A point of this function's kind is a square: its size is that of a pixel.
#[inline]
pub(super) fn for_each_pixel(
    splat: Splat,
    at: &Projected,
    size: f64,
    [width, height]: [usize; 2],
    mut cover: impl FnMut(usize),
) {
    let columns = span(at.x, size, width);
    let radius_squared = 0.25 * size * size;
    for row in span(at.y, size, height) {
        for column in columns.clone() {
            let inside = match splat {
                Splat::Point | Splat::Square => true,
                _ => {
                    let dx = column as f64 + 0.5 - at.x;
                    let dy = row as f64 + 0.5 - at.y;
                    let holds_center = dx.abs() <= 0.5
                        && dy.abs() <= 0.5
                        && column == at.x as usize
                        && row == at.y as usize;
                    dx * dx + dy * dy <= radius_squared || holds_center
                }
            };
            if inside {
                cover(row * width + column);
            }
        }
    }
}

/// The pixels of a row or column of `length` whose middles m satisfy
/// `center - size / 2 < m <= center + size / 2`.
#[inline]
fn span(center: f64, size: f64, length: usize) -> std::ops::Range<usize> {
    // Casts from float saturate: what lies before the picture is 0, what lies behind it is more
    // than `length`. NaN is 0 and cannot come here: View::project refuses it.
    let first = (center - 0.5 * size + 0.5).floor() as usize;
    let end = (center + 0.5 * size + 0.5).floor() as usize;
    first.min(length)..end.min(length)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pixels(splat: Splat, x: f64, y: f64, size: f64) -> Vec<(usize, usize)> {
        let mut covered = Vec::new();
        let at = Projected { x, y, distance: 1.0, scale: 1.0 };
        for_each_pixel(splat, &at, size, [8, 6], |i| covered.push((i % 8, i / 8)));
        covered
    }

    #[test]
    fn the_smallest_splat_is_the_pixel_that_holds_its_centre() {
        for splat in [Splat::Point, Splat::Square, Splat::Circle] {
            for (x, y) in [(3.0, 2.0), (3.01, 2.99), (3.5, 2.5), (3.999, 2.001)] {
                assert_eq!(pixels(splat, x, y, 1.0), [(3, 2)], "{splat:?} at {x}, {y}");
            }
        }
    }

    #[test]
    fn a_square_covers_the_pixels_whose_middle_it_holds() {
        assert_eq!(pixels(Splat::Square, 3.0, 2.0, 2.0), [(2, 1), (3, 1), (2, 2), (3, 2)]);
        assert_eq!(pixels(Splat::Square, 3.6, 2.4, 1.9).len(), 4);
        assert_eq!(pixels(Splat::Square, 3.5, 2.5, 3.0).len(), 9);
    }

    #[test]
    fn a_circle_leaves_the_corners_out() {
        let circle = pixels(Splat::Circle, 3.5, 2.5, 5.0);
        assert_eq!(circle.len(), 21);
        assert!(!circle.contains(&(1, 0)) && circle.contains(&(2, 0)));
    }

    #[test]
    fn splats_are_cut_at_the_edges_of_the_picture() {
        assert_eq!(pixels(Splat::Square, 0.0, 0.0, 4.0).len(), 4);
        assert_eq!(pixels(Splat::Square, 8.0, 6.0, 4.0).len(), 4);
        assert_eq!(pixels(Splat::Circle, 4.0, 3.0, 1000.0).len(), 48);
        assert!(pixels(Splat::Square, -5.0, 3.0, 4.0).is_empty());
        assert!(pixels(Splat::Circle, 1e300, 3.0, 4.0).is_empty());
    }
}
