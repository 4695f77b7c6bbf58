//! The canvas: any frame, scaled to a size that makes cameras comparable.

use opencv::core::{CV_8U, Mat, MatTraitConst, Size};
use opencv::imgproc::{INTER_AREA, INTER_LINEAR, resize};

use super::NoObservation;

/// The canvas is the largest image of the frame's aspect ratio within these limits.
pub const CANVAS: Size = Size { width: 320, height: 240 };

/// The shortest side of a canvas on which a hand can be told from a line.
const SHORTEST: i32 = 24;

/// Scales frames to the canvas.
#[derive(Default)]
pub struct Canvas {
    image: Mat,
}

impl Canvas {
    /// The frame, scaled to fit [`CANVAS`] with its aspect ratio kept.
    ///
    /// Nothing is padded: a margin of one colour would pass for background.
    pub fn fit(&mut self, bgr: &Mat) -> Result<&Mat, NoObservation> {
        let (width, height) = (bgr.cols(), bgr.rows());
        if width <= 0 || height <= 0 {
            return Err(NoObservation::EmptyFrame);
        }
        if bgr.channels() != 3 || bgr.depth() != CV_8U {
            return Err(NoObservation::Format { channels: bgr.channels(), depth: bgr.depth() });
        }
        let scale =
            (f64::from(CANVAS.width) / f64::from(width)).min(f64::from(CANVAS.height) / f64::from(height));
        let fitted = |side: i32| (f64::from(side) * scale).round() as i32;
        let size = Size::new(fitted(width), fitted(height));
        if size.width.min(size.height) < SHORTEST {
            return Err(NoObservation::TooNarrow { width, height });
        }
        // Area averaging when shrinking: also what makes the noise of a large and a small camera comparable.
        let interpolation = if scale < 1.0 { INTER_AREA } else { INTER_LINEAR };
        resize(bgr, &mut self.image, size, 0.0, 0.0, interpolation)?;
        Ok(&self.image)
    }
}
