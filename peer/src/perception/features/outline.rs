//! The outline of a hand, as several groups of features need it.

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
    pub points: Vector<Point>,
    pub perimeter: f32,
    /// Corners of the hull as indices into `points`, ascending.
    pub hull: Vec<usize>,
    pub hull_area: f32,
    pub hull_perimeter: f32,
    /// Every point, in the order of `points`.
    pub polar: Vec<Polar>,
}

impl Outline {
    pub fn of(hand: &Hand<'_>) -> Result<Self, opencv::Error> {
        let points = hand.contour;
        let mut indices = Vector::<i32>::new();
        convex_hull(points, &mut indices, false, false)?;
        let mut hull: Vec<usize> = indices.iter().map(|index| index as usize).collect();
        hull.sort_unstable();
        let mut corners = Vector::<Point>::new();
        for &index in &hull {
            corners.push(points.get(index)?);
        }
        Ok(Self {
            perimeter: arc_length(points, true)? as f32,
            hull,
            hull_area: contour_area_def(&corners)? as f32,
            hull_perimeter: arc_length(&corners, true)? as f32,
            polar: points.iter().map(|p| polar(hand, Point2f::new(p.x as f32, p.y as f32))).collect(),
            points: points.clone(),
        })
    }
}

/// A point as seen from the palm's centre.
pub fn polar(hand: &Hand<'_>, point: Point2f) -> Polar {
    let (right, up) = hand.axes(point);
    Polar { distance: right.hypot(up), angle: right.atan2(up) }
}
