//! Circles around the palm: how often and how widely the fingers cross them.

use super::{Feature, feature};
use crate::perception::hand::Hand;
use crate::perception::ring::{arcs, ring};

/// Radii of the circles in palm radii.
const RADII: [f32; 4] = [1.5, 1.9, 2.3, 2.7];
/// Samples of a circle.
const SAMPLES: usize = 120;
/// Share of the circle, centred below the palm, that is the wrist's and not looked at.
const WRIST: f32 = 0.2;

pub const TABLE: [Feature; 10] = [
    feature(
        "fingers_at_1.5",
        "count",
        "arcs of the circle of radius 1.5 r around c that the hand covers, wrist left out",
    ),
    feature("fingers_at_1.9", "count", "the same at 1.9 r"),
    feature("fingers_at_2.3", "count", "the same at 2.3 r"),
    feature("fingers_at_2.7", "count", "the same at 2.7 r"),
    feature(
        "cover_at_1.5",
        "1",
        "share of the circle of radius 1.5 r around c that the hand covers, wrist left out",
    ),
    feature("cover_at_1.9", "1", "the same at 1.9 r"),
    feature("cover_at_2.3", "1", "the same at 2.3 r"),
    feature("cover_at_2.7", "1", "the same at 2.7 r"),
    feature("widest_at_1.5", "1", "widest of the arcs at 1.5 r, as a share of the circle"),
    feature("widest_at_1.9", "1", "widest of the arcs at 1.9 r, as a share of the circle"),
];

pub fn measure(hand: &Hand<'_>) -> Result<[f32; TABLE.len()], opencv::Error> {
    // The circle is sampled clockwise from the direction of x; where on it is the wrist?
    let down = (-hand.up.y).atan2(-hand.up.x) / std::f32::consts::TAU;
    let is_wrist = |sample: usize| {
        let away = (sample as f32 / SAMPLES as f32 - down).rem_euclid(1.0);
        away.min(1.0 - away) < WRIST / 2.0
    };
    let mut values = [0.0; TABLE.len()];
    for (i, radius) in RADII.into_iter().enumerate() {
        let mut covered = ring(hand.mask, hand.palm, radius * hand.radius, SAMPLES)?;
        for (sample, covered) in covered.iter_mut().enumerate() {
            *covered &= !is_wrist(sample);
        }
        let arcs = arcs(&covered);
        let share = |samples: usize| samples as f32 / SAMPLES as f32;
        values[i] = arcs.len() as f32;
        values[4 + i] = arcs.iter().map(|arc| share(arc.length)).sum();
        if i < 2 {
            values[8 + i] = arcs.iter().map(|arc| share(arc.length)).fold(0.0, f32::max);
        }
    }
    Ok(values)
}
