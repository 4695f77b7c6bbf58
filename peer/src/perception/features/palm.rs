//! The palm, and how the rest of the hand lies around it.

use super::outline::Outline;
use super::{Feature, feature, ratio};
use crate::perception::hand::Hand;
use opencv::core::Point2f;

pub const TABLE: [Feature; 8] = [
    feature("palm_radius", "1", "r / sqrt(A)"),
    feature("palm_x", "1", "x of c from the left of the bounding box / w"),
    feature("palm_y", "1", "y of c from the top of the bounding box / h"),
    feature("reach", "1", "largest distance of the outline from c / r"),
    feature("centroid_right", "1", "right coordinate of the centroid from c / r"),
    feature("centroid_up", "1", "up coordinate of the centroid from c / r"),
    feature("tilt_sin", "1", "sine of the angle from the frame's vertical to up, positive clockwise"),
    feature("tilt_cos", "1", "cosine of the angle from the frame's vertical to up"),
];

pub fn measure(hand: &Hand<'_>, outline: &Outline) -> [f32; TABLE.len()] {
    let m = &hand.moments;
    let (left, top) = (hand.bounds.x as f32, hand.bounds.y as f32);
    let centroid =
        Point2f::new(left + ratio(m.m10 as f32, m.m00 as f32), top + ratio(m.m01 as f32, m.m00 as f32));
    let (right, up) = hand.axes(centroid);
    [
        ratio(hand.radius, (m.m00 as f32).sqrt()),
        (hand.palm.x - left) / hand.bounds.width as f32,
        (hand.palm.y - top) / hand.bounds.height as f32,
        outline.polar.iter().fold(0.0, |reach, point| point.distance.max(reach)),
        right,
        up,
        hand.up.x,
        -hand.up.y,
    ]
}
