//! The pixels of a hand, of those that the refiner takes for some hand's.

use opencv::core::{BORDER_CONSTANT, CMP_EQ, CV_8U, CV_32F, CV_32S, Mat, Point, Scalar, compare};
use opencv::imgproc::{
    CC_STAT_AREA, connected_components_with_stats, dilate, morphology_default_border_value,
};
use opencv::prelude::*;

use super::probability;
use crate::network::Refiner;

const SIDE: usize = Refiner::SIDE;
/// Fewer pixels than this are no hand.
const FEWEST: usize = 10;

/// The smallest square around a mask, upright as the mask is turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Its centre, in pixels of the mask.
    pub centre: (f64, f64),
    /// From the centre of its first pixel to that of its last, pixels.
    pub side: f64,
}

/// A mask of 64×64, of 32-bit values from 0 to 1.
pub struct HandMask {
    image: Mat,
    inside: Mat,
    labels: Mat,
    statistics: Mat,
    centroids: Mat,
    largest: Mat,
    kept: Mat,
}

impl HandMask {
    pub fn new() -> Result<Self, opencv::Error> {
        let square =
            |depth| Mat::new_rows_cols_with_default(SIDE as i32, SIDE as i32, depth, Scalar::all(0.0));
        Ok(Self {
            image: square(CV_32F)?,
            inside: square(CV_8U)?,
            labels: Mat::default(),
            statistics: Mat::default(),
            centroids: Mat::default(),
            largest: Mat::default(),
            kept: Mat::default(),
        })
    }

    /// The mask.
    pub fn image(&self) -> &Mat {
        &self.image
    }

    /// Its values, row by row.
    pub fn values(&self) -> Result<&[f32], opencv::Error> {
        self.image.data_typed()
    }

    /// Takes the largest connected part of what is likelier the hand than not, with one pixel around it; elsewhere the mask
    /// is 0.
    pub fn take(&mut self, logits: &[f32]) -> Result<(), opencv::Error> {
        for (inside, logit) in self.inside.data_bytes_mut()?.iter_mut().zip(logits) {
            *inside = u8::from(*logit > 0.0);
        }
        let (labels, statistics) = (&mut self.labels, &mut self.statistics);
        let count = connected_components_with_stats(
            &self.inside,
            labels,
            statistics,
            &mut self.centroids,
            8,
            CV_32S,
        )?;
        let mut largest = (0, 0);
        for label in 1..count {
            let area = *statistics.at_2d::<i32>(label, CC_STAT_AREA)?;
            largest = largest.max((area, -label));
        }
        let values = self.image.data_typed_mut::<f32>()?;
        if largest.0 == 0 {
            values.fill(0.0);
            return Ok(());
        }
        compare(&self.labels, &Scalar::all(f64::from(-largest.1)), &mut self.largest, CMP_EQ)?;
        let (centre, border) = (Point::new(-1, -1), morphology_default_border_value()?);
        dilate(&self.largest, &mut self.kept, &Mat::default(), centre, 1, BORDER_CONSTANT, border)?;
        for ((value, logit), kept) in values.iter_mut().zip(logits).zip(self.kept.data_bytes()?) {
            *value = if *kept == 0 { 0.0 } else { probability::alone(*logit) };
        }
        Ok(())
    }

    /// What the mask covers once it is `turned` counterclockwise by so many radians; `None` when it shows no hand.
    pub fn extent(&self, turned: f32) -> Result<Option<Extent>, opencv::Error> {
        let (sin, cos) = f64::from(turned).sin_cos();
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut count = 0;
        for (index, _) in self.values()?.iter().enumerate().filter(|(_, value)| **value > 0.5) {
            let (x, y) = ((index % SIDE) as f64, (index / SIDE) as f64);
            for (axis, at) in [x * cos + y * sin, y * cos - x * sin].into_iter().enumerate() {
                (low[axis], high[axis]) = (low[axis].min(at), high[axis].max(at));
            }
            count += 1;
        }
        let [x, y] = [0, 1].map(|axis| (low[axis] + high[axis]) / 2.0);
        let side = (high[0] - low[0]).max(high[1] - low[1]);
        Ok((count >= FEWEST).then_some(Extent { centre: (x * cos - y * sin, x * sin + y * cos), side }))
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_PI_4;

    use super::*;

    /// Logits of pixels for which that holds.
    fn logits(inside: impl Fn(usize, usize) -> bool) -> Vec<f32> {
        (0..SIDE * SIDE).map(|i| if inside(i % SIDE, i / SIDE) { 4.0 } else { -4.0 }).collect()
    }

    #[test]
    fn only_the_largest_part_is_the_hand() {
        let mut mask = HandMask::new().unwrap();
        mask.take(&logits(|x, y| {
            (10..20).contains(&x) && (5..9).contains(&y) || (40..60).contains(&x) && y > 50
        }))
        .unwrap();
        let values = mask.values().unwrap();
        assert!(values[55 * SIDE + 45] > 0.9 && values[6 * SIDE + 15] == 0.0);
        // Just beside the hand, what it was said to be; further off, nothing.
        assert!((0.0..0.1).contains(&values[50 * SIDE + 45]) && values[50 * SIDE + 45] > 0.0);
        assert_eq!(values[49 * SIDE + 45], 0.0);
        let extent = mask.extent(0.0).unwrap().unwrap();
        assert_eq!((extent.centre, extent.side), ((49.5, 57.0), 19.0));
    }

    #[test]
    fn the_square_is_upright_with_the_hand() {
        let mut mask = HandMask::new().unwrap();
        mask.take(&logits(|x, y| x.abs_diff(30) + y.abs_diff(34) <= 10)).unwrap();
        let extent = mask.extent(FRAC_PI_4).unwrap().unwrap();
        assert!((extent.centre.0 - 30.0).hypot(extent.centre.1 - 34.0) < 1e-3, "{extent:?}");
        assert!((extent.side - 10.0 * 2.0_f64.sqrt()).abs() < 1e-3, "{extent:?}");
        assert_eq!(mask.extent(0.0).unwrap().unwrap().side, 20.0);
    }

    #[test]
    fn no_pixels_are_no_hand() {
        let mut mask = HandMask::new().unwrap();
        mask.take(&logits(|x, _| x == 200)).unwrap();
        assert!(mask.extent(0.0).unwrap().is_none());
        assert!(mask.values().unwrap().iter().all(|value| *value == 0.0));
    }
}
