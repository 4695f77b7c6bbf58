//! What a look found.

use opencv::core::{Mat, Point, Point2f, Rect, Size, Vector};
use opencv::imgproc::{CHAIN_APPROX_NONE, RETR_EXTERNAL, contour_area_def, find_contours_def};

use super::affine::Affine;
use super::place::Place;
use crate::network::{EMBEDDING, Refiner};

/// A square that is looked at closely is so many sides of its hand wide.
pub(super) const ROOM: f64 = 1.55;

/// A hand that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// Where it is.
    pub place: Place,
    /// How likely it is a hand, `0.0..=1.0`.
    pub confidence: f32,
    /// Where it was looked for: its mask is a square of 1.55 sides of this place, turned as it.
    pub view: Place,
    /// How likely each pixel of that square is the hand's, `0.0..=1.0`: 64×64, row by row, 0 off its largest connected part.
    pub mask: Vec<f32>,
    /// Where it lies among hands: those that show the same are close.
    pub embedding: [f32; EMBEDDING],
    /// How likely it shows 0 to 5 fingers; they add up to 1.
    pub counts: [f32; 6],
    /// How likely thumb, index, middle, ring and little finger are out, each by itself.
    pub fingers: [f32; 5],
}

impl Look {
    /// From the frame to the mask.
    pub(super) fn onto_mask(&self) -> Affine {
        Affine::onto(self.view, ROOM, Refiner::SIDE)
    }

    /// The smallest upright rectangle around the square of the mask, within a frame of that size; at least a pixel of it.
    #[must_use]
    pub fn region(&self, frame: Size) -> Rect {
        let back = self.onto_mask().inverse();
        let last = Refiner::SIDE as f64 - 0.5;
        let corners =
            [(-0.5, -0.5), (last, -0.5), (-0.5, last), (last, last)].map(|corner| back.apply(corner));
        let span = |of: fn(&(f64, f64)) -> f64, limit: i32| {
            let low = corners.iter().map(of).fold(f64::INFINITY, f64::min);
            let high = corners.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
            // Pixels from half a pixel before their centre to half a pixel behind it.
            let first = ((low + 0.5).floor() as i32).clamp(0, limit - 1);
            (first, ((high + 0.5).ceil() as i32).clamp(first + 1, limit) - first)
        };
        let (x, width) = span(|corner| corner.0, frame.width);
        let (y, height) = span(|corner| corner.1, frame.height);
        Rect::new(x, y, width, height)
    }

    /// The outline of the hand's pixels, in pixels of the frame; empty when there are none.
    ///
    /// # Errors
    /// OpenCV's.
    pub fn outline(&self) -> Result<Vec<Point2f>, opencv::Error> {
        let inside: Vec<u8> = self.mask.iter().map(|value| u8::from(*value > 0.5)).collect();
        let side = Refiner::SIDE as i32;
        let mut outlines = Vector::<Vector<Point>>::new();
        let inside = Mat::new_rows_cols_with_data(side, side, &inside)?;
        find_contours_def(&inside, &mut outlines, RETR_EXTERNAL, CHAIN_APPROX_NONE)?;
        let mut largest = (Vector::new(), -1.0);
        for outline in outlines {
            let area = contour_area_def(&outline)?;
            if area > largest.1 {
                largest = (outline, area);
            }
        }
        let back = self.onto_mask().inverse();
        let in_frame = |point: Point| {
            let (x, y) = back.apply((f64::from(point.x), f64::from(point.y)));
            Point2f::new(x as f32, y as f32)
        };
        Ok(largest.0.into_iter().map(in_frame).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(view: Place) -> Look {
        let inside = |i: usize| (20..44).contains(&(i % 64)) && (10..54).contains(&(i / 64));
        Look {
            place: view,
            confidence: 1.0,
            view,
            mask: (0..64 * 64).map(|i| if inside(i) { 0.9 } else { 0.1 }).collect(),
            embedding: [0.0; EMBEDDING],
            counts: [0.0; 6],
            fingers: [0.0; 5],
        }
    }

    #[test]
    fn the_outline_is_where_the_hand_is_in_the_frame() {
        // Four pixels of the frame to one of the mask, pointing right.
        let side = (4.0 * 64.0 / ROOM) as f32;
        let outline =
            look(Place { x: 300.0, y: 200.0, side, up: std::f32::consts::FRAC_PI_2 }).outline().unwrap();
        let span = |of: fn(&Point2f) -> f32| {
            let low = outline.iter().map(of).fold(f32::INFINITY, f32::min);
            (low, outline.iter().map(of).fold(f32::NEG_INFINITY, f32::max))
        };
        let near = |(a, b): (f32, f32), (c, d): (f32, f32)| (a - c).abs() < 0.1 && (b - d).abs() < 0.1;
        assert!(near(span(|p| p.x), (300.0 - 86.0, 300.0 + 86.0)), "{:?}", span(|p| p.x));
        assert!(near(span(|p| p.y), (200.0 - 46.0, 200.0 + 46.0)), "{:?}", span(|p| p.y));
    }

    #[test]
    fn the_region_stays_within_the_frame() {
        let of = |x, y, side, up| look(Place { x, y, side, up }).region(Size::new(640, 480));
        assert_eq!(of(99.5, 99.5, (19.9 / ROOM) as f32, 0.0), Rect::new(90, 90, 20, 20));
        assert_eq!(of(0.0, 0.0, 1e6, 1.0), Rect::new(0, 0, 640, 480));
        assert_eq!(of(-500.0, 900.0, 9.0, 0.3), Rect::new(0, 479, 1, 1));
    }
}
