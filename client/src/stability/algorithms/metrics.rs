//! Similarity of pictures.

use super::Rows;
use crate::{
    metrics::{PictureError, ssim},
    render::Picture,
    stability::{
        Row,
        exact::{Big, apart, big, decimal, relative, whole},
    },
};

const REFERENCE: &str = "Wang 2004, eq. 13, in 512-bit floats";
const CANCELS: &str = "variances as differences of squares up to 255², beside a constant of 58.5";
const TOLERANCE: f64 = 1e-12;

pub(super) fn cases() -> Rows {
    let flat = |side: [u32; 2], value: u8| picture(side, |_, _| value);
    let checkers = |x: u32, y: u32| if (x + y).is_multiple_of(2) { 255 } else { 0 };
    let one_off = |x: u32, y: u32| if (x, y) == (5, 5) { 254 } else { 255 };
    let window = [11, 11];
    let pairs = [
        ("black and white, constant", flat(window, 0), flat(window, 255)),
        ("white, constant, and the same", flat(window, 255), flat(window, 255)),
        ("nearly white and white, constant", flat(window, 254), flat(window, 255)),
        ("a checkerboard and its negative", picture(window, checkers), {
            picture(window, |x, y| 255 - checkers(x, y))
        }),
        ("a checkerboard and grey", picture(window, checkers), flat(window, 127)),
        ("one pixel of a white picture off by one", picture(window, one_off), flat(window, 255)),
    ];
    let mut rows = Vec::new();
    for (case, a, b) in pairs {
        let exact = exact(&a, &b);
        let found = ssim(&a, &b).unwrap_or(f64::NAN);
        rows.push(
            Row::new(case, (apart(found, &exact), "of 1"), (TOLERANCE, CANCELS), REFERENCE)
                .beside("single precision", apart(in_single(&a, &b), &exact)),
        );
    }
    // 11 rows of the longest side: every window alike.
    let [a, b] = [0, 255].map(|value| flat([16_384, 11], value));
    let found = ssim(&a, &b).unwrap_or(f64::NAN);
    let expected = exact(&flat(window, 0), &flat(window, 255));
    rows.push(Row::new(
        "16384 x 11, black and white",
        (apart(found, &expected), "of 1"),
        (TOLERANCE, "a mean of equal numbers"),
        REFERENCE,
    ));
    for (case, side) in [
        ("1 x 1", [1, 1]),
        ("16384 x 1", [16_384, 1]),
        ("1 x 16384", [1, 16_384]),
        ("0 x 0", [0, 0]),
    ] {
        rows.push(Row::holds(
            format!("a picture of {case}"),
            ssim(&flat(side, 9), &flat(side, 9)).is_err(),
            "no window of 11 x 11 fits: there is no number, and that is what is said",
            "nothing",
        ));
    }
    rows.extend(others());
    Ok(rows)
}

/// Squared errors and depths.
fn others() -> Vec<Row> {
    let [black, white] = [0, 255].map(|value| picture([16_384, 1], |_, _| value));
    let psnr = |a: &Picture, b: &Picture| {
        PictureError::between(a, b).ok().and_then(|error| error.psnr_db).unwrap_or(f64::NAN)
    };
    let nearly = picture([16_384, 1], |x, _| if x == 0 { 254 } else { 255 });
    // One unit in 16384 pixels: 10 log10(255² · 16384).
    let exact = whole(10) * whole(255 * 255 * 16_384).ln() / whole(10).ln();
    let mut far = picture([4, 1], |_, _| 9);
    let mut near = far.clone();
    far.depth = vec![1e-3, 1e7, 1e10, f32::INFINITY];
    near.depth = vec![2e-3, 1e7 + 1.0, 1e10, 5.0];
    let depth = PictureError::between(&near, &far).ok().and_then(|error| error.depth);
    let differences = [(2e-3f32, 1e-3f32), (1e7 + 1.0, 1e7), (1e10, 1e10)];
    let squares = differences.iter().fold(whole(0), |sum, &(a, b)| {
        let d = big(f64::from(a)) - big(f64::from(b));
        sum + &d * &d
    });
    let rmse = (squares / whole(3)).sqrt();
    let nothing = picture([0, 0], |_, _| 0);
    let one = picture([1, 1], |_, _| 7);
    let sane = PictureError::between(&one, &one)
        .is_ok_and(|error| error.ssim.is_none() && error.mse == Some(0.0))
        && PictureError::between(&nothing, &nothing)
            .is_ok_and(|error| error.mse.is_none() && error.psnr_db.is_none());
    vec![
        Row::new(
            "PSNR of black and white, 16384 x 1",
            (apart(psnr(&black, &white), &whole(0)), "dB"),
            (1e-14, "the logarithm of one"),
            "0 dB: the largest error there is",
        ),
        Row::new(
            "PSNR of one unit in one of 16384 pixels",
            (relative(psnr(&nearly, &white), &exact), "of the value"),
            (4.0 * f64::EPSILON, "sums of integers; a quotient, a logarithm and a product"),
            "512-bit logarithms",
        ),
        Row::new(
            "depths from 10^-3 to 10^10, one of them infinite",
            (depth.map_or(f64::NAN, |depth| relative(depth.rmse, &rmse)), "of the value"),
            (4.0 * f64::EPSILON, "differences of singles are exact in doubles"),
            "the root of the mean square, in 512-bit floats",
        ),
        Row::holds(
            "1 x 1 and 0 x 0: what does not exist has no value",
            sane,
            "no mean of nothing, and none that is no number",
            "nothing",
        ),
    ]
}

