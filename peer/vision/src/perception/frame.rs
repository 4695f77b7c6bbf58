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
    limit: Option<Size>,
    /// The part of the frame that is seen, in pixels of the frame.
    pub region: Rect,
    /// The frame's size.
    pub frame: Size,
    /// What is seen.
    pub image: Mat,
    /// The same part of the scene without anyone; empty when that is not known.
    pub before: Mat,
    /// Its pixels (255; others 0) that have the colour of the hand, and the steps on the way there.
    pub mask: Mat,
    pub score: Mat,
    pub blurred: Mat,
    /// Whether the hand may have holes that it does not have: where it is as white as the background.
    pub patchy: bool,
}

impl View {
    /// Views are the largest images of their region's aspect ratio within this limit; without one, they have the
    /// frame's own pixels.
    pub fn new(limit: Option<Size>) -> Self {
        Self {
            limit,
            region: Rect::default(),
            frame: Size::default(),
            image: Mat::default(),
            before: Mat::default(),
            mask: Mat::default(),
            score: Mat::default(),
            blurred: Mat::default(),
            patchy: false,
        }
    }

    /// Looks at a region of the frame, and at the same region of the scene without anyone, where that is known.
    ///
    /// Nothing is padded: a margin of one colour would pass for background.
    pub fn look(&mut self, frame: &Mat, before: Option<&Mat>, region: Rect) -> Result<(), NoObservation> {
        let size = self.size_for(region)?;
        scale_part(frame, region, size, &mut self.image)?;
        self.turn_to(region, frame.size()?, size, before)
    }

    /// Looks at the whole of a frame of that size, which was reduced already; and at the scene without anyone.
    pub fn look_at_reduced(
        &mut self,
        (reduced, frame): (&Mat, Size),
        before: Option<&Mat>,
    ) -> Result<(), NoObservation> {
        let whole = Rect::new(0, 0, frame.width, frame.height);
        let size = self.size_for(whole)?;
        let reduced_to = reduced.size()?;
        scale_part(reduced, Rect::new(0, 0, reduced_to.width, reduced_to.height), size, &mut self.image)?;
        self.turn_to(whole, frame, size, before)
    }

    /// The size at which a region is seen.
    fn size_for(&self, region: Rect) -> Result<Size, NoObservation> {
        let scale = self.limit.map_or(1.0, |limit| {
            let fit = |limit: i32, side: i32| f64::from(limit) / f64::from(side);
            fit(limit.width, region.width).min(fit(limit.height, region.height))
        });
        let scaled = |side: i32| (f64::from(side) * scale).round() as i32;
        let size = Size::new(scaled(region.width), scaled(region.height));
        if size.width.min(size.height) < SHORTEST {
            return Err(NoObservation::TooNarrow { width: region.width, height: region.height });
        }
        Ok(size)
    }

    /// Notes what is seen now, and looks at the same of the scene without anyone.
    fn turn_to(
        &mut self,
        region: Rect,
        frame: Size,
        size: Size,
        before: Option<&Mat>,
    ) -> Result<(), NoObservation> {
        (self.region, self.frame) = (region, frame);
        match before {
            Some(before) => {
                let whole = before.size()?;
                let part = within(region, self.frame, whole);
                scale_part(before, part, size, &mut self.before)?;
            }
            None => self.before = Mat::default(),
        }
        Ok(())
    }

    /// Pixels of the view per pixel of the frame.
    pub fn scale(&self) -> f32 {
        self.image.cols() as f32 / self.region.width as f32
    }
}

/// A part of an image at that size. Area averaging when shrinking: it also makes the noise of large and small cameras
/// comparable.
fn scale_part(image: &Mat, part: Rect, size: Size, out: &mut Mat) -> Result<(), opencv::Error> {
    let interpolation = if size.width < part.width { INTER_AREA } else { INTER_LINEAR };
    resize(&Mat::roi(image, part)?, out, size, 0.0, 0.0, interpolation)
}

/// A region of the frame, in the pixels of another image of the same scene.
fn within(region: Rect, frame: Size, other: Size) -> Rect {
    let span = |start: i32, length: i32, from: i32, to: i32| {
        let scale = f64::from(to) / f64::from(from);
        let first = ((f64::from(start) * scale).round() as i32).min(to - 1);
        let end = (f64::from(start + length) * scale).round() as i32;
        (first, (end.min(to) - first).max(1))
    };
    let (x, width) = span(region.x, region.width, frame.width, other.width);
    let (y, height) = span(region.y, region.height, frame.height, other.height);
    Rect::new(x, y, width, height)
}
