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
    feature(
        "defect_widths_1",
        "1",
        "largest width, along the hull, of a valley deeper than 0.5 r / r, 0 without one",
    ),
    feature("defect_widths_2", "1", "second largest of these widths / r, 0 where there is none; so the next"),
    feature("defect_widths_3", "1", "third largest of these widths / r"),
    feature("defect_widths_4", "1", "fourth largest of these widths / r"),
    feature(
        "defect_mean_angle",
        "rad",
        "mean over all valleys, weighted by depth, of the angle clockwise from up, as seen from c",
    ),
    feature("defect_angle_deviation", "rad", "standard deviation of the same"),
    feature(
        "defect_first_angle",
        "rad",
        "smallest of these angles among valleys deeper than 0.5 r, 0 without one",
    ),
    feature(
        "defect_last_angle",
        "rad",
        "largest of these angles among valleys deeper than 0.5 r, 0 without one",
    ),
    feature(
        "defect_mean_distance",
        "1",
        "mean over all valleys, weighted by depth, of the distance from c to the bottom / r",
    ),
];

struct Defect {
    depth: f32,
    width: f32,
    angle: f32,
    distance: f32,
}

pub fn measure(hand: &Hand<'_>, outline: &Outline) -> [f32; TABLE.len()] {
    let mut defects = find(hand, outline);
    defects.sort_by(|a, b| b.depth.total_cmp(&a.depth));
    let depth = |n: usize| defects.get(n).map_or(0.0, |defect| defect.depth);
    let total: f32 = defects.iter().map(|defect| defect.depth).sum();
    // Weighted by depth, since which valley is the second deepest may hang on a pixel.
    let mean = |of: &dyn Fn(&Defect) -> f32| {
        ratio(defects.iter().map(|defect| defect.depth * of(defect)).sum(), total)
    };
    let mean_angle = mean(&|defect| defect.angle);
    let variance = mean(&|defect| (defect.angle - mean_angle).powi(2));

    let deep = &defects[..defects.partition_point(|defect| defect.depth > DEEP)];
    let mut widths: Vec<f32> = deep.iter().map(|defect| defect.width).collect();
    widths.sort_by(|a, b| b.total_cmp(a));
    let width = |n: usize| widths.get(n).copied().unwrap_or(0.0);
    let angles = || deep.iter().map(|defect| defect.angle);
    [
        deep.len() as f32,
        total,
        depth(0),
        depth(1),
        depth(2),
        depth(3),
        depth(4),
        width(0),
        width(1),
        width(2),
        width(3),
        mean_angle,
        variance.sqrt(),
        angles().reduce(f32::min).unwrap_or(0.0),
        angles().reduce(f32::max).unwrap_or(0.0),
        mean(&|defect| defect.distance),
    ]
}

/// The valley between each two neighbouring corners of the hull. (OpenCV's `convexityDefects` computes the
/// same, but refuses outlines that touch themselves.)
fn find(hand: &Hand<'_>, outline: &Outline) -> Vec<Defect> {
    let points = hand.contour.as_slice();
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
