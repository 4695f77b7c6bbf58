//! Learned eyes: three small networks that find a hand, look at it closely, and say what it shows.
//!
//! ```text
//! frame ─► glance ─► candidates ─► close looks ─► one more, with mask ─► reading ─► Look
//!          160×120   at most 3     64×64 each      and of its mirror image   48×48
//! ```
//!
//! Where the hand was in the last frame, one close look replaces all before the reading; from time to time a glance is taken all
//! the same, lest a better hand be overlooked for the sake of the one that is known. Where nothing convinces at first, a
//! glance of twice the size looks for small hands. Every square is cut out of the frame itself, turned so that the hand's
//! fingers point up; what the networks are shown is described at `standard`.

mod affine;
mod candidates;
mod glance;
mod hand_mask;
mod look;
mod place;
mod probability;
mod pyramid;
mod reading;
mod standard;

use opencv::core::{
    BORDER_CONSTANT, CMP_GT, Mat, MatTraitConst, Rect, Scalar, Size, compare, copy_make_border,
};
use opencv::imgproc::{INTER_LINEAR, warp_affine};
use thiserror::Error;

use crate::network::{Counter, FeatureMap, Finder, Refinement, Refiner, WeightsError, shipped};
use crate::perception::{NoHand, NoObservation, check};

use affine::Affine;
use candidates::{Candidate, candidates};
use glance::Glance;
use hand_mask::HandMask;
pub use look::Look;
use look::ROOM;
pub use place::Place;
use pyramid::Pyramid;
use reading::Reading;
use standard::standardise;

/// The least confidence that a hand is one.
pub const MINIMUM: f32 = 0.55;
/// A hand that is this likely where the last one was is the same.
const STILL_THERE: f32 = 0.6;
/// A hand must be found so many times as surely as the one that is known to take its place: of two hands alike, one stays.
const BETTER: f32 = 1.1;
/// A place nearer to the known one than this share of the larger one's side is the known hand's.
const SAME: f32 = 0.5;
/// The finer look is for hands up to this size, in pixels of a frame 160 wide: of larger ones it finds parts.
const SMALL: f32 = 28.0;
/// A count that is less likely than this is read once more, mirrored.
const SURE: f32 = 0.95;
/// The hand is read in a square this much larger than its pixels.
const MARGIN: f64 = 1.18;
/// What one close look corrects at most: the centre in sides of the square, the size in nats.
const FURTHEST: f32 = 0.4;
const LARGEST: f32 = 0.7;

/// Why there are no eyes.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum EyesError {
    /// Weights that are none of these networks'.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// OpenCV failed.
    #[error("OpenCV: {0}")]
    OpenCv(#[from] opencv::Error),
}

/// Sees hands. Owns every buffer it needs.
pub struct Eyes {
    finder: Finder,
    refiner: Refiner,
    counter: Counter,
    pyramid: Pyramid,
    glance: Glance,
    square: Mat,
    picture: FeatureMap,
    mirrored: FeatureMap,
    logits: Vec<f32>,
    mask: HandMask,
    reading: Reading,
    warped: Mat,
    inside: Mat,
}

/// A place that may be a hand's, looked at once.
#[derive(Clone, Copy)]
struct Suspect {
    /// The finder's.
    peak: f32,
    /// The finder's and the refiner's together.
    score: f32,
    place: Place,
}

/// What a first look has found so far.
#[derive(Default)]
struct Search {
    best: Option<Suspect>,
    /// How likely the likeliest of the places was that were not worth a close look.
    dismissed: f32,
}

/// What one close look found.
#[derive(Debug)]
struct Closeup {
    hand: f32,
    view: Place,
    place: Place,
}

impl Eyes {
    /// With the weights that the program brings along.
    ///
    /// # Errors
    /// OpenCV's; the weights are those of the networks.
    pub fn shipped() -> Result<Self, EyesError> {
        Self::new(shipped::FINDER, shipped::REFINER, shipped::COUNTER)
    }

    /// With the weights of these files.
    ///
    /// # Errors
    /// See [`EyesError`].
    pub fn new(finder: &[u8], refiner: &[u8], counter: &[u8]) -> Result<Self, EyesError> {
        Ok(Self {
            finder: Finder::decode(finder)?,
            refiner: Refiner::decode(refiner)?,
            counter: Counter::decode(counter)?,
            pyramid: Pyramid::default(),
            glance: Glance::default(),
            square: Mat::default(),
            picture: FeatureMap::default(),
            mirrored: FeatureMap::default(),
            logits: Vec::new(),
            mask: HandMask::new()?,
            reading: Reading::new()?,
            warped: Mat::default(),
            inside: Mat::default(),
        })
    }

