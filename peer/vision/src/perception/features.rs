//! The 110 hand-crafted features: what they are called, what they mean, and the vector of them.
//!
//! Each group stands in a file of its own, its table of documentation next to its formulas. All are ratios,
//! angles and counts: independent of the canvas's size, of the hand's place and of its distance. Symbols in the
//! formulas:
//!
//! - A: area of the hand, pixels; P: its perimeter;
//! - r: radius of the largest circle within the hand (the palm), c: the centre of that circle;
//! - right, up: the axes of the hand; up leads from the wrist to the fingers;
//! - w, h: extent of the hand along these axes, in palm radii.
//!
//! The features are measured along the hand's axes, not the frame's: trained on upright hands, the same
//! classifier reads tilted ones.

mod blob;
mod defects;
mod fingers;
mod moments;
mod outline;
mod palm;
mod rings;

use super::hand::Hand;
use outline::Outline;

/// How many features there are.
pub const FEATURES: usize = 110;

/// What one feature is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Feature {
    /// Its name, unique among the features.
    pub name: &'static str,
    /// Its unit: `1` (a ratio), `rad` or `count`.
    pub unit: &'static str,
    /// How it is computed; the symbols are those of the group at its head.
    pub formula: &'static str,
}

const fn feature(name: &'static str, unit: &'static str, formula: &'static str) -> Feature {
    Feature { name, unit, formula }
}

/// The groups one after another. That their sizes add up to [`FEATURES`] is checked when this is compiled.
static TABLE: [Feature; FEATURES] = {
    let groups: [&[Feature]; 6] =
        [&blob::TABLE, &palm::TABLE, &defects::TABLE, &fingers::TABLE, &rings::TABLE, &moments::TABLE];
    let mut table = [feature("", "", ""); FEATURES];
    let (mut filled, mut group) = (0, 0);
    while group < groups.len() {
        let mut index = 0;
        while index < groups[group].len() {
            table[filled] = groups[group][index];
            filled += 1;
            index += 1;
        }
        group += 1;
    }
    assert!(filled == FEATURES);
    table
};

/// The names of the groups of features, and how many each has, in the order of the vector.
pub const GROUPS: [(&str, usize); 6] = [
    ("blob", blob::TABLE.len()),
    ("palm", palm::TABLE.len()),
    ("finger gaps", defects::TABLE.len()),
    ("fingers", fingers::TABLE.len()),
    ("rings", rings::TABLE.len()),
    ("moments", moments::TABLE.len()),
];

/// The documentation of the 110 features, in the order of the vector.
#[must_use]
pub fn features() -> &'static [Feature] {
    &TABLE
}

/// Measures the features of a hand, in the order of [`features()`]. All are finite.
pub fn measure(hand: &Hand<'_>) -> Result<Vec<f32>, opencv::Error> {
    let outline = Outline::of(hand)?;
    let mut vector = Vec::with_capacity(FEATURES);
    vector.extend(blob::measure(hand, &outline)?);
    vector.extend(palm::measure(hand, &outline));
    vector.extend(defects::measure(hand, &outline));
    vector.extend(fingers::measure(hand, &outline)?);
    vector.extend(rings::measure(hand)?);
    vector.extend(moments::measure(&outline)?);
    Ok(vector)
}

/// A quotient that is 0 where the divisor is: what a degenerate hand (one line of pixels) has none of.
fn ratio(dividend: f32, divisor: f32) -> f32 {
    if divisor.abs() < 1e-6 { 0.0 } else { dividend / divisor }
}
