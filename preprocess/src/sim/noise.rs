//! Value noise: the irregularity in every texture.
//!
//! A hash gives each lattice point a number, and positions between are interpolated smoothly
//! (Ebert et al., *Texturing and Modeling*, ch. 2). Three orders cheaper than looking up an image,
//! and it has detail at every scale, which a scan of 10^9 points needs.

use glam::{Vec2, Vec3};

/// Hash of a lattice point to [0, 1).
#[inline]
pub fn lattice(x: i32, y: i32, z: i32, salt: u32) -> f32 {
    let mut h = x.cast_unsigned().wrapping_mul(0x9E37_79B1)
        ^ y.cast_unsigned().wrapping_mul(0x85EB_CA77)
        ^ z.cast_unsigned().wrapping_mul(0xC2B2_AE3D)
        ^ salt.wrapping_mul(0x27D4_EB2F);
    h ^= h >> 15;
    h = h.wrapping_mul(0x2C1B_3C6D);
    h ^= h >> 12;
    h = h.wrapping_mul(0x297A_2D39);
    h ^= h >> 15;
    (h >> 8) as f32 * (1.0 / (1 << 24) as f32)
}

/// Whole part and fraction, downward. (`f32::floor` is a function call on the baseline x86-64.)
#[inline]
pub fn split(x: f32) -> (i32, f32) {
    let truncated = x as i32;
    let whole = truncated - i32::from(x < truncated as f32);
    (whole, x - whole as f32)
}

/// 0 below `low`, 1 above `high`, smooth between.
#[inline]
pub fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[inline]
fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

#[inline]
fn fade(t: f32) -> f32 {
    t * t * (3.0 - 2.0 * t)
}

/// Noise in the plane, in [0, 1), features one unit across.
#[inline]
pub fn noise2(p: Vec2, salt: u32) -> f32 {
    let ((x, fx), (y, fy)) = (split(p.x), split(p.y));
    let (u, v) = (fade(fx), fade(fy));
    lerp(
        lerp(lattice(x, y, 0, salt), lattice(x + 1, y, 0, salt), u),
        lerp(lattice(x, y + 1, 0, salt), lattice(x + 1, y + 1, 0, salt), u),
        v,
    )
}

/// Noise in space, in [0, 1), features one unit across.
#[inline]
pub fn noise3(p: Vec3, salt: u32) -> f32 {
    let ((x, fx), (y, fy), (z, fz)) = (split(p.x), split(p.y), split(p.z));
    let (u, v, w) = (fade(fx), fade(fy), fade(fz));
    let layer = |z| {
        lerp(
            lerp(lattice(x, y, z, salt), lattice(x + 1, y, z, salt), u),
            lerp(lattice(x, y + 1, z, salt), lattice(x + 1, y + 1, z, salt), u),
            v,
        )
    };
    lerp(layer(z), layer(z + 1), w)
}

/// Three octaves of [`noise2`], in [0, 1).
pub fn clouds2(p: Vec2, salt: u32) -> f32 {
    (noise2(p, salt) * 4.0 + noise2(p * 2.17, salt + 1) * 2.0 + noise2(p * 4.63, salt + 2)) / 7.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_continuous_and_stays_in_range() {
        let mut last = noise3(Vec3::new(-2.0, 0.3, 7.7), 3);
        for i in 1..4000 {
            let value = noise3(Vec3::new(-2.0 + i as f32 * 1e-3, 0.3, 7.7), 3);
            assert!((0.0..1.0).contains(&value));
            assert!((value - last).abs() < 4e-3);
            last = value;
        }
    }

    #[test]
    fn split_rounds_down_on_both_sides_of_zero() {
        assert_eq!(split(1.25), (1, 0.25));
        assert_eq!(split(-0.25), (-1, 0.75));
        assert_eq!(split(-2.0), (-2, 0.0));
    }
}
