//! The whole frame at a glance: as large as fits the finder's picture, its own mean around it.

use opencv::core::{BORDER_CONSTANT, Mat, MatTraitConst, Scalar, Size, copy_make_border, mean, no_array};
use opencv::imgproc::{INTER_AREA, INTER_LINEAR, resize};

use super::place::Place;
use super::standard::standardise;
use crate::network::FeatureMap;
use crate::perception::NoObservation;

/// The finder's picture at the coarser of its two looks.
const WIDTH: i32 = 160;
const HEIGHT: i32 = 120;
/// The shortest side of a frame within that picture in which a hand can be told from a line.
const SHORTEST: i32 = 12;

/// Where the frame is within the picture.
#[derive(Clone, Copy, Debug)]
pub struct Letterbox {
    /// Pixels of the picture per pixel of the frame.
    scale: f32,
    left: i32,
    top: i32,
}

impl Letterbox {
    /// A place in the picture, in the frame.
    pub fn in_frame(&self, place: Place) -> Place {
        let of = |at: f32, first: i32| (at - first as f32 + 0.5) / self.scale - 0.5;
        let (x, y) = (of(place.x, self.left), of(place.y, self.top));
        Place { x, y, side: place.side / self.scale, up: place.up }
    }
}

/// Takes frames in.
#[derive(Default)]
pub struct Glance {
    small: Mat,
    framed: Mat,
    picture: FeatureMap,
}

impl Glance {
    /// The last frame taken in.
    pub fn picture(&self) -> &FeatureMap {
        &self.picture
    }

    /// Takes a frame in, at so many times 160×120.
    pub fn take(&mut self, frame: &Mat, times: i32) -> Result<Letterbox, NoObservation> {
        let (width, height) = (WIDTH * times, HEIGHT * times);
        let fit = |limit: i32, side: i32| f64::from(limit) / f64::from(side);
        let scale = fit(width, frame.cols()).min(fit(height, frame.rows()));
        let scaled = |side: i32| (f64::from(side) * scale).round_ties_even() as i32;
        let size = Size::new(scaled(frame.cols()), scaled(frame.rows()));
        if size.width.min(size.height) < SHORTEST * times {
            return Err(NoObservation::TooNarrow { width: frame.cols(), height: frame.rows() });
        }
        let interpolation = if scale < 1.0 { INTER_AREA } else { INTER_LINEAR };
        resize(frame, &mut self.small, size, 0.0, 0.0, interpolation)?;
        let (left, top) = ((width - size.width) / 2, (height - size.height) / 2);
        let (right, bottom) = (width - size.width - left, height - size.height - top);
        let [blue, green, red, _] = mean(&self.small, &no_array())?.0.map(f64::floor);
        let around = Scalar::new(blue, green, red, 0.0);
        copy_make_border(&self.small, &mut self.framed, top, bottom, left, right, BORDER_CONSTANT, around)?;
        standardise(&self.framed, &mut self.picture)?;
        Ok(Letterbox { scale: scale as f32, left, top })
    }
}

#[cfg(test)]
mod tests {
    use opencv::core::{CV_8UC3, Point};
    use opencv::imgproc::{FILLED, LINE_8, circle};

    use super::*;

    #[test]
    fn what_is_seen_in_the_picture_is_found_in_the_frame() {
        for (width, height, times) in [(640, 480, 1), (1280, 720, 2), (300, 500, 1), (90, 60, 1)] {
            let mut frame =
                Mat::new_rows_cols_with_default(height, width, CV_8UC3, Scalar::all(20.0)).unwrap();
            let (x, y) = (width / 3, height / 4);
            circle(&mut frame, Point::new(x, y), height / 10, Scalar::all(250.0), FILLED, LINE_8, 0).unwrap();
            let mut glance = Glance::default();
            let letterbox = glance.take(&frame, times).unwrap();
            let (_, rows, columns) = glance.picture().shape();
            assert_eq!((columns as i32, rows as i32), (160 * times, 120 * times));
            let (mut sum, mut right, mut down) = (0.0, 0.0, 0.0);
            let bright = glance.picture().channel(0).iter().enumerate().filter(|(_, value)| **value > 0.5);
            for (index, _) in bright {
                (sum, right, down) =
                    (sum + 1.0, right + (index % columns) as f32, down + (index / columns) as f32);
            }
            let seen = letterbox.in_frame(Place { x: right / sum, y: down / sum, side: 8.0, up: 0.0 });
            let near = 0.03 * height as f32;
            assert!((seen.x - x as f32).abs() < near && (seen.y - y as f32).abs() < near, "{seen:?}");
            // The frame's own mean around it: nothing stands out there.
            assert!(glance.picture().values()[0].abs() < 1.0);
        }
    }
}
