//! Pictures made by hand.

use crate::render::Picture;

/// A picture of a colour per pixel; nothing has a depth.
pub fn colors(width: u32, height: u32, color: impl Fn(u32, u32) -> [u8; 3]) -> Picture {
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let rgba8 = places.flat_map(|(x, y)| {
        let [red, green, blue] = color(x, y);
        [red, green, blue, 255]
    });
    let depth = vec![f32::INFINITY; (width * height) as usize];
    Picture { width, height, rgba8: rgba8.collect(), depth }
}

/// A grey picture.
pub fn grey(width: u32, height: u32, value: impl Fn(u32, u32) -> u8) -> Picture {
    colors(width, height, |x, y| [value(x, y); 3])
}

/// A black picture of these depths.
pub fn depths(width: u32, depths: &[f32]) -> Picture {
    let height = (depths.len() as u32).checked_div(width).unwrap_or(0);
    Picture { depth: depths.to_vec(), ..grey(width, height, |_, _| 0) }
}

/// Grey values in all directions.
pub fn texture(x: u32, y: u32) -> u8 {
    ((x * 7 + y * 13 + x * y) % 256) as u8
}
