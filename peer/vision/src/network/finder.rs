//! The finder: where hands may be in a whole frame.

use super::convolution::{Shape, Workspace};
use super::decoder::Decoder;
use super::feature_map::FeatureMap;
use super::tensors::{Tensors, WeightsError};
use super::trunk::Trunk;

/// Tensors of its file: weights and biases of 7 + 6 convolutions.
const TENSORS: usize = 26;

/// Sees a whole frame at a glance.
pub struct Finder {
    trunk: Trunk,
    decoder: Decoder,
    work: Workspace,
}

impl Finder {
    /// With the weights of a file.
    ///
    /// # Errors
    /// See [`WeightsError`].
    pub fn decode(bytes: &[u8]) -> Result<Self, WeightsError> {
        let tensors = &mut Tensors::decode(bytes, TENSORS)?;
        Ok(Self {
            trunk: Trunk::decode([3, 12, 24, 48, 64], Shape::halving, tensors)?,
            decoder: Decoder::decode((64, 48, 32), Some(24), 5, tensors)?,
            work: Workspace::default(),
        })
    }

    /// Five maps of a quarter of the picture's size: the logit of a hand's centre, ln(side / 24 pixels of the picture),
    /// sine and cosine of the way its fingers point, the logit of a hand's pixels.
    ///
    /// `picture`: blue, green and red of any size, together of mean 0; trained on 160×120 and 320×240.
    ///
    /// # Panics
    /// When the picture has not three channels, or no pixels.
    pub fn run(&mut self, picture: &FeatureMap) -> &FeatureMap {
        let (channels, height, width) = picture.shape();
        assert!(channels == 3 && height * width > 0, "a picture of {channels}×{height}×{width}");
        self.trunk.run(picture, &mut self.work);
        self.decoder.run(&mut self.trunk, &mut self.work)
    }
}