fn picture([width, height]: [u32; 2], value: impl Fn(u32, u32) -> u8) -> Picture {
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let rgba8 = places.flat_map(|(x, y)| [value(x, y), value(x, y), value(x, y), 255]).collect();
    Picture { width, height, rgba8, depth: vec![0.0; width as usize * height as usize] }
}

/// Of pictures of one window.
fn exact(a: &Picture, b: &Picture) -> Big {
    let sigma = decimal("1.5");
    let weight = |i: i128| (-whole((i - 5) * (i - 5)) / (whole(2) * &sigma * &sigma)).exp();
    let weights: Vec<Big> = (0..11).map(weight).collect();
    let sum = weights.iter().fold(whole(0), |sum, weight| sum + weight);
    // Grey: its luma is its value, whatever the parts of red, green and blue.
    let mean = |value: &dyn Fn(usize) -> Big| {
        let mut mean = whole(0);
        for y in 0..11 {
            for x in 0..11 {
                mean += &weights[x] * &weights[y] * value(11 * y + x);
            }
        }
        mean / &sum / &sum
    };
    let of = |picture: &Picture, i: usize| big(f64::from(picture.rgba8[4 * i]));
    let (mean_a, mean_b) = (mean(&|i| of(a, i)), mean(&|i| of(b, i)));
    let centred = |p: &Picture, m: &Big, i: usize| of(p, i) - m;
    let variance_a = mean(&|i| centred(a, &mean_a, i) * centred(a, &mean_a, i));
    let variance_b = mean(&|i| centred(b, &mean_b, i) * centred(b, &mean_b, i));
    let covariance = mean(&|i| centred(a, &mean_a, i) * centred(b, &mean_b, i));
    let square = |v: Big| &v * &v;
    let c1 = square(decimal("0.01") * whole(255));
    let c2 = square(decimal("0.03") * whole(255));
    (whole(2) * &mean_a * &mean_b + &c1) * (whole(2) * covariance + &c2)
        / ((&mean_a * &mean_a + &mean_b * &mean_b + c1) * (variance_a + variance_b + c2))
}

/// The same formula in floats of 32 bits.
fn in_single(a: &Picture, b: &Picture) -> f64 {
    let weight = |i: usize| (-((i as f32 - 5.0).powi(2)) / 4.5).exp();
    let sum: f32 = (0..11).map(weight).sum();
    let mut moments = [0.0f32; 5];
    for y in 0..11 {
        for x in 0..11 {
            let w = weight(x) * weight(y) / sum / sum;
            let (a, b) =
                (f32::from(a.rgba8[4 * (11 * y + x)]), f32::from(b.rgba8[4 * (11 * y + x)]));
            for (m, v) in moments.iter_mut().zip([a, b, a * a, b * b, a * b]) {
                *m += w * v;
            }
        }
    }
    let [ma, mb, aa, bb, ab] = moments;
    let (c1, c2) = (2.55f32 * 2.55, 7.65f32 * 7.65);
    let ssim = ((2.0 * ma * mb + c1) * (2.0 * (ab - ma * mb) + c2))
        / ((ma * ma + mb * mb + c1) * (aa - ma * ma + bb - mb * mb + c2));
    f64::from(ssim)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reference_of_constant_pictures_is_the_closed_form() {
        let [a, b] = [100, 50].map(|value| picture([11, 11], |_, _| value));
        let c1 = 2.55 * 2.55;
        let expected = (2.0 * 100.0 * 50.0 + c1) / (100.0 * 100.0 + 50.0 * 50.0 + c1);
        assert!(apart(expected, &exact(&a, &b)) < 1e-15);
    }
}
