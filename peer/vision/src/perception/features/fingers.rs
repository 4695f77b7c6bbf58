//! The fingers: peaks of the outline as seen from the palm, and how the hand narrows and splits further up.

use std::f32::consts::TAU;

use opencv::core::{MatTraitConst, MatTraitConstManual, Point2f};

use super::outline::Outline;
use super::{Feature, feature};
use crate::perception::blob::MARGIN;
use crate::perception::hand::Hand;

/// Directions of the radial profile.
const RAYS: usize = 120;
/// A peak is the farthest within this many directions on each side.
const NEIGHBOURS: usize = 4;
/// The least distance of a peak, palm radii.
const PEAK: f32 = 1.5;
/// Directions on each side of down that are the wrist's.
const WRIST: usize = 18;
/// Heights above the palm's centre at which the hand is cut, palm radii.
const HEIGHTS: [f32; 8] = [0.4, 0.8, 1.2, 1.6, 2.0, 2.4, 2.8, 3.2];
/// Reach and step of such a cut to each side, palm radii.
const SIDE: f32 = 3.5;
const STEP: f32 = 0.1;

pub const TABLE: [Feature; 24] = [
    feature(
        "peak_1",
        "1",
        "distance of the farthest peak from c / r; a peak exceeds 1.5 r and all within 12 degrees",
    ),
    feature("peak_2", "1", "distance of the second farthest peak / r, 0 where there is none; so the next"),
    feature("peak_3", "1", "distance of the third farthest peak / r"),
    feature("peak_4", "1", "distance of the fourth farthest peak / r"),
    feature("peak_5", "1", "distance of the fifth farthest peak / r"),
    feature(
        "gap_1",
        "rad",
        "largest angle at c between neighbouring peaks, the wrist not between them, 0 without two",
    ),
    feature("gap_2", "rad", "second largest of these angles, 0 where there is none"),
    feature("gap_3", "rad", "third largest of these angles, 0 where there is none"),
    feature("parts_at_0.4", "count", "parts into which a line across the hand, 0.4 r above c, cuts it"),
    feature("parts_at_0.8", "count", "parts into which a line across the hand, 0.8 r above c, cuts it"),
    feature("parts_at_1.2", "count", "parts into which a line across the hand, 1.2 r above c, cuts it"),
    feature("parts_at_1.6", "count", "parts into which a line across the hand, 1.6 r above c, cuts it"),
    feature("parts_at_2.0", "count", "parts into which a line across the hand, 2.0 r above c, cuts it"),
    feature("parts_at_2.4", "count", "parts into which a line across the hand, 2.4 r above c, cuts it"),
    feature("parts_at_2.8", "count", "parts into which a line across the hand, 2.8 r above c, cuts it"),
    feature("parts_at_3.2", "count", "parts into which a line across the hand, 3.2 r above c, cuts it"),
    feature("breadth_at_0.4", "1", "total length of these parts / r"),
    feature("breadth_at_0.8", "1", "total length of these parts / r"),
    feature("breadth_at_1.2", "1", "total length of these parts / r"),
    feature("breadth_at_1.6", "1", "total length of these parts / r"),
    feature("breadth_at_2.0", "1", "total length of these parts / r"),
    feature("breadth_at_2.4", "1", "total length of these parts / r"),
    feature("breadth_at_2.8", "1", "total length of these parts / r"),
    feature("breadth_at_3.2", "1", "total length of these parts / r"),
];

pub fn measure(hand: &Hand<'_>, outline: &Outline) -> Result<[f32; TABLE.len()], opencv::Error> {
    let mut values = [0.0; TABLE.len()];
    let peaks = peaks(outline);
    let mut distances: Vec<f32> = peaks.iter().map(|&(_, distance)| distance).collect();
    distances.sort_by(|a, b| b.total_cmp(a));
    let mut gaps: Vec<f32> =
        peaks.windows(2).map(|pair| (pair[1].0 - pair[0].0) as f32 * TAU / RAYS as f32).collect();
    gaps.sort_by(|a, b| b.total_cmp(a));
    for (value, distance) in values[..5].iter_mut().zip(distances) {
        *value = distance;
    }
    for (value, gap) in values[5..8].iter_mut().zip(gaps) {
        *value = gap;
    }
    for (i, height) in HEIGHTS.into_iter().enumerate() {
        (values[8 + i], values[16 + i]) = cut(hand, height)?;
    }
    Ok(values)
}

/// The peaks of the outline: direction, counted clockwise from down, and distance.
fn peaks(outline: &Outline) -> Vec<(usize, f32)> {
    let mut profile = [0.0_f32; RAYS];
    for point in &outline.polar {
        let turn = (point.angle / TAU + 0.5).rem_euclid(1.0);
        let ray = (turn * RAYS as f32) as usize % RAYS;
        profile[ray] = profile[ray].max(point.distance);
    }
    let is_peak = |&ray: &usize| {
        let before = &profile[ray - NEIGHBOURS..ray];
        let after = &profile[ray + 1..=ray + NEIGHBOURS];
        let height = profile[ray];
        height > PEAK
            && before.iter().all(|&other| height > other)
            && after.iter().all(|&other| height >= other)
    };
    (WRIST..RAYS - WRIST).filter(is_peak).map(|ray| (ray, profile[ray])).collect()
}

/// The parts of the hand on a line across it, and their total length in palm radii.
fn cut(hand: &Hand<'_>, height: f32) -> Result<(f32, f32), opencv::Error> {
    let (columns, rows) = (hand.mask.cols(), hand.mask.rows());
    let pixels = hand.mask.data_bytes()?;
    let right = Point2f::new(-hand.up.y, hand.up.x);
    let steps = (2.0 * SIDE / STEP) as usize;
    let (mut parts, mut covered, mut inside) = (0, 0, false);
    for step in 0..=steps {
        let side = step as f32 * STEP - SIDE;
        let at = hand.palm + (hand.up * height + right * side) * hand.radius;
        let (x, y) = (at.x.round() as i32, at.y.round() as i32);
        let within = (MARGIN..columns - MARGIN).contains(&x) && (MARGIN..rows - MARGIN).contains(&y);
        let now = within && pixels[(y * columns + x) as usize] > 0;
        parts += u32::from(now && !inside);
        covered += u32::from(now);
        inside = now;
    }
    Ok((parts as f32, covered as f32 * STEP))
}
