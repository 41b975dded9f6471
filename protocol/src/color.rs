//! Colours in two parts: what an overview shows, and the rest.
//!
//! The last bits of a colour are noise, of the sensor and from point to point, that no codec shrinks and that no picture
//! shows which draws the node at about a point a pixel. So group 0 may tell a node's colours to their highest
//! [`COARSE_COLOR_BITS`] only, and the group of fine positions brings the rest. On the level of an aerial scan that
//! matters to its overview whole colours take 13.5 bits a point; parted in two they take 8.0 and 5.8.
//!
//! Parted are `c1`, `c0 - c1` and `c2 - c1` (green, red - green, blue - green), not the channels: differences have
//! few bits, whose last ones are noise as well.

use pco::DeltaSpec;

use crate::{
    attribute::{Attribute, Domain, ScalarType},
    column::{
        Encoding, TRY_RAW_BELOW, check_used, config, encode_column, push_column, push_stream, take,
        take_column, take_stream,
    },
    error::{Result, corrupt},
};

/// Bits of a colour's channels, from the highest that its node uses, that come first.
pub const COARSE_COLOR_BITS: u8 = 6;

/// Bits count as noise up to this times the mean jump of their stream from point to point. Parting those costs up
/// to a quarter of a bit each in all, more of smoother colours a whole one (leaves of an aerial scan: 8.9 instead of 9.2 bits).
const NOISE_PER_JUMP: u64 = 2;

/// Most bits of a channel.
const CHANNEL_BITS: u8 = 16;

/// What coarse colours lack.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FineColors {
    /// Index of the colours in [`Manifest::attributes`](crate::Manifest::attributes).
    pub attribute: usize,
    scalar: ScalarType,
    /// To be added to the coarse ones, modulo the channel's width.
    missing: Vec<[u16; 3]>,
}

impl FineColors {
    /// Makes coarse colours exact; `bytes` are their column's.
    ///
    /// # Errors
    /// [`Error::Corrupt`](crate::Error::Corrupt) where these are not as many.
    pub fn refine(&self, bytes: &mut [u8]) -> Result<()> {
        if bytes.len() != self.missing.len() * 3 * self.scalar.size_bytes() {
            return Err(corrupt("column", "fine colours of another number of points"));
        }
        let missing = self.missing.as_flattened();
        if self.scalar == ScalarType::U8 {
            for (byte, &missing) in bytes.iter_mut().zip(missing) {
                *byte = byte.wrapping_add(missing as u8);
            }
        } else {
            for (value, &missing) in bytes.as_chunks_mut::<2>().0.iter_mut().zip(missing) {
                *value = u16::from_le_bytes(*value).wrapping_add(missing).to_le_bytes();
            }
        }
        Ok(())
    }
}

/// Whether an attribute's values are colours that may be stored in two parts.
#[must_use]
pub fn is_partable_color(attribute: &Attribute) -> bool {
    attribute.domain == Domain::Element
        && attribute.group() == Some(0)
        && is_color(&attribute.name, attribute.scalar, attribute.components)
}

/// Whether values of that name and type are colours as they are stored in two parts.
#[must_use]
pub fn is_color(name: &str, scalar: ScalarType, components: u8) -> bool {
    name == "color" && components == 3 && matches!(scalar, ScalarType::U8 | ScalarType::U16)
}

/// How a node's colours are parted. Every channel is `step` times a number up to `most`.
#[derive(Debug, Clone, Copy)]
struct Parting {
    step: u16,
    most: u16,
    /// Bits that come later: of green, and of red and blue less green.
    low_bits: [u8; 3],
}

impl Parting {
    fn new(scalar: ScalarType, step: u16, most: u16, low_bits: [u8; 3]) -> Result<Self> {
        let widest = if scalar == ScalarType::U8 { u8::MAX.into() } else { u16::MAX };
        let fits = step.checked_mul(most).is_some_and(|largest| largest <= widest);
        if step == 0 || !fits || low_bits.iter().any(|&bits| bits > CHANNEL_BITS) {
            let why = format!("colours of {most} steps of {step}, without {low_bits:?} bits");
            return Err(corrupt("column", why));
        }
        Ok(Self { step, most, low_bits })
    }

