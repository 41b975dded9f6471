//! Morton codes: the bits of three coordinates interleaved, x lowest.
//!
//! Order by Morton code is order by octree: all points of a node are neighbours in memory. `u64`
//! holds 21 bits an axis, enough for most datasets; `u128` holds 32.

/// An integer wide enough for a Morton code.
pub trait MortonCode: Copy + Ord + Send + Sync + std::fmt::Debug + 'static {
    /// Most bits per axis.
    const AXIS_BITS: u8;
    /// Interleaves the low [`AXIS_BITS`](Self::AXIS_BITS) bits of each coordinate.
    fn encode(q: [u32; 3]) -> Self;
    /// Undoes [`encode`](Self::encode).
    fn decode(self) -> [u32; 3];
    /// The code of the cube `axis_bits` levels up that holds this one: `self >> 3 * axis_bits`.
    #[must_use]
    fn up(self, axis_bits: u8) -> Self;
    /// Bits `shift ..` truncated to u64.
    fn low_u64(self, shift: u8) -> u64;
    /// The code within its cube of `axis_bits` levels: the low `3 * axis_bits` bits.
    #[must_use]
    fn within(self, axis_bits: u8) -> Self;
}

const fn spread(v: u32) -> u64 {
    let mut v = v as u64 & 0x1f_ffff;
    v = (v | v << 32) & 0x001f_0000_0000_ffff;
    v = (v | v << 16) & 0x001f_0000_ff00_00ff;
    v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

const fn compact(code: u64) -> u32 {
    let mut v = code & 0x1249_2492_4924_9249;
    v = (v | v >> 2) & 0x10c3_0c30_c30c_30c3;
    v = (v | v >> 4) & 0x100f_00f0_0f00_f00f;
    v = (v | v >> 8) & 0x001f_0000_ff00_00ff;
    v = (v | v >> 16) & 0x001f_0000_0000_ffff;
    ((v | v >> 32) & 0x1f_ffff) as u32
}

/// Morton code of three coordinates of at most 21 bits each.
#[must_use]
pub const fn morton_encode([x, y, z]: [u32; 3]) -> u64 {
    spread(x) | spread(y) << 1 | spread(z) << 2
}

/// The coordinates of a 63-bit Morton code.
#[must_use]
pub const fn morton_decode(code: u64) -> [u32; 3] {
    [compact(code), compact(code >> 1), compact(code >> 2)]
}

impl MortonCode for u64 {
    const AXIS_BITS: u8 = 21;

    fn encode(q: [u32; 3]) -> Self {
        morton_encode(q)
    }

    fn decode(self) -> [u32; 3] {
        morton_decode(self)
    }

    fn up(self, axis_bits: u8) -> Self {
        self.checked_shr(3 * u32::from(axis_bits)).unwrap_or(0)
    }

    fn low_u64(self, shift: u8) -> u64 {
        self.checked_shr(u32::from(shift)).unwrap_or(0)
    }

    fn within(self, axis_bits: u8) -> Self {
        let cut = 1u64.checked_shl(3 * u32::from(axis_bits));
        cut.map_or(self, |cut| self & (cut - 1))
    }
}

impl MortonCode for u128 {
    const AXIS_BITS: u8 = 32;

    fn encode(q: [u32; 3]) -> Self {
        let low = morton_encode(q.map(|c| c & 0x1f_ffff));
        let high = morton_encode(q.map(|c| c >> 21));
        Self::from(high) << 63 | Self::from(low)
    }

    fn decode(self) -> [u32; 3] {
        let low = morton_decode((self & ((1 << 63) - 1)) as u64);
        let high = morton_decode((self >> 63) as u64);
        std::array::from_fn(|a| high[a] << 21 | low[a])
    }

    fn up(self, axis_bits: u8) -> Self {
        self.checked_shr(3 * u32::from(axis_bits)).unwrap_or(0)
    }

    fn low_u64(self, shift: u8) -> u64 {
        self.checked_shr(u32::from(shift)).unwrap_or(0) as u64
    }

    fn within(self, axis_bits: u8) -> Self {
        let cut = 1u128.checked_shl(3 * u32::from(axis_bits));
        cut.map_or(self, |cut| self & (cut - 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn decode_undoes_encode(q in any::<[u32; 3]>()) {
            prop_assert_eq!(u128::encode(q).decode(), q);
            let q = q.map(|c| c & 0x1f_ffff);
            prop_assert_eq!(u64::encode(q).decode(), q);
            prop_assert_eq!(u128::from(u64::encode(q)), u128::encode(q));
        }
    }

    #[test]
    fn x_is_the_lowest_bit() {
        assert_eq!(morton_encode([1, 0, 0]), 1);
        assert_eq!(morton_encode([0, 1, 0]), 2);
        assert_eq!(morton_encode([0, 0, 1]), 4);
        assert_eq!(morton_encode([2, 3, 0]), 0b011_010);
        assert_eq!(morton_encode([2, 3, 0]), 26);
    }
}
