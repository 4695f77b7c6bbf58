//! A frame, reduced to what motion is looked for in.

use std::time::Duration;

use opencv::core::{self, Mat, Point, Size};
use opencv::imgproc;
use opencv::prelude::*;

use super::MotionError;

/// The smallest frame that can be watched.
const SMALLEST: i32 = 16;

/// A small, smooth picture of a frame.
#[derive(Clone, Default)]
pub(super) struct View {
    pub at: Duration,
    pub picture: Mat,
    /// The least and the greatest value around each pixel, up to `reach` pixels away: what it may become when things tremble
    /// by as much. Found when they are asked for.
    pub least: Mat,
    pub greatest: Mat,
    reach: Option<i32>,
}

impl View {
    /// The view of a frame that was reduced, in the buffers of a view that is no longer needed.
    pub fn of(reduced: &Mat, at: Duration, buffers: Self) -> Result<Self, MotionError> {
        let mut view = Self { at, reach: None, ..buffers };
        // Averages out codec noise and what noise the reduction has left.
        let anchor = Point::new(-1, -1);
        let border = core::BORDER_REPLICATE;
        imgproc::blur(reduced, &mut view.picture, Size::new(3, 3), anchor, border)?;
        Ok(view)
    }

    /// Whether a picture of a frame of that size can be watched.
    pub fn check(bgr: &Mat, frame: Size) -> Result<(), MotionError> {
        let Size { width, height } = frame;
        if width.min(height) < SMALLEST || bgr.typ() != core::CV_8UC3 {
            return Err(MotionError::Frame { width, height, channels: bgr.channels() });
        }
        Ok(())
    }

    /// Whether two views can be compared.
    pub fn is_like(&self, other: &Self) -> bool {
        self.picture.size().ok() == other.picture.size().ok()
    }

    /// Allows for things that tremble by that many pixels.
    pub fn allow(&mut self, reach: i32) -> opencv::Result<()> {
        if self.reach == Some(reach) {
            return Ok(());
        }
        let side = 2 * reach + 1;
        let square = imgproc::get_structuring_element_def(imgproc::MORPH_RECT, Size::new(side, side))?;
        let (anchor, border) = (Point::new(-1, -1), core::BORDER_REPLICATE);
        let value = imgproc::morphology_default_border_value()?;
        imgproc::erode(&self.picture, &mut self.least, &square, anchor, 1, border, value)?;
        imgproc::dilate(&self.picture, &mut self.greatest, &square, anchor, 1, border, value)?;
        self.reach = Some(reach);
        Ok(())
    }

    /// Its picture has changed.
    pub fn renew(&mut self, at: Duration) {
        self.at = at;
        self.reach = None;
    }
}