    /// `None` where nothing would come later, and nothing can be divided by.
    fn of(scalar: ScalarType, channels: &[u16]) -> Option<Self> {
        let step = channels.iter().fold(0, |step, &channel| {
            if step == 1 { 1 } else { greatest_common_divisor(step, channel) }
        });
        let most = channels.iter().max()?.checked_div(step)?;
        let bits = (u16::BITS - most.leading_zeros()) as u8;
        let whole = Self { step, most, low_bits: [0; 3] };
        let mut jumps = [0; 3];
        let mut last: Option<[i32; 3]> = None;
        for color in channels.as_chunks::<3>().0 {
            let told = whole.told(whole.in_steps(*color));
            let from = last.replace(told).unwrap_or(told);
            (0..3).for_each(|c| jumps[c] += u64::from(told[c].abs_diff(from[c])));
        }
        let points = (channels.len() / 3) as u64;
        let most_low = bits.saturating_sub(COARSE_COLOR_BITS);
        let low_bits = jumps.map(|jumps| {
            let is_noise = |bits: &u8| (points << bits) < NOISE_PER_JUMP * jumps;
            (1..=most_low).take_while(is_noise).last().unwrap_or(0)
        });
        let gains = step > 1 || low_bits != [0; 3];
        if gains { Self::new(scalar, step, most, low_bits).ok() } else { None }
    }

    fn in_steps(self, color: [u16; 3]) -> [i32; 3] {
        color.map(|channel| i32::from(channel / self.step))
    }

    /// What is told first of green and the two differences.
    fn told(self, [red, green, blue]: [i32; 3]) -> [i32; 3] {
        let [g, r, b] = self.low_bits;
        [green >> g, (red - green) >> r, (blue - green) >> b]
    }

    /// The colour that is shown for it: in the middle of what it may be.
    fn shown(self, told: [i32; 3]) -> [i32; 3] {
        let middle = |c: usize| {
            let side = 1i64 << self.low_bits[c];
            i64::from(told[c]) * side + side / 2
        };
        let green = middle(0);
        [green + middle(1), green, green + middle(2)].map(|v| v.clamp(0, self.most.into()) as i32)
    }

    fn push(self, data: &mut Vec<u8>) {
        data.extend_from_slice(&self.step.to_le_bytes());
        data.extend_from_slice(&self.most.to_le_bytes());
        data.extend_from_slice(&self.low_bits);
    }

    fn take(scalar: ScalarType, data: &mut &[u8]) -> Result<Self> {
        let head = take(data, 7)?;
        let word = |at: usize| u16::from_le_bytes([head[at], head[at + 1]]);
        Self::new(scalar, word(0), word(2), [head[4], head[5], head[6]])
    }
}

const fn greatest_common_divisor(mut a: u16, mut b: u16) -> u16 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

/// Appends the colours of one node, `values` interleaved and little-endian, to the payload of group 0 and, where they
/// are parted, of the fine group. Constant, dark, smooth and few colours are not.
///
/// # Errors
/// [`Error::Corrupt`](crate::Error::Corrupt) where `values` is no whole number of values or too large.
pub fn encode_colors(
    coarse: &mut Vec<u8>,
    fine: &mut Vec<u8>,
    attribute: &Attribute,
    values: &[u8],
) -> Result<()> {
    let value_bytes = attribute.value_bytes();
    let is_constant = || values.chunks_exact(value_bytes).all(|v| v == &values[..value_bytes]);
    if !is_partable_color(attribute)
        || !values.len().is_multiple_of(value_bytes)
        || values.len() / value_bytes < TRY_RAW_BELOW
        || is_constant()
    {
        return encode_column(coarse, attribute, values);
    }
    let channels: Vec<u16> = match attribute.scalar {
        ScalarType::U8 => values.iter().map(|&v| v.into()).collect(),
        _ => values.as_chunks::<2>().0.iter().map(|&v| u16::from_le_bytes(v)).collect(),
    };
    let Some(parting) = Parting::of(attribute.scalar, &channels) else {
        return encode_column(coarse, attribute, values);
    };
    let mut first = [const { Vec::new() }; 3];
    let mut rest = [const { Vec::new() }; 3];
    for color in channels.as_chunks::<3>().0 {
        let exact = parting.in_steps(*color);
        let told = parting.told(exact);
        let shown = parting.shown(told);
        let [red, green, blue] = [0, 1, 2].map(|c| exact[c] - shown[c]);
        for (c, (told, missing)) in
            told.into_iter().zip([green, red - green, blue - green]).enumerate()
        {
            first[c].push(told);
            rest[c].push(missing);
        }
    }
    let mut data = Vec::new();
    parting.push(&mut data);
    let changing = config(ScalarType::I32, DeltaSpec::TryConsecutive(1));
    first.iter().try_for_each(|stream| push_stream(&mut data, stream, &changing))?;
    push_column(coarse, Encoding::CoarseColor, &data)?;
    if parting.low_bits == [0; 3] {
        return Ok(());
    }
    data.clear();
    data.extend_from_slice(&parting.step.to_le_bytes());
    // Noise: what the bits need, and no search for patterns.
    let noise = config(ScalarType::I32, DeltaSpec::NoOp);
    rest.iter().try_for_each(|stream| push_stream(&mut data, stream, &noise))?;
    push_column(fine, Encoding::FineColor, &data)
}

