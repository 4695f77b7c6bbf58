//! The refiner: whether a square of the frame shows a hand, where exactly, and its pixels.

use super::convolution::{Convolution, Shape, Workspace};
use super::decoder::Decoder;
use super::dense::Dense;
use super::feature_map::FeatureMap;
use super::pooling::shuffle_four;
use super::tensors::{Tensors, WeightsError};
use super::trunk::Trunk;

/// Tensors of its file: weights and biases of 7 + 3 + 5 layers.
const TENSORS: usize = 30;

/// What the refiner says of a square, in which the hand's fingers should point up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refinement {
    /// The logit of its being a hand.
    pub hand: f32,
    /// How far right of the square's centre the hand's is, in sides of the square.
    pub right: f32,
    /// How far below.
    pub down: f32,
    /// ln(the hand's side / the side it was taken to have).
    pub larger: f32,
    /// Sine of the way its fingers point, from up clockwise.
    pub sine: f32,
    /// Cosine of it.
    pub cosine: f32,
}

impl Refinement {
    /// Between what is said of a picture, and of its mirror image.
    #[must_use]
    pub fn mean(self, mirrored: Self) -> Self {
        Self {
            hand: f32::midpoint(self.hand, mirrored.hand),
            right: f32::midpoint(self.right, -mirrored.right),
            down: f32::midpoint(self.down, mirrored.down),
            larger: f32::midpoint(self.larger, mirrored.larger),
            sine: f32::midpoint(self.sine, -mirrored.sine),
            cosine: f32::midpoint(self.cosine, mirrored.cosine),
        }
    }
}

/// Looks closely at one place.
pub struct Refiner {
    trunk: Trunk,
    squeeze: Convolution,
    dense: Dense,
    head: Dense,
    decoder: Decoder,
    squeezed: FeatureMap,
    mask: FeatureMap,
    work: Workspace,
}

impl Refiner {
    /// Side of the square it looks at, in pixels.
    pub const SIDE: usize = 64;

    /// With the weights of a file.
    ///
    /// # Errors
    /// See [`WeightsError`].
    pub fn decode(bytes: &[u8]) -> Result<Self, WeightsError> {
        let tensors = &mut Tensors::decode(bytes, TENSORS)?;
        Ok(Self {
            trunk: Trunk::decode([3, 12, 16, 40, 64], Shape::usual, tensors)?,
            squeeze: Convolution::decode(Shape { rectified: true, ..Shape::point(64, 12) }, tensors)?,
            dense: Dense::decode((12 * 64, 32), true, tensors)?,
            head: Dense::decode((32, 6), false, tensors)?,
            decoder: Decoder::decode((64, 40, 24), None, 4, tensors)?,
            squeezed: FeatureMap::default(),
            mask: FeatureMap::default(),
            work: Workspace::default(),
        })
    }

    /// Looks at a picture: blue, green and red of 64×64, together of mean 0.
    ///
    /// # Panics
    /// When the picture has another shape.
    pub fn run(&mut self, picture: &FeatureMap) -> Refinement {
        assert_eq!(picture.shape(), (3, Self::SIDE, Self::SIDE), "the picture's shape");
        self.trunk.run(picture, &mut self.work);
        self.squeeze.run(&self.trunk.coarse, &mut self.squeezed, &mut self.work);
        let (mut hidden, mut said) = ([0.0; 32], [0.0; 6]);
        self.dense.run(self.squeezed.values(), &mut hidden);
        self.head.run(&hidden, &mut said);
        let [hand, right, down, larger, sine, cosine] = said;
        Refinement { hand, right, down, larger, sine, cosine }
    }

    /// The same with the logits of the hand's pixels, 64×64.
    ///
    /// # Panics
    /// As [`Self::run`].
    pub fn run_with_mask(&mut self, picture: &FeatureMap) -> (Refinement, &[f32]) {
        let said = self.run(picture);
        shuffle_four(self.decoder.run(&mut self.trunk, &mut self.work), &mut self.mask);
        (said, self.mask.values())
    }
}
