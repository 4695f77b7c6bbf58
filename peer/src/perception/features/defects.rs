//! Convexity defects: the valleys between the fingers, where the outline leaves its convex hull.

use opencv::core::Point;

use super::outline::Outline;
use super::{Feature, feature, ratio};
use crate::perception::hand::Hand;

/// Valleys deeper than this many palm radii are counted.
const DEEP: f32 = 0.5;

pub const TABLE: [Feature; 16] = [
    feature("defects", "count", "valleys deeper than 0.5 r"),
    feature("defect_total", "1", "sum of the depths of all valleys / r"),
    feature("defect_1_depth", "1", "depth of the deepest valley: its distance from the hull / r"),
    feature(
        "defect_2_depth",
        "1",
        "depth of the second deepest valley / r, 0 where there is none; so the next",
    ),
    feature("defect_3_depth", "1", "depth of the third deepest valley / r"),
    feature("defect_4_depth", "1", "depth of the fourth deepest valley / r"),
    feature("defect_5_depth", "1", "depth of the fifth deepest valley / r"),
    feature("defect_1_width", "1", "width of the deepest valley along the hull / r"),
    feature("defect_2_width", "1", "width of the second deepest valley along the hull / r"),
    feature("defect_3_width", "1", "width of the third deepest valley along the hull / r"),
    feature("defect_4_width", "1", "width of the fourth deepest valley along the hull / r"),
    feature(
        "defect_1_angle",
        "rad",
        "clockwise from up, as seen from c, to the bottom of the deepest valley",
    ),
    feature(
        "defect_2_angle",
        "rad",
        "the same for the second deepest valley, 0 where there is none; so the next",
    ),
    feature("defect_3_angle", "rad", "the same for the third deepest valley"),
    feature("defect_4_angle", "rad", "the same for the fourth deepest valley"),
    feature("defect_1_distance", "1", "distance from c to the bottom of the deepest valley / r"),
];

#[derive(Clone, Copy, Default)]
struct Defect {
    depth: f32,
    width: f32,
    angle: f32,
    distance: f32,
}

pub fn measure(hand: &Hand<'_>, outline: &Outline) -> [f32; TABLE.len()] {
    let mut defects = find(hand, outline);
    defects.sort_by(|a, b| b.depth.total_cmp(&a.depth));
    let deep = defects.iter().filter(|defect| defect.depth > DEEP).count();
    let total: f32 = defects.iter().map(|defect| defect.depth).sum();
    let nth = |n: usize| defects.get(n).copied().unwrap_or_default();
    [
        deep as f32,
        total,
        nth(0).depth,
        nth(1).depth,
        nth(2).depth,
        nth(3).depth,
        nth(4).depth,
        nth(0).width,
        nth(1).width,
        nth(2).width,
        nth(3).width,
        nth(0).angle,
        nth(1).angle,
        nth(2).angle,
        nth(3).angle,
        nth(0).distance,
    ]
}

/// The valley between each two neighbouring corners of the hull. (OpenCV's `convexityDefects` computes the same, but refuses
/// outlines that touch themselves.)
fn find(hand: &Hand<'_>, outline: &Outline) -> Vec<Defect> {
    let points = outline.points.as_slice();
    let n = points.len();
    let corners = outline.hull.iter().zip(outline.hull.iter().cycle().skip(1));
    let mut defects = Vec::new();
    for (&start, &end) in corners {
        let (a, b) = (points[start], points[end]);
        let chord = ((b.x - a.x) as f32).hypot((b.y - a.y) as f32);
        let between = (end + n - start) % n;
        let height = |p: Point| ((b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x)).unsigned_abs();
        let bottom = (1..between).map(|step| (start + step) % n).max_by_key(|&index| height(points[index]));
        if let Some(bottom) = bottom {
            let polar = outline.polar[bottom];
            defects.push(Defect {
                depth: ratio(height(points[bottom]) as f32, chord * hand.radius),
                width: ratio(chord, hand.radius),
                angle: polar.angle,
                distance: polar.distance,
            });
        }
    }
    defects
}
