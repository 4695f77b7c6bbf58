//! How a robot sees: from a camera frame to the feature vector of the hand in it.
//!
//! ```text
//! BGR frame ─► glance ─► colour and place of the hand ─► close view ─► palm, wrist ─► hand ─┬─► 110 shape features
//! any size     160×120                                   192×192                            └─► crop ─► HOG
//! ```
//!
//! The same hand gives nearly the same features whatever the camera, by the stages of the `layer`: views of a fixed size
//! make resolutions and distances comparable, colours are judged relative to the background, blur and noise are brought
//! to one measure, and every feature is a ratio, an angle or a count.
//!
//! With [`FeatureSet::Embedding`], learned eyes take the place of all of it: see [`eyes`](crate::eyes).

mod background;
mod blob;
mod canonical;
mod colour;
mod feature_set;
mod features;
mod frame;
mod hand;
mod hog;
mod layer;
mod learned;
mod no_observation;
mod resolution;
mod ring;
mod white_balance;

use gestalt_strategies::Observation;
use opencv::core::{Mat, MatTraitConst, Rect, Size, Vector};
use opencv::imgproc::{INTER_AREA, resize};
use opencv::objdetect::HOGDescriptor;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::camera_model::CameraModel;
use crate::eyes::EyesError;
use crate::reduction::Reduction;

use canonical::Canonical;
use colour::ColourModel;
pub use feature_set::{FeatureSet, FeatureSetError, embedding_name};
pub use features::{FEATURES, Feature, GROUPS, features};
use frame::View;
pub(crate) use frame::check;
use hand::HandFinder;
pub use hog::columns as hog_columns;
pub use layer::LayerConfig;
use learned::Learned;
pub use no_observation::{NoHand, NoObservation};
use resolution::Resolution;

/// The size of the whole frame at a glance: enough to see where the hand is and which colour it has.
const GLANCE: Size = Size { width: 160, height: 120 };
/// The size that every frame is squeezed to with the stage of geometry off.
const CANVAS: Size = Size { width: 320, height: 240 };
/// The size of the close view of the hand: enough for the shape of its fingers.
const CLOSE: Size = Size { width: 192, height: 192 };

/// What counts as a hand.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HandConfig {
    /// How much the hand's colour must differ from the background's, in nats of log chromaticity; `0.01..=2.0`.
    /// An empty wall has 0.04, skin before a grey wall 0.3 to 0.7, a coloured glove 1 and more.
    pub minimum_contrast: f32,
    /// The fewest pixels of the camera that a hand covers, `20..=100000`: below it, a finger is two pixels wide. In pixels, not
    /// as a share of the frame: how wide a camera sees says nothing of how well it sees a hand.
    pub minimum_pixels: f32,
    /// The largest share of the frame that a hand covers, `0.1..=1.0`: above it, there is no background to
    /// judge by.
    pub maximum_area: f32,
}

impl Default for HandConfig {
    fn default() -> Self {
        Self { minimum_contrast: 0.12, minimum_pixels: 160.0, maximum_area: 0.7 }
    }
}

impl HandConfig {
    /// Checks every field against its range.
    ///
    /// # Errors
    /// [`PerceptionError::Range`] for the first field outside its range.
    pub fn validate(&self) -> Result<(), PerceptionError> {
        let fields = [
            ("minimum_contrast", self.minimum_contrast, 0.01, 2.0),
            ("minimum_pixels", self.minimum_pixels, 20.0, 100_000.0),
            ("maximum_area", self.maximum_area, 0.1, 1.0),
        ];
        for (field, value, low, high) in fields {
            if !(low..=high).contains(&value) {
                return Err(PerceptionError::Range { field, value, low, high });
            }
        }
        Ok(())
    }
}

