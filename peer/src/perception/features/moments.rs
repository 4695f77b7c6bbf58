//! Moments of the hand's pixels: raw, central, normalised, of the hand's own axes, and Hu's invariants.

use opencv::core::Moments;
use opencv::imgproc::hu_moments;

use super::{Feature, feature, ratio};
use crate::perception::hand::Hand;

/// The orders (p, q) of x and y, second and third.
const ORDERS: [(i32, i32); 7] = [(2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)];

pub const TABLE: [Feature; 28] = [
    feature("raw_20", "1", "m20 / (m00 w^2 h^0), from the corner of the bounding box"),
    feature("raw_11", "1", "m11 / (m00 w^1 h^1), from the corner of the bounding box"),
    feature("raw_02", "1", "m02 / (m00 w^0 h^2), from the corner of the bounding box"),
    feature("raw_30", "1", "m30 / (m00 w^3 h^0), from the corner of the bounding box"),
    feature("raw_21", "1", "m21 / (m00 w^2 h^1), from the corner of the bounding box"),
    feature("raw_12", "1", "m12 / (m00 w^1 h^2), from the corner of the bounding box"),
    feature("raw_03", "1", "m03 / (m00 w^0 h^3), from the corner of the bounding box"),
    feature("normalised_20", "1", "eta20 = mu20 / m00^2, from the centroid, axes of the frame"),
    feature("normalised_11", "1", "eta11 = mu11 / m00^2, from the centroid, axes of the frame"),
    feature("normalised_02", "1", "eta02 = mu02 / m00^2, from the centroid, axes of the frame"),
    feature("normalised_30", "1", "eta30 = mu30 / m00^2.5, from the centroid, axes of the frame"),
    feature("normalised_21", "1", "eta21 = mu21 / m00^2.5, from the centroid, axes of the frame"),
    feature("normalised_12", "1", "eta12 = mu12 / m00^2.5, from the centroid, axes of the frame"),
    feature("normalised_03", "1", "eta03 = mu03 / m00^2.5, from the centroid, axes of the frame"),
    feature("central_20", "1", "eta20 along the axes of the hand: x right, y up"),
    feature("central_11", "1", "eta11 along the axes of the hand: x right, y up"),
    feature("central_02", "1", "eta02 along the axes of the hand: x right, y up"),
    feature("central_30", "1", "eta30 along the axes of the hand: x right, y up"),
    feature("central_21", "1", "eta21 along the axes of the hand: x right, y up"),
    feature("central_12", "1", "eta12 along the axes of the hand: x right, y up"),
    feature("central_03", "1", "eta03 along the axes of the hand: x right, y up"),
    feature("hu_1", "1", "sign(I) ln(1 + |I| / 1e-6), I: invariant 1 of Hu (1962)"),
    feature("hu_2", "1", "sign(I) ln(1 + |I| / 1e-6), I: invariant 2 of Hu (1962)"),
    feature("hu_3", "1", "sign(I) ln(1 + |I| / 1e-6), I: invariant 3 of Hu (1962)"),
    feature("hu_4", "1", "sign(I) ln(1 + |I| / 1e-6), I: invariant 4 of Hu (1962)"),
    feature("hu_5", "1", "sign(I) ln(1 + |I| / 1e-6), I: invariant 5 of Hu (1962)"),
    feature("hu_6", "1", "sign(I) ln(1 + |I| / 1e-6), I: invariant 6 of Hu (1962)"),
    feature("hu_7", "1", "sign(I) ln(1 + |I| / 1e-6), I: invariant 7 of Hu (1962)"),
];

/// Below this an invariant of Hu is taken as 0: what the pixels' grid makes of a disc.
const SMALLEST_INVARIANT: f64 = 1e-6;

pub fn measure(hand: &Hand<'_>) -> Result<[f32; TABLE.len()], opencv::Error> {
    let m = &hand.moments;
    let (width, height) = (hand.bounds.width as f32, hand.bounds.height as f32);
    let mut values = [0.0; TABLE.len()];
    for (i, ((p, q), raw)) in ORDERS.into_iter().zip(raw(m)).enumerate() {
        values[i] = ratio(raw as f32, m.m00 as f32 * width.powi(p) * height.powi(q));
    }
    let normalised = normalised(m);
    for (i, (p, q)) in ORDERS.into_iter().enumerate() {
        values[7 + i] = normalised[i] as f32;
        // Components of the hand's axes right = (-up.y, up.x) and up, in the frame's.
        let (right, up) = ([-hand.up.y, hand.up.x], [hand.up.x, hand.up.y]);
        values[14 + i] = rotated(&normalised, right, p, up, q) as f32;
    }
    let mut invariants = [0.0; 7];
    hu_moments(*m, &mut invariants)?;
    for (i, invariant) in invariants.into_iter().enumerate() {
        values[21 + i] = (invariant.signum() * (invariant.abs() / SMALLEST_INVARIANT).ln_1p()) as f32;
    }
    Ok(values)
}

fn raw(m: &Moments) -> [f64; 7] {
    [m.m20, m.m11, m.m02, m.m30, m.m21, m.m12, m.m03]
}

fn normalised(m: &Moments) -> [f64; 7] {
    [m.nu20, m.nu11, m.nu02, m.nu30, m.nu21, m.nu12, m.nu03]
}

/// The moment of order (p, q) along other axes: the mean of (a·z)^p (b·z)^q, multiplied out into moments of z = (x, y).
fn rotated(moments: &[f64; 7], a: [f32; 2], p: i32, b: [f32; 2], q: i32) -> f64 {
    // polynomial[j] is the factor of x^(n - j) y^j.
    let mut polynomial = vec![1.0];
    for axis in std::iter::repeat_n(a, p as usize).chain(std::iter::repeat_n(b, q as usize)) {
        let mut product = vec![0.0; polynomial.len() + 1];
        for (j, factor) in polynomial.into_iter().enumerate() {
            product[j] += factor * f64::from(axis[0]);
            product[j + 1] += factor * f64::from(axis[1]);
        }
        polynomial = product;
    }
    let first = if p + q == 2 { 0 } else { 3 };
    polynomial.iter().zip(&moments[first..]).map(|(factor, moment)| factor * moment).sum()
}
