//! The hand as the counter wants it: upright, as large as fits, with its own pixels marked.

use opencv::core::{BORDER_CONSTANT, CV_8U, Mat, MatTraitConstManual, MatTraitManual, Scalar, Size};
use opencv::imgproc::{INTER_LINEAR, warp_affine};

use super::affine::Affine;
use super::pyramid::Pyramid;
use super::standard::standardise_within;
use crate::network::{Counter, FeatureMap};

const SIDE: usize = Counter::SIDE;
/// What blue, green and red weigh in a grey.
const GREY: [f32; 3] = [0.114, 0.587, 0.299];

/// Prepares hands to be read.
pub struct Reading {
    bgr: Mat,
    mask: Mat,
    grey: Vec<f32>,
    picture: FeatureMap,
    mirrored: FeatureMap,
    crop: Mat,
}

impl Reading {
    pub fn new() -> Result<Self, opencv::Error> {
        let side = SIDE as i32;
        Ok(Self {
            bgr: Mat::default(),
            mask: Mat::default(),
            grey: vec![0.0; SIDE * SIDE],
            picture: FeatureMap::default(),
            mirrored: FeatureMap::default(),
            crop: Mat::new_rows_cols_with_default(side, side, CV_8U, Scalar::all(0.0))?,
        })
    }

    /// The last hand: 48×48, 8-bit grey, black off the hand.
    pub fn crop(&self) -> &Mat {
        &self.crop
    }

    /// Cuts a hand out. `onto`: from the frame to the square of 48 pixels; `mask`, 32-bit, and from the frame to it.
    pub fn cut(
        &mut self,
        (pyramid, frame): (&mut Pyramid, &Mat),
        onto: &Affine,
        (mask, onto_mask): (&Mat, &Affine),
    ) -> Result<&FeatureMap, opencv::Error> {
        pyramid.cut(frame, onto, SIDE, &mut self.bgr)?;
        let (matrix, size) = (onto.after(&onto_mask.inverse()).matrix(), Size::new(SIDE as i32, SIDE as i32));
        warp_affine(mask, &mut self.mask, &matrix, size, INTER_LINEAR, BORDER_CONSTANT, Scalar::default())?;
        let mask: &[f32] = self.mask.data_typed()?;
        for (grey, pixel) in self.grey.iter_mut().zip(self.bgr.data_bytes()?.chunks_exact(3)) {
            *grey = GREY.iter().zip(pixel).map(|(weight, value)| weight * f32::from(*value)).sum();
        }
        for ((crop, grey), mask) in self.crop.data_bytes_mut()?.iter_mut().zip(&self.grey).zip(mask) {
            *crop = (grey * mask).round() as u8;
        }
        standardise_within(&self.grey, mask, SIDE, &mut self.picture);
        Ok(&self.picture)
    }

    /// What was cut out last, left to right.
    pub fn mirrored(&mut self) -> &FeatureMap {
        self.mirrored.mirror(&self.picture);
        &self.mirrored
    }
}

#[cfg(test)]
mod tests {
    use opencv::core::{CV_8UC3, CV_32F};

    use super::*;
    use crate::eyes::place::Place;

    #[test]
    fn mirrored_means_left_to_right_row_by_row() {
        let mut frame = Mat::new_rows_cols_with_default(48, 48, CV_8UC3, Scalar::all(0.0)).unwrap();
        for (i, byte) in frame.data_bytes_mut().unwrap().iter_mut().enumerate() {
            *byte = (i * 31 % 251) as u8;
        }
        let mask = Mat::new_rows_cols_with_default(48, 48, CV_32F, Scalar::all(1.0)).unwrap();
        let onto = Affine::onto(Place { x: 23.5, y: 23.5, side: 48.0, up: 0.0 }, 1.0, SIDE);
        let mut reading = Reading::new().unwrap();
        let picture = reading.cut((&mut Pyramid::default(), &frame), &onto, (&mask, &onto)).unwrap().clone();
        let mirrored = reading.mirrored();
        assert_eq!(mirrored.shape(), (2, SIDE, SIDE));
        assert_ne!(mirrored.values(), picture.values());
        for (one, other) in picture.values().chunks(SIDE).zip(mirrored.values().chunks(SIDE)) {
            assert!(one.iter().eq(other.iter().rev()));
        }
    }
}