    /// Looks at one frame: 8-bit BGR of any size. `memory`: where the hand was in the last frame of the same camera.
    ///
    /// # Errors
    /// See [`NoObservation`]; a frame without a hand is [`NoHand::Unrecognised`].
    pub fn look(&mut self, frame: &Mat, memory: Option<Place>) -> Result<Look, NoObservation> {
        self.look_about(frame, memory, false)
    }

    /// The same; `about`: where the hand is still there, also takes a glance at the whole frame, and reads another hand instead
    /// when that is found clearly more surely.
    ///
    /// # Errors
    /// As [`Self::look`].
    pub fn look_about(
        &mut self,
        frame: &Mat,
        memory: Option<Place>,
        about: bool,
    ) -> Result<Look, NoObservation> {
        check(frame)?;
        self.pyramid.clear();
        let size = frame.size()?;
        if let Some(place) = memory.filter(|place| place.is_within(size)) {
            let seen = self.close_up_with_mask(frame, place)?;
            if seen.hand >= STILL_THERE {
                let better = if about { self.better(frame, &seen)? } else { None };
                if let Some(better) = better {
                    match self.read_suspect(frame, better) {
                        Err(NoObservation::NoHand(_)) => (),
                        read => return read,
                    }
                    // The mask is that of the other one.
                    self.close_up_with_mask(frame, place)?;
                }
                match self.read(frame, &seen, seen.hand) {
                    Err(NoObservation::NoHand(_)) => (),
                    read => return read,
                }
            }
        }
        let mut search = Search::default();
        self.search(frame, 1, &mut search)?;
        // A first look that does not convince is followed by a finer one.
        if search.best.is_none_or(|best| best.score < MINIMUM) {
            self.search(frame, 2, &mut search)?;
        }
        let Some(best) = search.best else { return Err(unrecognised(search.dismissed)) };
        self.read_suspect(frame, best)
    }

    /// Looks once more at what was found, and reads it.
    fn read_suspect(&mut self, frame: &Mat, found: Suspect) -> Result<Look, NoObservation> {
        let seen = self.close_up_with_mask(frame, found.place)?;
        self.read(frame, &seen, found.peak.sqrt() * seen.hand)
    }

    /// Another place that is clearly more surely a hand's than the known one would be at a first look. A known hand that a glance
    /// does not show is as good as none.
    fn better(&mut self, frame: &Mat, known: &Closeup) -> Result<Option<Suspect>, NoObservation> {
        let letterbox = self.glance.take(frame, 1)?;
        let found: Vec<Candidate> = candidates(self.finder.run(self.glance.picture())).collect();
        let is_known = |found: &Candidate| letterbox.in_frame(found.place).is_near(&known.place, SAME);
        let peak = found.iter().filter(|found| is_known(found)).map(|found| found.peak).fold(0.0, f32::max);
        let (mut needed, mut better) = ((BETTER * peak.sqrt() * known.hand).max(MINIMUM), None);
        for found in found.iter().filter(|found| !is_known(found)) {
            let most = found.peak.sqrt();
            if most > needed {
                let seen = self.close_up(frame, letterbox.in_frame(found.place))?;
                let score = most * seen.hand;
                // What one close look corrects may lead to the known hand.
                if score > needed && !seen.place.is_near(&known.place, SAME) {
                    (needed, better) = (score, Some(Suspect { peak: found.peak, score, place: seen.place }));
                }
            }
        }
        Ok(better)
    }

    /// Takes a glance at so many times 160×120, and a close look at whatever may be better than the best so far.
    fn search(&mut self, frame: &Mat, times: i32, search: &mut Search) -> Result<(), NoObservation> {
        let letterbox = self.glance.take(frame, times)?;
        for found in candidates(self.finder.run(self.glance.picture())) {
            if times > 1 && found.place.side > SMALL * times as f32 {
                continue;
            }
            // What it is at most, for the refiner says 1 at most.
            let most = found.peak.sqrt();
            if most < MINIMUM {
                search.dismissed = search.dismissed.max(most);
            } else if search.best.is_none_or(|best| most > best.score) {
                let seen = self.close_up(frame, letterbox.in_frame(found.place))?;
                let score = most * seen.hand;
                if search.best.is_none_or(|best| score > best.score) {
                    search.best = Some(Suspect { peak: found.peak, score, place: seen.place });
                }
            }
        }
        Ok(())
    }

    /// Looks closely at one place.
    fn close_up(&mut self, frame: &Mat, view: Place) -> Result<Closeup, opencv::Error> {
        self.cut(frame, view)?;
        Ok(Closeup::new(view, self.refiner.run(&self.picture)))
    }

