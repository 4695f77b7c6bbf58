//! Moments of the area within the outline, in the hand's axes: raw, central, normalised, and Hu's invariants.

use opencv::imgproc::{hu_moments, moments};

use super::outline::Outline;
use super::{Feature, feature, ratio};

/// The orders (p, q) of right and up, second and third.
const ORDERS: [(i32, i32); 7] = [(2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)];

pub const TABLE: [Feature; 28] = [
    feature("raw_20", "1", "m20 / (m00 w^2 h^0), from c"),
    feature("raw_11", "1", "m11 / (m00 w^1 h^1), from c"),
    feature("raw_02", "1", "m02 / (m00 w^0 h^2), from c"),
    feature("raw_30", "1", "m30 / (m00 w^3 h^0), from c"),
    feature("raw_21", "1", "m21 / (m00 w^2 h^1), from c"),
    feature("raw_12", "1", "m12 / (m00 w^1 h^2), from c"),
    feature("raw_03", "1", "m03 / (m00 w^0 h^3), from c"),
    feature("central_20", "1", "mu20 / (m00 w^2 h^0), from the centroid"),
    feature("central_11", "1", "mu11 / (m00 w^1 h^1), from the centroid"),
    feature("central_02", "1", "mu02 / (m00 w^0 h^2), from the centroid"),
    feature("central_30", "1", "mu30 / (m00 w^3 h^0), from the centroid"),
    feature("central_21", "1", "mu21 / (m00 w^2 h^1), from the centroid"),
    feature("central_12", "1", "mu12 / (m00 w^1 h^2), from the centroid"),
    feature("central_03", "1", "mu03 / (m00 w^0 h^3), from the centroid"),
    feature("normalised_20", "1", "eta20 = mu20 / m00^2"),
    feature("normalised_11", "1", "eta11 = mu11 / m00^2"),
    feature("normalised_02", "1", "eta02 = mu02 / m00^2"),
    feature("normalised_30", "1", "eta30 = mu30 / m00^2.5"),
    feature("normalised_21", "1", "eta21 = mu21 / m00^2.5"),
    feature("normalised_12", "1", "eta12 = mu12 / m00^2.5"),
    feature("normalised_03", "1", "eta03 = mu03 / m00^2.5"),
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

pub fn measure(outline: &Outline) -> Result<[f32; TABLE.len()], opencv::Error> {
    let m = moments(&outline.points, false)?;
    let raw = [m.m20, m.m11, m.m02, m.m30, m.m21, m.m12, m.m03];
    let central = [m.mu20, m.mu11, m.mu02, m.mu30, m.mu21, m.mu12, m.mu03];
    let normalised = [m.nu20, m.nu11, m.nu02, m.nu30, m.nu21, m.nu12, m.nu03];
    let mut values = [0.0; TABLE.len()];
    for (i, (p, q)) in ORDERS.into_iter().enumerate() {
        let unit = m.m00 as f32 * outline.width.powi(p) * outline.height.powi(q);
        values[i] = ratio(raw[i] as f32, unit);
        values[7 + i] = ratio(central[i] as f32, unit);
        values[14 + i] = normalised[i] as f32;
    }
    let mut invariants = [0.0; 7];
    hu_moments(m, &mut invariants)?;
    for (i, invariant) in invariants.into_iter().enumerate() {
        values[21 + i] = (invariant.signum() * (invariant.abs() / SMALLEST_INVARIANT).ln_1p()) as f32;
    }
    Ok(values)
}
