//! Learned eyes as perception has them: what they say of a hand, as an observation.

use gestalt_strategies::Observation;
use opencv::core::{Mat, MatTraitConst, Rect, Size};

use super::{CLOSE, NoObservation};
use crate::eyes::{Eyes, EyesError, Place};

/// The eyes of one camera, or of unrelated pictures.
pub struct Learned {
    eyes: Eyes,
    /// Whether a frame follows the one before.
    remembers: bool,
    /// Where the hand of the last frame is.
    memory: Option<Place>,
    mask: Mat,
}

impl Learned {
    pub fn new(remembers: bool) -> Result<Self, EyesError> {
        Ok(Self { eyes: Eyes::shipped()?, remembers, memory: None, mask: Mat::default() })
    }

    /// What the frame shows, and in which part of it. `geometry`: off, that is all of it.
    pub fn observe(&mut self, bgr: &Mat, geometry: bool) -> Result<(Observation, Rect), NoObservation> {
        let memory = self.memory.take();
        let look = self.eyes.look(bgr, memory)?;
        self.memory = self.remembers.then_some(look.place);
        let frame = bgr.size()?;
        let region = if geometry { look.region(frame) } else { Rect::new(0, 0, frame.width, frame.height) };
        let fit = |limit: i32, side: i32| f64::from(limit) / f64::from(side);
        let scale = fit(CLOSE.width, region.width).min(fit(CLOSE.height, region.height));
        let scaled = |side: i32| ((f64::from(side) * scale).round() as i32).max(1);
        let size = Size::new(scaled(region.width), scaled(region.height));
        self.eyes.draw_mask(&look, region, size, &mut self.mask)?;
        let observation = Observation { features: look.embedding.to_vec(), quality: look.confidence };
        Ok((observation, region))
    }

    /// The pixels of the last hand in its region, with a margin of one pixel.
    pub fn mask(&self) -> &Mat {
        &self.mask
    }

    /// The last hand as it was read.
    pub fn crop(&self) -> &Mat {
        self.eyes.crop()
    }
}
