//! The hand as a blob: extents, axes, hull, holes.

use opencv::core::{Point, Point2f, Vector};
use opencv::imgproc::{approx_poly_dp, min_area_rect, min_enclosing_circle};

use super::outline::Outline;
use super::{Feature, feature, ratio};
use crate::perception::hand::Hand;

pub const TABLE: [Feature; 24] = [
    feature("extent", "1", "A / (w h r^2)"),
    feature("aspect", "1", "ln(w / h)"),
    feature("length", "1", "longer side of the smallest rotated rectangle / sqrt(A)"),
    feature("breadth", "1", "shorter side of the smallest rotated rectangle / sqrt(A)"),
    feature("rectangularity", "1", "A / area of the smallest rotated rectangle"),
    feature(
        "centroid_x",
        "1",
        "(right coordinate of the centroid - that of the left of the bounding box) / w",
    ),
    feature(
        "centroid_y",
        "1",
        "(up coordinate of the centroid - that of the bottom of the bounding box) / h",
    ),
    feature("orientation_sin", "1", "e sin(2 t), t: angle from up to the principal axis, e: eccentricity"),
    feature("orientation_cos", "1", "e cos(2 t), t: angle from up to the principal axis, e: eccentricity"),
    feature("major_axis", "1", "4 sqrt(l1 / A), l1: larger eigenvalue of the covariance of the pixels"),
    feature("minor_axis", "1", "4 sqrt(l2 / A), l2: smaller eigenvalue of the covariance of the pixels"),
    feature("eccentricity", "1", "sqrt(1 - l2 / l1)"),
    feature("solidity", "1", "A / area of the convex hull"),
    feature("hull_perimeter", "1", "perimeter of the convex hull / sqrt(A)"),
    feature("convexity", "1", "perimeter of the convex hull / P"),
    feature("perimeter", "1", "P / sqrt(A)"),
    feature("compactness", "1", "4 pi A / P^2, 1 for a disc"),
    feature("circle_radius", "1", "radius of the smallest enclosing circle / sqrt(A)"),
    feature("circle_fill", "1", "A / area of the smallest enclosing circle"),
    feature("holes", "count", "number of holes of at least 0.2 % of the blob"),
    feature("hole_area", "1", "sqrt(area of the largest hole / A)"),
    feature("hole_right", "1", "right coordinate of the largest hole from c / r, 0 without a hole"),
    feature("hole_up", "1", "up coordinate of the largest hole from c / r, 0 without a hole"),
    feature("corners", "count", "corners of the outline simplified (Douglas, Peucker 1973) to 2 % of P"),
];

pub fn measure(hand: &Hand<'_>, outline: &Outline) -> Result<[f32; TABLE.len()], opencv::Error> {
    let area = hand.moments.m00 as f32;
    let unit = area.sqrt();
    // Whatever encloses the corners of the hull encloses the outline, of which they are few.
    let rectangle = min_area_rect(&outline.corners)?.size;
    let (mut centre, mut radius) = (Point2f::default(), 0.0);
    min_enclosing_circle(&outline.corners, &mut centre, &mut radius)?;
    let m = &hand.moments;
    let (right, up) = hand.axes(hand.centroid());

    // Eigenvalues of the covariance, in units of A.
    let [xx, xy, yy] = [m.nu20, m.nu11, m.nu02].map(|second| second as f32);
    let difference = (4.0 * xy * xy + (xx - yy) * (xx - yy)).sqrt();
    let (large, small) = ((xx + yy + difference) / 2.0, ((xx + yy - difference) / 2.0).max(0.0));
    let eccentricity = (1.0 - ratio(small, large)).max(0.0).sqrt();
    // Twice the angles, because an axis has no front; the frame's y points down, up's as well.
    let axis = (2.0 * xy).atan2(xx - yy);
    let (sin, cos) = (axis - 2.0 * hand.up.y.atan2(hand.up.x)).sin_cos();

    let (hole_area, hole_right, hole_up) = hand.holes.first().map_or((0.0, 0.0, 0.0), |hole| {
        let (right, up) = hand.axes(hole.centre);
        (ratio(hole.area as f32, area).sqrt(), right, up)
    });
    let mut simple = Vector::<Point>::new();
    approx_poly_dp(hand.contour, &mut simple, 0.02 * f64::from(outline.perimeter), true)?;

    Ok([
        ratio(area, outline.width * outline.height * hand.radius * hand.radius),
        (outline.width / outline.height).ln(),
        ratio(rectangle.width.max(rectangle.height), unit),
        ratio(rectangle.width.min(rectangle.height), unit),
        ratio(area, rectangle.width * rectangle.height),
        (right - outline.corner.x) / outline.width,
        (up - outline.corner.y) / outline.height,
        eccentricity * sin,
        eccentricity * cos,
        4.0 * large.sqrt(),
        4.0 * small.sqrt(),
        eccentricity,
        ratio(area, outline.hull_area),
        ratio(outline.hull_perimeter, unit),
        ratio(outline.hull_perimeter, outline.perimeter),
        ratio(outline.perimeter, unit),
        ratio(4.0 * std::f32::consts::PI * area, outline.perimeter * outline.perimeter),
        ratio(radius, unit),
        ratio(area, std::f32::consts::PI * radius * radius),
        hand.holes.len() as f32,
        hole_area,
        hole_right,
        hole_up,
        simple.len() as f32,
    ])
}
