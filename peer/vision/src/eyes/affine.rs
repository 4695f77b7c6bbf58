//! Maps between the pixels of pictures that are turned, scaled and moved against each other.

use opencv::core::Matx23d;

use super::place::Place;

/// Where each point of one picture is in another: the rows of a 2×3 matrix. Whole numbers are the centres of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine(pub [[f64; 3]; 2]);

impl Affine {
    /// From the frame to a square picture of so many `pixels` around a place, `room` of its sides wide, in which the hand's
    /// fingers point up.
    pub fn onto(place: Place, room: f64, pixels: usize) -> Self {
        let scale = pixels as f64 / (room * f64::from(place.side));
        let (sin, cos) = f64::from(place.up).sin_cos();
        let (sin, cos) = (scale * sin, scale * cos);
        let (x, y, centre) = (f64::from(place.x), f64::from(place.y), (pixels as f64 - 1.0) / 2.0);
        Self([[cos, sin, centre - cos * x - sin * y], [-sin, cos, centre + sin * x - cos * y]])
    }

    /// Where a point is.
    pub fn apply(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let [[a, b, c], [d, e, f]] = self.0;
        (a * x + b * y + c, d * x + e * y + f)
    }

    /// This map after another one.
    pub fn after(&self, first: &Self) -> Self {
        let [[a, b, _], [d, e, _]] = self.0;
        let [[p, q, r], [s, t, u]] = first.0;
        let (x, y) = self.apply((r, u));
        Self([[a * p + b * s, a * q + b * t, x], [d * p + e * s, d * q + e * t, y]])
    }

    /// The way back.
    pub fn inverse(&self) -> Self {
        let [[a, b, c], [d, e, f]] = self.0;
        let determinant = a * e - b * d;
        let (a, b, d, e) = (e / determinant, -b / determinant, -d / determinant, a / determinant);
        Self([[a, b, -a * c - b * f], [d, e, -d * c - e * f]])
    }

    /// How many times as long things become.
    pub fn scale(&self) -> f64 {
        let [[a, b, _], [d, e, _]] = self.0;
        (a * e - b * d).abs().sqrt()
    }

    /// As OpenCV wants it.
    pub fn matrix(&self) -> Matx23d {
        let [[a, b, c], [d, e, f]] = self.0;
        Matx23d::from_array([a, b, c, d, e, f])
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_PI_2;

    use super::*;

    fn assert_at((x, y): (f64, f64), expected: (f64, f64)) {
        assert!((x - expected.0).hypot(y - expected.1) < 1e-4, "{x} {y}, not {expected:?}");
    }

    #[test]
    fn a_hand_that_points_right_points_up_in_its_picture() {
        let place = Place { x: 100.0, y: 50.0, side: 40.0, up: FRAC_PI_2 };
        let onto = Affine::onto(place, 1.6, 64);
        assert!((onto.scale() - 1.0).abs() < 1e-6);
        assert_at(onto.apply((100.0, 50.0)), (31.5, 31.5));
        assert_at(onto.apply((110.0, 50.0)), (31.5, 21.5));
        assert_at(onto.apply((100.0, 60.0)), (41.5, 31.5));
    }

    #[test]
    fn there_and_back_is_where_it_was() {
        let onto = Affine::onto(Place { x: 3.0, y: 70.0, side: 17.0, up: -2.0 }, 1.55, 64);
        assert_at(onto.inverse().apply(onto.apply((9.0, -4.0))), (9.0, -4.0));
        assert_at(onto.inverse().after(&onto).apply((9.0, -4.0)), (9.0, -4.0));
        let moved = Place { x: 3.0, y: 70.0, side: 17.0, up: -2.0 }.moved((0.3, -0.2), 1.0, 0.0);
        let pixels = 64.0 / 1.55;
        assert_at(
            onto.apply((f64::from(moved.x), f64::from(moved.y))),
            (31.5 + 0.3 * pixels, 31.5 - 0.2 * pixels),
        );
    }
}
