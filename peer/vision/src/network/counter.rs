//! The counter: what a hand shows, as a vector and as fingers.

use super::convolution::{Convolution, Shape, Workspace};
use super::dense::Dense;
use super::feature_map::FeatureMap;
use super::pooling::halve_by_maximum;
use super::tensors::{Tensors, WeightsError};

/// Tensors of its file: weights and biases of 4 + 5 layers.
const TENSORS: usize = 18;

/// How many values the embedding of a hand has.
pub const EMBEDDING: usize = 24;

/// What the counter says of a hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Count {
    /// Where the hand lies among hands: those that show the same are close.
    pub embedding: [f32; EMBEDDING],
    /// Logits of 0 to 5 fingers, one of which it is.
    pub counts: [f32; 6],
    /// Logits of thumb, index, middle, ring and little finger being out, each by itself.
    pub fingers: [f32; 5],
    /// Logit of what is read being a hand at all.
    pub hand: f32,
}

impl Count {
    /// Between two readings of one hand. The heads being linear, it is what follows from the mean embedding.
    #[must_use]
    pub fn mean(mut self, other: &Self) -> Self {
        let mean =
            |a: &mut [f32], b: &[f32]| a.iter_mut().zip(b).for_each(|(a, b)| *a = f32::midpoint(*a, *b));
        mean(&mut self.embedding, &other.embedding);
        mean(&mut self.counts, &other.counts);
        mean(&mut self.fingers, &other.fingers);
        self.hand = f32::midpoint(self.hand, other.hand);
        self
    }
}

/// Reads a hand.
pub struct Counter {
    layers: [Convolution; 4],
    dense: Dense,
    embedding: Dense,
    counts: Dense,
    fingers: Dense,
    hand: Dense,
    spare: [FeatureMap; 2],
    work: Workspace,
}

impl Counter {
    /// Side of the square it looks at, in pixels.
    pub const SIDE: usize = 48;

    /// With the weights of a file.
    ///
    /// # Errors
    /// See [`WeightsError`].
    pub fn decode(bytes: &[u8]) -> Result<Self, WeightsError> {
        let tensors = &mut Tensors::decode(bytes, TENSORS)?;
        let mut layer = |shape| Convolution::decode(shape, tensors);
        let layers = [
            layer(Shape { side: 5, ..Shape::halving(2, 24) })?,
            layer(Shape::usual(24, 40))?,
            layer(Shape::usual(40, 64))?,
            layer(Shape::usual(64, 96))?,
        ];
        Ok(Self {
            layers,
            dense: Dense::decode((9 * 96, 96), true, tensors)?,
            embedding: Dense::decode((96, EMBEDDING), false, tensors)?,
            counts: Dense::decode((EMBEDDING, 6), false, tensors)?,
            fingers: Dense::decode((EMBEDDING, 5), false, tensors)?,
            hand: Dense::decode((EMBEDDING, 1), false, tensors)?,
            spare: Default::default(),
            work: Workspace::default(),
        })
    }

    /// Reads a picture of 48×48 with two channels: the hand's grey, of mean 0 within its pixels, and its pixels, from -1
    /// (outside) to 1.
    ///
    /// # Panics
    /// When the picture has another shape.
    pub fn run(&mut self, picture: &FeatureMap) -> Count {
        assert_eq!(picture.shape(), (2, Self::SIDE, Self::SIDE), "the picture's shape");
        let Self { layers: [first, second, third, fourth], spare: [a, b], work, .. } = self;
        first.run(picture, a, work);
        halve_by_maximum(a, b);
        second.run(b, a, work);
        halve_by_maximum(a, b);
        third.run(b, a, work);
        fourth.run(a, b, work);
        halve_by_maximum(b, a);
        let mut hidden = [0.0; 96];
        self.dense.run(a.values(), &mut hidden);
        let mut count = Count { embedding: [0.0; EMBEDDING], counts: [0.0; 6], fingers: [0.0; 5], hand: 0.0 };
        self.embedding.run(&hidden, &mut count.embedding);
        self.counts.run(&count.embedding, &mut count.counts);
        self.fingers.run(&count.embedding, &mut count.fingers);
        self.hand.run(&count.embedding, std::slice::from_mut(&mut count.hand));
        count
    }
}
