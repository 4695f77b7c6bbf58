//! The outline of a hand in the hand's own axes, as several groups of features need it.

use opencv::core::{Point, Point2f, Vector};
use opencv::imgproc::{arc_length, contour_area_def, convex_hull};

use crate::perception::hand::Hand;

/// A point of the outline as seen from the palm's centre.
#[derive(Clone, Copy, Debug)]
pub struct Polar {
    /// Distance in palm radii.
    pub distance: f32,
    /// Clockwise from up, radians within -π..=π.
    pub angle: f32,
}

/// The outline of a hand and its convex hull.
pub struct Outline {
    /// The outline in the hand's axes: x right and y up, in palm radii from the palm's centre.
    pub points: Vector<Point2f>,
    /// The same in polar coordinates, in the same order.
    pub polar: Vec<Polar>,
    /// Corner of its bounding box in the hand's axes: least right and least up.
    pub corner: Point2f,
    /// Width and height of that box, palm radii.
    pub width: f32,
    pub height: f32,
    /// Length, pixels.
    pub perimeter: f32,
    /// Corners of the convex hull as indices into `points`, ascending.
    pub hull: Vec<usize>,
    /// The same as pixels.
    pub corners: Vector<Point>,
    pub hull_area: f32,
    pub hull_perimeter: f32,
}

impl Outline {
    pub fn of(hand: &Hand<'_>) -> Result<Self, opencv::Error> {
        let pixels = hand.contour;
        let mut indices = Vector::<i32>::new();
        convex_hull(pixels, &mut indices, false, false)?;
        let mut hull: Vec<usize> = indices.iter().map(|index| index as usize).collect();
        hull.sort_unstable();
        let pixel = pixels.as_slice();
        let corners: Vector<Point> = hull.iter().map(|&index| pixel[index]).collect();

        let in_axes = |p: &Point| hand.axes(Point2f::new(p.x as f32, p.y as f32));
        let points: Vec<Point2f> =
            pixel.iter().map(in_axes).map(|(right, up)| Point2f::new(right, up)).collect();
        let polar = |p: &Point2f| Polar { distance: p.x.hypot(p.y), angle: p.x.atan2(p.y) };
        let bound = |of: fn(&Point2f) -> f32| {
            let values = || points.iter().map(of);
            (values().fold(f32::INFINITY, f32::min), values().fold(f32::NEG_INFINITY, f32::max))
        };
        let ((left, right), (low, high)) = (bound(|p| p.x), bound(|p| p.y));
        // The outline runs through the middles of pixels; the hand reaches half a pixel further on each side.
        let pixel = 1.0 / hand.radius;
        Ok(Self {
            polar: points.iter().map(polar).collect(),
            corner: Point2f::new(left - pixel / 2.0, low - pixel / 2.0),
            width: right - left + pixel,
            height: high - low + pixel,
            points: Vector::from_slice(&points),
            perimeter: arc_length(pixels, true)? as f32,
            hull,
            hull_area: contour_area_def(&corners)? as f32,
            hull_perimeter: arc_length(&corners, true)? as f32,
            corners,
        })
    }
}