/// The colours that are shown for coarse ones, as the column of exact ones would be; and whether they lack
/// anything. `None` where the next column is not one of those.
pub(crate) fn decode_coarse_colors(
    bytes: &mut &[u8],
    scalar: ScalarType,
    count: usize,
) -> Result<Option<(Vec<u8>, bool)>> {
    if bytes.first() != Some(&(Encoding::CoarseColor as u8)) {
        return Ok(None);
    }
    let (_, mut data) = take_column(bytes)?;
    let parting = Parting::take(scalar, &mut data)?;
    let streams = take_three(&mut data, count)?;
    check_used(data)?;
    let mut shown_bytes = Vec::with_capacity(count * 3 * scalar.size_bytes());
    for point in 0..count {
        let shown = parting.shown([0, 1, 2].map(|c| streams[c][point]));
        // At most the type's largest: see `Parting::new`.
        let channels = shown.map(|v| v as u16 * parting.step);
        if scalar == ScalarType::U8 {
            shown_bytes.extend(channels.map(|channel| channel as u8));
        } else {
            channels
                .iter()
                .for_each(|channel| shown_bytes.extend_from_slice(&channel.to_le_bytes()));
        }
    }
    Ok(Some((shown_bytes, parting.low_bits != [0; 3])))
}

/// What the coarse colours of `attribute`, the manifest's number `index`, lack.
pub(crate) fn decode_fine_colors(
    bytes: &mut &[u8],
    attribute: &Attribute,
    index: usize,
    count: usize,
) -> Result<FineColors> {
    let (encoding, mut data) = take_column(bytes)?;
    if encoding != Encoding::FineColor {
        return Err(corrupt("column", format!("{encoding:?} as fine colours")));
    }
    let scalar = attribute.scalar;
    let step = take(&mut data, 2)?;
    let step = i32::from(u16::from_le_bytes([step[0], step[1]]));
    let [green, red, blue] = take_three(&mut data, count)?;
    check_used(data)?;
    let missing = green.into_iter().zip(red.into_iter().zip(blue)).map(|(green, (red, blue))| {
        [green.wrapping_add(red), green, green.wrapping_add(blue)]
            .map(|v| v.wrapping_mul(step) as u16)
    });
    Ok(FineColors { attribute: index, scalar, missing: missing.collect() })
}

