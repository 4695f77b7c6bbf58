//! The canonical crop: the hand alone, of one size and one contrast, as HOG wants it.

use opencv::core::{
    CV_8U, Mat, MatTrait, MatTraitConst, Rect, Scalar, Size, mean_std_dev, multiply, no_array,
};
use opencv::imgproc::{COLOR_BGR2GRAY, INTER_AREA, cvt_color_def, resize};

use super::blob::MARGIN;
use super::hand::Hand;

/// Side of the square crop, pixels.
pub const SIDE: i32 = 64;

/// Free space around the hand, pixels.
const FRAME: i32 = 4;
/// Mean and standard deviation of the hand's pixels in the crop, so that the strength of the light does not
/// matter.
const MEAN: f64 = 140.0;
const DEVIATION: f64 = 40.0;
/// A hand without texture is not amplified beyond this many times.
const LARGEST_GAIN: f64 = 8.0;

/// Cuts hands out.
#[derive(Default)]
pub struct Canonical {
    grey: Mat,
    small: Mat,
    evened: Mat,
    mask: Mat,
    crop: Mat,
}

impl Canonical {
    /// The last crop.
    pub fn image(&self) -> &Mat {
        &self.crop
    }

    /// Cuts the hand out of the close view: its longer side scaled to fill the crop, centred, upright as in the
    /// frame (turning it by its own axis cost 1 % of accuracy on signs 0-9), black where it is not.
    pub fn crop(&mut self, view: &Mat, hand: &Hand<'_>) -> Result<(), opencv::Error> {
        let bounds = hand.bounds;
        let scale = f64::from(SIDE - 2 * FRAME) / f64::from(bounds.width.max(bounds.height));
        let scaled = |side: i32| ((f64::from(side) * scale).round() as i32).max(1);
        let size = Size::new(scaled(bounds.width), scaled(bounds.height));
        let in_crop = Rect::new((SIDE - size.width) / 2, (SIDE - size.height) / 2, size.width, size.height);
        let in_view = Rect::new(bounds.x - MARGIN, bounds.y - MARGIN, bounds.width, bounds.height);

        cvt_color_def(&Mat::roi(view, in_view)?, &mut self.grey, COLOR_BGR2GRAY)?;
        resize(&self.grey, &mut self.small, size, 0.0, 0.0, INTER_AREA)?;
        resize(&Mat::roi(hand.mask, bounds)?, &mut self.mask, size, 0.0, 0.0, INTER_AREA)?;
        let (mut mean, mut deviation) = (Scalar::default(), Scalar::default());
        mean_std_dev(&self.small, &mut mean, &mut deviation, &self.mask)?;
        let gain = (DEVIATION / deviation[0].max(1.0)).min(LARGEST_GAIN);
        self.small.convert_to(&mut self.evened, CV_8U, gain, MEAN - gain * mean[0])?;

        if self.crop.empty() {
            self.crop = Mat::new_rows_cols_with_default(SIDE, SIDE, CV_8U, Scalar::all(0.0))?;
        } else {
            self.crop.set_to(&Scalar::all(0.0), &no_array())?;
        }
        let mut place = Mat::roi_mut(&mut self.crop, in_crop)?;
        multiply(&self.evened, &self.mask, &mut place, 1.0 / 255.0, -1)
    }
}
