//! Random numbers by counter: a number is a hash of who asks for it, so that rays can be cast in
//! any order, by any number of threads, and give the same bytes.

use glam::Vec3;

/// A short stream of random numbers that belongs to one ray (or one leaf, one roof tile).
#[derive(Debug, Clone)]
pub struct Random {
    state: u64,
}

/// Finaliser of SplitMix64 (Steele, Lea and Flood 2014): every input bit reaches every output bit.
#[inline]
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

impl Random {
    /// The stream of the owner named by `key`; different keys give unrelated streams.
    #[inline]
    #[must_use]
    pub fn of(key: [u64; 4]) -> Self {
        let state = key.iter().fold(0x6A09_E667_F3BC_C909, |state, &k| {
            mix(state ^ k).wrapping_add(0x9E37_79B9_7F4A_7C15)
        });
        Self { state }
    }

    #[inline]
    fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        mix(self.state)
    }

    /// Two numbers uniform in [0, 1), on a grid of 2^-24.
    #[inline]
    pub fn pair(&mut self) -> (f32, f32) {
        const STEP: f32 = 1.0 / (1 << 24) as f32;
        let bits = self.next();
        ((bits >> 40) as f32 * STEP, (bits & 0xFF_FFFF) as f32 * STEP)
    }

    /// Uniform in [0, 1).
    #[inline]
    pub fn unit(&mut self) -> f32 {
        self.pair().0
    }

    /// Uniform in [0, 1) with all the digits of f64.
    #[inline]
    pub fn unit_f64(&mut self) -> f64 {
        (self.next() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in [low, high).
    #[inline]
    pub fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// Normal with mean 0 and deviation 1, bounded by [`GAUSSIAN_BOUND`].
    ///
    /// The sum of eight uniform numbers: the bound is what lets a test say that no point is farther
    /// from its surface than the noise allows.
    #[inline]
    pub fn gaussian(&mut self) -> f32 {
        let (a, b) = (self.next(), self.next());
        let mut sum = 0u64;
        for shift in [0, 16, 32, 48] {
            sum += ((a >> shift) & 0xFFFF) + ((b >> shift) & 0xFFFF);
        }
        // Eight uniforms on [0, 1): mean 4, variance 8/12.
        (sum as f32 * (1.0 / 65536.0) - 4.0) * 1.224_744_9
    }

    /// A direction uniform on the sphere.
    pub fn direction(&mut self) -> Vec3 {
        loop {
            let (x, y) = self.pair();
            let v = Vec3::new(2.0 * x - 1.0, 2.0 * y - 1.0, 2.0 * self.unit() - 1.0);
            let length = v.length();
            if length > 1e-3 && length <= 1.0 {
                return v / length;
            }
        }
    }
}

/// No [`Random::gaussian`] is larger than this.
pub const GAUSSIAN_BOUND: f32 = 4.9;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaussian_has_the_stated_moments_and_bound() {
        let mut random = Random::of([1, 2, 3, 4]);
        let n = 200_000;
        let (mut sum, mut squares) = (0.0f64, 0.0f64);
        for _ in 0..n {
            let g = random.gaussian();
            assert!(g.abs() <= GAUSSIAN_BOUND);
            sum += f64::from(g);
            squares += f64::from(g * g);
        }
        assert!((sum / f64::from(n)).abs() < 0.01);
        assert!((squares / f64::from(n) - 1.0).abs() < 0.02);
    }

    #[test]
    fn neighbouring_keys_are_unrelated() {
        let draw = |k| Random::of([k, 0, 0, 0]).unit_f64();
        let n = 10_000u64;
        let mean = (0..n).map(draw).sum::<f64>() / n as f64;
        assert!((mean - 0.5).abs() < 0.02);
        let lag = (0..n).map(|k| (draw(k) - 0.5) * (draw(k + 1) - 0.5)).sum::<f64>() / n as f64;
        assert!(lag.abs() < 0.004, "{lag}");
    }
}
