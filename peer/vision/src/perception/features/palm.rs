//! The palm, and how the rest of the hand lies around it.

use super::outline::Outline;
use super::{Feature, feature, ratio};
use crate::perception::hand::Hand;

pub const TABLE: [Feature; 8] = [
    feature("palm_radius", "1", "r / sqrt(A)"),
    feature("palm_right", "1", "distance of c from the left of the bounding box / w"),
    feature("palm_up", "1", "distance of c from the bottom of the bounding box / h"),
    feature("reach", "1", "largest distance of the outline from c / r"),
    feature("top", "1", "distance of c from the top of the bounding box / r"),
    feature("width", "1", "w, in palm radii"),
    feature("centroid_right", "1", "right coordinate of the centroid from c / r"),
    feature("centroid_up", "1", "up coordinate of the centroid from c / r"),
];

pub fn measure(hand: &Hand<'_>, outline: &Outline) -> [f32; TABLE.len()] {
    let (right, up) = hand.axes(hand.centroid());
    [
        ratio(hand.radius, (hand.moments.m00 as f32).sqrt()),
        -outline.corner.x / outline.width,
        -outline.corner.y / outline.height,
        outline.polar.iter().fold(0.0, |reach, point| point.distance.max(reach)),
        outline.height + outline.corner.y,
        outline.width,
        right,
        up,
    ]
}
