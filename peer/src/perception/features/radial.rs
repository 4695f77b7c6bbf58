//! How far the hand reaches in each direction from the palm: the outline in polar coordinates.

use std::f32::consts::TAU;

use super::outline::Outline;
use super::{Feature, feature};

const RAYS: usize = 24;

pub const TABLE: [Feature; RAYS] = [
    feature(
        "reach_000",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 0 degrees clockwise from up",
    ),
    feature(
        "reach_015",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 15 degrees clockwise from up",
    ),
    feature(
        "reach_030",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 30 degrees clockwise from up",
    ),
    feature(
        "reach_045",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 45 degrees clockwise from up",
    ),
    feature(
        "reach_060",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 60 degrees clockwise from up",
    ),
    feature(
        "reach_075",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 75 degrees clockwise from up",
    ),
    feature(
        "reach_090",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 90 degrees clockwise from up",
    ),
    feature(
        "reach_105",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 105 degrees clockwise from up",
    ),
    feature(
        "reach_120",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 120 degrees clockwise from up",
    ),
    feature(
        "reach_135",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 135 degrees clockwise from up",
    ),
    feature(
        "reach_150",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 150 degrees clockwise from up",
    ),
    feature(
        "reach_165",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 165 degrees clockwise from up",
    ),
    feature(
        "reach_180",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 180 degrees clockwise from up",
    ),
    feature(
        "reach_195",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 195 degrees clockwise from up",
    ),
    feature(
        "reach_210",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 210 degrees clockwise from up",
    ),
    feature(
        "reach_225",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 225 degrees clockwise from up",
    ),
    feature(
        "reach_240",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 240 degrees clockwise from up",
    ),
    feature(
        "reach_255",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 255 degrees clockwise from up",
    ),
    feature(
        "reach_270",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 270 degrees clockwise from up",
    ),
    feature(
        "reach_285",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 285 degrees clockwise from up",
    ),
    feature(
        "reach_300",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 300 degrees clockwise from up",
    ),
    feature(
        "reach_315",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 315 degrees clockwise from up",
    ),
    feature(
        "reach_330",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 330 degrees clockwise from up",
    ),
    feature(
        "reach_345",
        "1",
        "largest distance of the outline from c / r, within 7.5 degrees of 345 degrees clockwise from up",
    ),
];

pub fn measure(outline: &Outline) -> [f32; TABLE.len()] {
    let mut reach = [0.0_f32; RAYS];
    for point in &outline.polar {
        let turn = (point.angle / TAU).rem_euclid(1.0);
        let ray = (turn * RAYS as f32).round() as usize % RAYS;
        reach[ray] = reach[ray].max(point.distance);
    }
    reach
}
