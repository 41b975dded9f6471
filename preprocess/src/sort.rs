//! Stable radix sort of Morton codes with their points' indices.
//!
//! Written out because the pair of arrays is sorted in a known number of bits: least significant
//! digit first, eleven bits a pass, passes in which all digits agree left out. Stability keeps points
//! that coincide in input order, and so the dataset's bytes the same for any number of threads.

use lodestream_protocol::MortonCode;

const DIGIT_BITS: u32 = 11;
const DIGITS: usize = 1 << DIGIT_BITS;

/// Sorts `codes` of `code_bits` significant bits, and `indices` along with them.
pub fn sort_by_code<C: MortonCode>(codes: &mut Vec<C>, indices: &mut Vec<u32>, code_bits: u32) {
    let passes = code_bits.div_ceil(DIGIT_BITS);
    let digit = |code: &C, pass: u32| code.low_u64((pass * DIGIT_BITS) as u8) as usize % DIGITS;
    let mut histograms = vec![[0u32; DIGITS]; passes as usize];
    for code in codes.iter() {
        for (pass, histogram) in histograms.iter_mut().enumerate() {
            histogram[digit(code, pass as u32)] += 1;
        }
    }
    let mut other_codes = codes.clone();
    let mut other_indices = indices.clone();
    for (pass, histogram) in histograms.iter_mut().enumerate() {
        if histogram.iter().any(|&n| n as usize == codes.len()) {
            continue;
        }
        let mut next = 0;
        for slot in histogram.iter_mut() {
            (*slot, next) = (next, next + *slot);
        }
        for (code, index) in codes.iter().zip(indices.iter()) {
            let slot = &mut histogram[digit(code, pass as u32)];
            other_codes[*slot as usize] = *code;
            other_indices[*slot as usize] = *index;
            *slot += 1;
        }
        std::mem::swap(codes, &mut other_codes);
        std::mem::swap(indices, &mut other_indices);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn sorts_like_the_standard_stable_sort(values in prop::collection::vec(any::<[u32; 3]>(), 0..300)) {
            let mut codes: Vec<u128> = values.iter().map(|q| u128::encode(q.map(|c| c & 0xff_ff07))).collect();
            let mut indices: Vec<u32> = (0..codes.len() as u32).collect();
            let mut expected: Vec<(u128, u32)> = codes.iter().copied().zip(indices.iter().copied()).collect();
            expected.sort_by_key(|e| e.0);
            sort_by_code(&mut codes, &mut indices, 96);
            let sorted: Vec<(u128, u32)> = codes.into_iter().zip(indices).collect();
            prop_assert_eq!(sorted, expected);
        }
    }
}