    /// The same of the place and of its mirror image, which shows as much of a hand; and takes the hand's mask.
    fn close_up_with_mask(&mut self, frame: &Mat, view: Place) -> Result<Closeup, opencv::Error> {
        self.cut(frame, view)?;
        let (said, logits) = self.refiner.run_with_mask(&self.picture);
        logits.clone_into(&mut self.logits);
        self.mirrored.mirror(&self.picture);
        let (mirrored, logits) = self.refiner.run_with_mask(&self.mirrored);
        let rows = self.logits.chunks_exact_mut(Refiner::SIDE).zip(logits.chunks_exact(Refiner::SIDE));
        for (logit, other) in rows.flat_map(|(row, other)| row.iter_mut().zip(other.iter().rev())) {
            *logit = f32::midpoint(*logit, *other);
        }
        self.mask.take(&self.logits)?;
        Ok(Closeup::new(view, said.mean(mirrored)))
    }

    fn cut(&mut self, frame: &Mat, view: Place) -> Result<(), opencv::Error> {
        let onto = Affine::onto(view, ROOM, Refiner::SIDE);
        self.pyramid.cut(frame, &onto, Refiner::SIDE, &mut self.square)?;
        standardise(&self.square, &mut self.picture)
    }

    /// Reads the hand whose mask was taken last. `found`: how sure those are who found it.
    fn read(&mut self, frame: &Mat, seen: &Closeup, found: f32) -> Result<Look, NoObservation> {
        if found < MINIMUM {
            return Err(unrecognised(found));
        }
        let Closeup { view, place, .. } = *seen;
        // Without pixels there is nothing to read.
        let extent = self.mask.extent(place.up - view.up)?.ok_or_else(|| unrecognised(0.0))?;
        let onto_mask = Affine::onto(view, ROOM, Refiner::SIDE);
        let (x, y) = onto_mask.inverse().apply(extent.centre);
        let side = (MARGIN * extent.side / onto_mask.scale()) as f32;
        let hand = Place { x: x as f32, y: y as f32, side, up: place.up };
        let onto = Affine::onto(hand, 1.0, Counter::SIDE);
        let picture = self.reading.cut((&mut self.pyramid, frame), &onto, (self.mask.image(), &onto_mask))?;
        let mut count = self.counter.run(picture);
        if probability::among(count.counts).iter().all(|likely| *likely < SURE) {
            // A hand's mirror image shows as many fingers.
            count = count.mean(&self.counter.run(self.reading.mirrored()));
        }
        let confidence = found * probability::alone(count.hand);
        if confidence < MINIMUM {
            return Err(unrecognised(confidence));
        }
        Ok(Look {
            place,
            confidence,
            view,
            mask: self.mask.values()?.to_vec(),
            embedding: count.embedding,
            counts: probability::among(count.counts),
            fingers: count.fingers.map(probability::alone),
        })
    }

    /// The last hand as it was read: 48×48, 8-bit grey, its fingers up, black off the hand. Black before the first.
    #[must_use]
    pub fn crop(&self) -> &Mat {
        self.reading.crop()
    }

    /// The pixels of the hand of the last look (255; elsewhere 0) in a region of the frame scaled to that size, with a
    /// margin of one pixel.
    pub(crate) fn draw_mask(
        &mut self,
        look: &Look,
        region: Rect,
        size: Size,
        out: &mut Mat,
    ) -> Result<(), opencv::Error> {
        let step = |whole: i32, part: i32| f64::from(whole) / f64::from(part);
        let (x, y) = (step(region.width, size.width), step(region.height, size.height));
        let corner = |first: i32, step: f64| f64::from(first) + (step - 1.0) / 2.0;
        let in_frame = Affine([[x, 0.0, corner(region.x, x)], [0.0, y, corner(region.y, y)]]);
        let matrix = in_frame.inverse().after(&look.onto_mask().inverse()).matrix();
        let (mask, nothing) = (self.mask.image(), Scalar::default());
        warp_affine(mask, &mut self.warped, &matrix, size, INTER_LINEAR, BORDER_CONSTANT, nothing)?;
        compare(&self.warped, &Scalar::all(0.5), &mut self.inside, CMP_GT)?;
        copy_make_border(&self.inside, out, 1, 1, 1, 1, BORDER_CONSTANT, nothing)
    }
}

fn unrecognised(confidence: f32) -> NoObservation {
    NoHand::Unrecognised { confidence, needed: MINIMUM }.into()
}

impl Closeup {
    fn new(view: Place, said: Refinement) -> Self {
        let sides = |of: f32| of.clamp(-FURTHEST, FURTHEST) * ROOM as f32;
        let larger = said.larger.clamp(-LARGEST, LARGEST).exp();
        let place = view.moved((sides(said.right), sides(said.down)), larger, said.sine.atan2(said.cosine));
        Self { hand: probability::alone(said.hand), view, place }
    }
}

#[cfg(test)]
pub(crate) mod tests;
