//! The canonical crop: the hand alone, of one size, as HOG wants it.

use opencv::core::{BORDER_CONSTANT, Mat, Point2f, Scalar, Size, multiply};
use opencv::imgproc::{COLOR_BGR2GRAY, INTER_LINEAR, WARP_INVERSE_MAP, cvt_color_def, warp_affine};

use super::hand::{Hand, MARGIN};

/// Side of the square crop, pixels.
pub const SIDE: i32 = 64;

/// Free space around the hand, as a share of its longer side, on each side.
const FRAME: f32 = 0.06;

/// Cuts hands out.
#[derive(Default)]
pub struct Canonical {
    colour: Mat,
    grey: Mat,
    mask: Mat,
    crop: Mat,
}

impl Canonical {
    /// The last crop.
    pub fn crop_image(&self) -> &Mat {
        &self.crop
    }

    /// Cuts the hand out of the canvas: scaled to [`SIDE`], centred, upright as in the frame, black where it is not.
    pub fn crop(&mut self, canvas: &Mat, hand: &Hand) -> Result<(), opencv::Error> {
        let bounds = hand.bounds;
        let side = bounds.width.max(bounds.height) as f32 * (1.0 + 2.0 * FRAME);
        let scale = side / SIDE as f32;
        let origin = Point2f::new(
            bounds.x as f32 + (bounds.width as f32 - side) / 2.0,
            bounds.y as f32 + (bounds.height as f32 - side) / 2.0,
        );
        let from_crop = |margin: f32| -> Result<Mat, opencv::Error> {
            Mat::from_slice_2d(&[[scale, 0.0, origin.x - margin], [0.0, scale, origin.y - margin]])
        };
        let size = Size::new(SIDE, SIDE);
        let flags = INTER_LINEAR | WARP_INVERSE_MAP;
        let black = Scalar::all(0.0);
        warp_affine(
            canvas,
            &mut self.colour,
            &from_crop(MARGIN as f32)?,
            size,
            flags,
            BORDER_CONSTANT,
            black,
        )?;
        cvt_color_def(&self.colour, &mut self.grey, COLOR_BGR2GRAY)?;
        warp_affine(hand.mask, &mut self.mask, &from_crop(0.0)?, size, flags, BORDER_CONSTANT, black)?;
        multiply(&self.grey, &self.mask, &mut self.crop, 1.0 / 255.0, -1)?;
        Ok(())
    }
}
