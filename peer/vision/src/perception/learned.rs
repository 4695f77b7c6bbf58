//! Learned eyes as perception has them: what they say of a hand, as an observation.

use gestalt_strategies::Observation;
use opencv::core::{Mat, MatTraitConst, Rect, Size};

use super::{CLOSE, NoObservation};
use crate::eyes::{Eyes, EyesError, Look, Place};

/// A hand that is known is followed for so many frames before a glance is taken at the whole frame again.
const FOLLOWED: u32 = 9;
/// A hand that is less likely one than this is not followed without a glance.
const DOUBTFUL: f32 = 0.9;

/// The eyes of one camera, or of unrelated pictures.
pub struct Learned {
    eyes: Eyes,
    /// Whether a frame follows the one before.
    remembers: bool,
    /// The hand of the last frame.
    memory: Option<Known>,
    mask: Mat,
}

/// A hand that was seen.
#[derive(Clone, Copy)]
struct Known {
    place: Place,
    /// How likely it is one.
    confidence: f32,
    /// In how many frames since the last glance.
    followed: u32,
}

impl Learned {
    pub fn new(remembers: bool) -> Result<Self, EyesError> {
        Ok(Self { eyes: Eyes::shipped()?, remembers, memory: None, mask: Mat::default() })
    }

    /// What the frame shows, and in which part of it. `geometry`: off, that is all of it.
    pub fn observe(&mut self, bgr: &Mat, geometry: bool) -> Result<(Observation, Rect), NoObservation> {
        let known = self.memory.take();
        let about = known.is_some_and(|known| known.confidence < DOUBTFUL || known.followed >= FOLLOWED);
        let look = self.eyes.look_about(bgr, known.map(|known| known.place), about)?;
        let followed = known.filter(|_| !about).map_or(0, |known| known.followed + 1);
        let Look { place, confidence, .. } = look;
        self.memory = self.remembers.then_some(Known { place, confidence, followed });
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

    /// Forgets where the hand was.
    pub fn forget(&mut self) {
        self.memory = None;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eyes::tests::{easily_content, hands};

    /// Eyes that follow a corner of the wall of [`hands`] instead of a hand.
    fn mistaken(confidence: f32) -> Learned {
        let place = Place { x: 30.0, y: 30.0, side: 50.0, up: 0.0 };
        let memory = Some(Known { place, confidence, followed: 0 });
        Learned { eyes: easily_content(), remembers: true, memory, mask: Mat::default() }
    }

    /// After how many frames the hand is seen.
    fn frames_to_the_hand(mut eyes: Learned) -> usize {
        let frame = hands(&[true]);
        (0..100).position(|_| eyes.observe(&frame, true).unwrap().1.x > 50).unwrap()
    }

    #[test]
    fn what_is_followed_is_compared_with_the_rest_of_the_frame_now_and_then() {
        assert_eq!(frames_to_the_hand(mistaken(1.0)), FOLLOWED as usize);
        assert_eq!(frames_to_the_hand(mistaken(0.7)), 0);
        let mut forgetful = mistaken(1.0);
        forgetful.forget();
        assert_eq!(frames_to_the_hand(forgetful), 0);
    }
}