/// Why perception cannot start.
#[derive(Debug, Error)]
pub enum PerceptionError {
    /// A field of [`HandConfig`] is outside its range.
    #[error("{field} is {value}: set it within {low}..={high}")]
    Range {
        /// The field.
        field: &'static str,
        /// Its value.
        value: f32,
        /// The smallest value allowed.
        low: f32,
        /// The largest value allowed.
        high: f32,
    },
    /// There are no learned eyes.
    #[error(transparent)]
    Eyes(#[from] EyesError),
    /// OpenCV failed.
    #[error("OpenCV: {0}")]
    OpenCv(#[from] opencv::Error),
}

/// Sees hands. Owns every buffer it needs, so that a frame allocates next to nothing.
pub struct Perception {
    set: FeatureSet,
    layer: LayerConfig,
    canvas: Mat,
    canvas_before: Mat,
    reduction: Reduction,
    glance: View,
    colours: ColourModel,
    close: View,
    resolution: Resolution,
    region: Rect,
    finder: HandFinder,
    balanced: Mat,
    canonical: Canonical,
    hog: HOGDescriptor,
    descriptors: Vector<f32>,
    /// With [`FeatureSet::Embedding`], which needs nothing of the above.
    learned: Option<Learned>,
}

impl Perception {
    /// Eyes that compute this feature set, with all stages of the layer on, of frames that have nothing to do with each
    /// other, of any camera.
    ///
    /// # Errors
    /// See [`PerceptionError`].
    pub fn new(set: FeatureSet, hand: HandConfig) -> Result<Self, PerceptionError> {
        Self::build(set, hand, LayerConfig::ALL, None)
    }

    /// Eyes that compute this feature set, of the frames of this camera one after another, with these stages of the
    /// layer.
    ///
    /// # Errors
    /// See [`PerceptionError`].
    pub fn for_camera(
        set: FeatureSet,
        hand: HandConfig,
        layer: LayerConfig,
        camera: &CameraModel,
    ) -> Result<Self, PerceptionError> {
        Self::build(set, hand, layer, Some(camera))
    }

    fn build(
        set: FeatureSet,
        hand: HandConfig,
        layer: LayerConfig,
        camera: Option<&CameraModel>,
    ) -> Result<Self, PerceptionError> {
        hand.validate()?;
        let period = camera.map(|camera| camera.period().as_secs_f32());
        Ok(Self {
            set,
            layer,
            canvas: Mat::default(),
            canvas_before: Mat::default(),
            reduction: Reduction::default(),
            glance: View::new(Some(GLANCE)),
            colours: ColourModel::new(hand.minimum_contrast, layer.colour, period),
            close: View::new((layer.geometry && layer.resolution).then_some(CLOSE)),
            resolution: Resolution::new(layer.resolution, camera),
            region: Rect::default(),
            finder: HandFinder::new(hand),
            balanced: Mat::default(),
            canonical: Canonical::default(),
            hog: hog::descriptor()?,
            descriptors: Vector::new(),
            learned: (set == FeatureSet::Embedding).then(|| Learned::new(camera.is_some())).transpose()?,
        })
    }

    /// Which stages of the layer are on.
    #[must_use]
    pub fn layer(&self) -> LayerConfig {
        self.layer
    }

    /// Which feature set this computes.
    #[must_use]
    pub fn feature_set(&self) -> FeatureSet {
        self.set
    }

    /// Looks at one frame: 8-bit BGR of any size.
    ///
    /// # Errors
    /// See [`NoObservation`]; a frame without a hand is [`NoObservation::NoHand`].
    pub fn observe(&mut self, bgr: &Mat) -> Result<Observation, NoObservation> {
        self.observe_before(bgr, None)
    }

    /// Looks at one frame of a scene that is known without anyone in it: `background`, 8-bit BGR of any size, of the
    /// frame's aspect. What was there before is no hand, whatever its colour. Learned eyes do not need it.
    ///
    /// # Errors
    /// As [`Self::observe`].
    pub fn observe_before(
        &mut self,
        bgr: &Mat,
        background: Option<&Mat>,
    ) -> Result<Observation, NoObservation> {
        check(bgr)?;
        if let Some(background) = background {
            check(background)?;
        }
        if self.layer.geometry {
            let mut reduction = std::mem::take(&mut self.reduction);
            let taken = if self.learned.is_none() { reduction.take(bgr, bgr.size()?) } else { Ok(()) };
            let seen = taken.map_err(NoObservation::from);
            let seen = seen.and_then(|()| self.see(bgr, background, Some(&reduction.image), 1.0));
            self.reduction = reduction;
            return seen;
        }
        let (mut canvas, mut before) =
            (std::mem::take(&mut self.canvas), std::mem::take(&mut self.canvas_before));
        resize(bgr, &mut canvas, CANVAS, 0.0, 0.0, INTER_AREA)?;
        if let Some(background) = background {
            resize(background, &mut before, CANVAS, 0.0, 0.0, INTER_AREA)?;
        }
        let scale = CANVAS.width as f32 / bgr.cols() as f32;
        let seen = self.see(&canvas, background.map(|_| &before), None, scale);
        self.region = Rect::new(0, 0, bgr.cols(), bgr.rows());
        (self.canvas, self.canvas_before) = (canvas, before);
        seen
    }

    /// The same, of a frame that was reduced already.
    pub(crate) fn observe_reduced(
        &mut self,
        (bgr, reduced): (&Mat, &Mat),
        background: Option<&Mat>,
    ) -> Result<Observation, NoObservation> {
        if !self.layer.geometry {
            return self.observe_before(bgr, background);
        }
        check(bgr)?;
        self.see(bgr, background, Some(reduced), 1.0)
    }

    /// `reduced`: the frame at a glance, where that is known; `scale`: pixels of this frame per pixel of the camera.
    fn see(
        &mut self,
        bgr: &Mat,
        before: Option<&Mat>,
        reduced: Option<&Mat>,
        scale: f32,
    ) -> Result<Observation, NoObservation> {
        let whole = Rect::new(0, 0, bgr.cols(), bgr.rows());
        self.region = whole;
        if let Some(learned) = &mut self.learned {
            let observation;
            (observation, self.region) = learned.observe(bgr, self.layer.geometry)?;
            return Ok(observation);
        }
        match reduced {
            Some(reduced) => self.glance.look_at_reduced((reduced, bgr.size()?), before)?,
            None => self.glance.look(bgr, before, whole)?,
        }
        // Where nothing stands out the mask of the frame before must not stay.
        self.colours.learn(&self.glance).inspect_err(|_| self.glance.mask = Mat::default())?;
        self.colours.mark(&mut self.glance)?;
        let found = self.finder.locate(&self.glance)?;
        self.region = if self.layer.geometry { found } else { whole };
        self.close.look(bgr, before, self.region)?;
        self.resolution.even_out(bgr, &mut self.close, scale)?;
        self.colours.mark(&mut self.close)?;
        let hand = self.finder.find(&self.close)?;
        let features = match self.set {
            FeatureSet::Shape => features::measure(&hand)?,
            FeatureSet::Hog | FeatureSet::Embedding => {
                self.colours.balance().apply(&self.close.image, &mut self.balanced)?;
                self.canonical.crop(&self.balanced, &hand)?;
                hog::compute(&self.hog, self.canonical.image(), &mut self.descriptors)?;
                self.descriptors.as_slice().to_vec()
            }
        };
        Ok(Observation { features, quality: self.colours.plausibility() * hand.plausibility })
    }

    /// Forgets where the hand was: the next frame does not follow the last one.
    pub fn forget(&mut self) {
        if let Some(learned) = &mut self.learned {
            learned.forget();
        }
    }

    /// What the white balance of the last frame multiplies its blue, green and red channel by.
    #[must_use]
    pub fn gains(&self) -> [f32; 3] {
        self.colours.balance().gains()
    }

    /// The last frame, or any other, in the white balance of the last one.
    ///
    /// # Errors
    /// When the image is not 8-bit BGR.
    pub fn balance(&self, bgr: &Mat) -> Result<Mat, opencv::Error> {
        let mut balanced = Mat::default();
        self.colours.balance().apply(bgr, &mut balanced)?;
        Ok(balanced)
    }

    /// The part of the last frame that was looked at closely, in pixels of the frame.
    #[must_use]
    pub fn region(&self) -> Rect {
        self.region
    }

    /// The pixels of the last frame, at a glance, that had the colour of the hand (255; elsewhere 0). Empty before the
    /// first.
    #[must_use]
    pub fn candidates(&self) -> &Mat {
        &self.glance.mask
    }

    /// The pixels of the last hand observed (255; elsewhere 0): [`Self::region`], scaled to fit 192×192 (in the
    /// frame's own pixels where a stage of the layer that scales is off), with a margin of one pixel. Empty before the first hand.
    #[must_use]
    pub fn mask(&self) -> &Mat {
        self.learned.as_ref().map_or(self.finder.mask(), Learned::mask)
    }

    /// The canonical crop of the last hand observed: 64×64, for learned eyes 48×48, 8-bit grey, black off the hand. Empty
    /// or black before the first, and with a feature set that does not need it.
    #[must_use]
    pub fn crop(&self) -> &Mat {
        self.learned.as_ref().map_or(self.canonical.image(), Learned::crop)
    }
}

#[cfg(test)]
mod tests;
