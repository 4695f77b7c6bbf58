//! What finder and refiner have in common: from a picture down to many channels of few pixels.

use super::convolution::{Convolution, Shape, Workspace};
use super::feature_map::FeatureMap;
use super::tensors::{Tensors, WeightsError};

/// Seven convolutions with three results on the way.
pub struct Trunk {
    layers: [Convolution; 7],
    spare: FeatureMap,
    /// Of the second layer.
    pub fine: FeatureMap,
    /// Of the fourth, half as large.
    pub middle: FeatureMap,
    /// Of the last, half as large again.
    pub coarse: FeatureMap,
}

impl Trunk {
    /// The next fourteen tensors of a file. `widths`: the channels of the picture, after the first layer, and of the
    /// three results; `second`: the second layer.
    pub fn decode(
        [picture, first, fine, middle, coarse]: [usize; 5],
        second: fn(usize, usize) -> Shape,
        tensors: &mut Tensors,
    ) -> Result<Self, WeightsError> {
        let mut layer = |shape| Convolution::decode(shape, tensors);
        let layers = [
            layer(Shape::halving(picture, first))?,
            layer(second(first, fine))?,
            layer(Shape::halving(fine, middle))?,
            layer(Shape::usual(middle, middle))?,
            layer(Shape::halving(middle, coarse))?,
            layer(Shape::usual(coarse, coarse))?,
            layer(Shape { dilation: 2, ..Shape::usual(coarse, coarse) })?,
        ];
        let empty = FeatureMap::default;
        Ok(Self { layers, spare: empty(), fine: empty(), middle: empty(), coarse: empty() })
    }

    /// Computes the three results.
    pub fn run(&mut self, picture: &FeatureMap, work: &mut Workspace) {
        let Self { layers: [first, second, third, fourth, fifth, sixth, seventh], spare, .. } = self;
        first.run(picture, spare, work);
        second.run(spare, &mut self.fine, work);
        third.run(&self.fine, spare, work);
        fourth.run(spare, &mut self.middle, work);
        fifth.run(&self.middle, &mut self.coarse, work);
        for residual in [sixth, seventh] {
            residual.run(&self.coarse, spare, work);
            self.coarse.add(spare);
        }
    }
}
