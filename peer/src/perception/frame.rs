//! Views of a frame: the whole of it at a glance, then a closer look at the hand, each of a size that makes
//! cameras alike.

use opencv::core::{CV_8U, Mat, MatTraitConst, Rect, Size};
use opencv::imgproc::{INTER_AREA, INTER_LINEAR, resize};

use super::NoObservation;

/// The shortest side of a view in which a hand can be told from a line.
const SHORTEST: i32 = 12;

/// Checks that a frame is 8-bit BGR with pixels in it.
pub fn check(frame: &Mat) -> Result<(), NoObservation> {
    if frame.rows() <= 0 || frame.cols() <= 0 {
        return Err(NoObservation::EmptyFrame);
    }
    if frame.channels() != 3 || frame.depth() != CV_8U {
        return Err(NoObservation::Format { channels: frame.channels(), depth: frame.depth() });
    }
    Ok(())
}

/// A part of a frame, scaled to a size of our own choice.
pub struct View {
    limit: Size,
    /// The part of the frame that is seen, in pixels of the frame.
    pub region: Rect,
    /// The frame's size.
    pub frame: Size,
    /// What is seen.
    pub image: Mat,
    /// Its pixels (255; others 0) that have the colour of the hand, and the steps on the way there.
    pub mask: Mat,
    pub score: Mat,
    pub blurred: Mat,
}

impl View {
    /// Views are the largest images of their region's aspect ratio within this limit.
    pub fn new(limit: Size) -> Self {
        Self {
            limit,
            region: Rect::default(),
            frame: Size::default(),
            image: Mat::default(),
            mask: Mat::default(),
            score: Mat::default(),
            blurred: Mat::default(),
        }
    }

    /// Looks at a region of the frame.
    ///
    /// Nothing is padded: a margin of one colour would pass for background.
    pub fn look(&mut self, frame: &Mat, region: Rect) -> Result<(), NoObservation> {
        let fit = |limit: i32, side: i32| f64::from(limit) / f64::from(side);
        let scale = fit(self.limit.width, region.width).min(fit(self.limit.height, region.height));
        let scaled = |side: i32| (f64::from(side) * scale).round() as i32;
        let size = Size::new(scaled(region.width), scaled(region.height));
        if size.width.min(size.height) < SHORTEST {
            return Err(NoObservation::TooNarrow { width: region.width, height: region.height });
        }
        // Area averaging when shrinking: it also makes the noise of large and small cameras comparable.
        let interpolation = if scale < 1.0 { INTER_AREA } else { INTER_LINEAR };
        resize(&Mat::roi(frame, region)?, &mut self.image, size, 0.0, 0.0, interpolation)?;
        self.region = region;
        self.frame = frame.size()?;
        Ok(())
    }

    /// Pixels of the view per pixel of the frame.
    pub fn scale(&self) -> f32 {
        self.image.cols() as f32 / self.region.width as f32
    }
}