fn take_three(data: &mut &[u8], count: usize) -> Result<[Vec<i32>; 3]> {
    Ok([take_stream(data, count)?, take_stream(data, count)?, take_stream(data, count)?])
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::{attribute::Storage, column::decode_column};

    fn attribute(scalar: ScalarType) -> Attribute {
        Attribute {
            name: "color".into(),
            scalar,
            components: 3,
            domain: Domain::Element,
            storage: Storage::Column { group: 0 },
            min: vec![],
            max: vec![],
        }
    }

    fn bytes_of(scalar: ScalarType, channels: &[u16]) -> Vec<u8> {
        let size = scalar.size_bytes();
        channels.iter().flat_map(|c| c.to_le_bytes()[..size].to_vec()).collect()
    }

    /// The parts, the colours shown for the first, and whether there is a second.
    fn parted(scalar: ScalarType, channels: &[u16]) -> (Vec<u8>, Vec<u8>, Vec<u8>) {
        let (mut coarse, mut fine) = (Vec::new(), Vec::new());
        let values = bytes_of(scalar, channels);
        encode_colors(&mut coarse, &mut fine, &attribute(scalar), &values).expect("colours");
        let (mut rest, count) = (&coarse[..], channels.len() / 3);
        let parted = decode_coarse_colors(&mut rest, scalar, count).expect("decodes");
        let shown = match parted {
            Some((shown, is_coarse)) => {
                assert_eq!(is_coarse, !fine.is_empty());
                shown
            }
            None => decode_column(&mut rest, &attribute(scalar), count).expect("decodes"),
        };
        assert!(rest.is_empty());
        (coarse, fine, shown)
    }

    fn refined(scalar: ScalarType, fine: &[u8], shown: &[u8], count: usize) -> Vec<u8> {
        let mut exact = shown.to_vec();
        if !fine.is_empty() {
            let fine =
                decode_fine_colors(&mut &fine[..], &attribute(scalar), 0, count).expect("decodes");
            fine.refine(&mut exact).expect("as many");
        }
        exact
    }

    proptest! {
        #[test]
        fn the_first_part_is_near_and_both_are_exact(
            is_narrow in any::<bool>(), step in prop::sample::select(vec![1u16, 2, 3, 256, 257]),
            most in 1u16.., colors in prop::collection::vec(any::<[u16; 3]>(), 256..600),
        ) {
            let scalar = if is_narrow { ScalarType::U8 } else { ScalarType::U16 };
            let widest = if is_narrow { 255 } else { u16::MAX };
            let steps = u32::from(most.min(widest) / step) + 1;
            let channels: Vec<u16> = colors.as_flattened().iter()
                .map(|&c| (u32::from(c) % steps) as u16 * step).collect();
            let (_, fine, shown) = parted(scalar, &channels);
            prop_assert_eq!(refined(scalar, &fine, &shown, colors.len()), bytes_of(scalar, &channels));
            // Green by half a step of its last told bit, the others by that of the difference besides.
            let highest = u32::from(*channels.iter().max().expect("some"));
            let near = if fine.is_empty() { 0 } else { (highest >> (COARSE_COLOR_BITS - 1)).max(2 * u32::from(step)) };
            let size = scalar.size_bytes();
            for (shown, &exact) in shown.chunks_exact(size).zip(&channels) {
                let shown = scalar.to_f64(shown) as u32;
                prop_assert!(shown.abs_diff(exact.into()) <= near, "{shown} for {exact} of {highest}");
            }
        }

        #[test]
        fn garbage_never_panics(
            bytes in prop::collection::vec(any::<u8>(), 0..300), count in 0usize..1000, is_narrow in any::<bool>(),
        ) {
            let scalar = if is_narrow { ScalarType::U8 } else { ScalarType::U16 };
            let _ = decode_coarse_colors(&mut &bytes[..], scalar, count);
            let _ = decode_fine_colors(&mut &bytes[..], &attribute(scalar), 0, count);
        }
    }

    #[test]
    fn streams_of_any_numbers_decode_to_colours() {
        for (scalar, step, most, low_bits) in [
            (ScalarType::U8, 1, 255, [2, 1, 0]),
            (ScalarType::U16, 257, 255, [0, 2, 16]),
            (ScalarType::U16, 60_000, 1, [10; 3]),
        ] {
            let mut data = Vec::new();
            Parting::new(scalar, step, most, low_bits).expect("can be").push(&mut data);
            let extremes = [i32::MIN, -1, 0, 1, i32::MAX];
            let config = config(ScalarType::I32, DeltaSpec::NoOp);
            (0..3).for_each(|_| push_stream(&mut data, &extremes, &config).expect("a stream"));
            let mut column = Vec::new();
            push_column(&mut column, Encoding::CoarseColor, &data).expect("a column");
            let shown = decode_coarse_colors(&mut &column[..], scalar, extremes.len());
            let (shown, _) = shown.expect("colours").expect("coarse ones");
            assert_eq!(shown.len(), extremes.len() * 3 * scalar.size_bytes());
        }
    }

    #[test]
    fn dark_smooth_few_and_constant_colours_are_told_at_once() {
        let dark: Vec<u16> = (0..900).map(|i| i % 64).collect();
        let smooth: Vec<u16> = (0..900).map(|i| 257 * (i / 30 * 8 + i % 3)).collect();
        let few: Vec<u16> = (0..30).map(|i| i * 8).collect();
        let constant = [200, 100, 255].repeat(300);
        for channels in [dark, smooth, few, constant] {
            let (_, fine, shown) = parted(ScalarType::U16, &channels);
            assert!(fine.is_empty() && shown == bytes_of(ScalarType::U16, &channels));
        }
    }

    #[test]
    fn colours_that_were_scaled_to_16_bits_take_what_those_of_8_bits_take() {
        let channels: Vec<u16> =
            (0..9000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u16).collect();
        let (coarse, fine, _) = parted(ScalarType::U16, &channels);
        assert!(!fine.is_empty());
        for step in [256, 257] {
            let scaled: Vec<u16> = channels.iter().map(|&c| c * step).collect();
            let (scaled_coarse, scaled_fine, _) = parted(ScalarType::U16, &scaled);
            assert_eq!((scaled_coarse.len(), scaled_fine.len()), (coarse.len(), fine.len()));
        }
    }

    #[test]
    fn fine_colours_of_other_points_are_refused() {
        let channels: Vec<u16> = (0..900).map(|i| i % 256).collect();
        let (_, fine, shown) = parted(ScalarType::U8, &channels);
        let fine = decode_fine_colors(&mut &fine[..], &attribute(ScalarType::U8), 0, 300)
            .expect("decodes");
        let error = fine.refine(&mut shown[3..].to_vec()).expect_err("one less").to_string();
        assert!(error.contains("another number of points"), "{error}");
    }
}
