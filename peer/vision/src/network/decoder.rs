//! What finder and refiner have in common: from many channels of few pixels up to maps of the picture.

use super::convolution::{Convolution, Shape, Workspace};
use super::feature_map::FeatureMap;
use super::tensors::{Tensors, WeightsError};
use super::trunk::Trunk;

/// Channels of the finest maps.
const FINE: usize = 16;

/// Climbs back up a [`Trunk`].
pub struct Decoder {
    /// From coarse to middle: the channels matched, then mixed with what the trunk has there.
    to_middle: (Convolution, Convolution),
    /// From middle to fine.
    to_fine: (Convolution, Convolution),
    /// What the trunk has there, before it is mixed; `None` where it is taken as it is.
    fine: Option<Convolution>,
    head: Convolution,
    low: FeatureMap,
    high: FeatureMap,
    maps: FeatureMap,
}

impl Decoder {
    /// The next tensors of a file. `coarse`, `middle`: channels of the trunk; `mixed`: channels of its middle once mixed;
    /// `fine`: channels of its finest result when they are matched first; `maps`: channels of the result.
    pub fn decode(
        (coarse, middle, mixed): (usize, usize, usize),
        fine: Option<usize>,
        maps: usize,
        tensors: &mut Tensors,
    ) -> Result<Self, WeightsError> {
        let mut layer = |shape| Convolution::decode(shape, tensors);
        let to_middle = (layer(Shape::point(coarse, middle))?, layer(Shape::usual(middle, mixed))?);
        let matched = layer(Shape::point(mixed, FINE))?;
        let fine = fine.map(|fine| layer(Shape::point(fine, FINE))).transpose()?;
        let to_fine = (matched, layer(Shape::usual(FINE, FINE))?);
        let head = layer(Shape::point(FINE, maps))?;
        let empty = FeatureMap::default;
        Ok(Self { to_middle, to_fine, fine, head, low: empty(), high: empty(), maps: empty() })
    }

    /// The maps, as large as the trunk's finest result. They take the place of its others.
    pub fn run(&mut self, trunk: &mut Trunk, work: &mut Workspace) -> &FeatureMap {
        let Self { low, high, .. } = self;
        self.to_middle.0.run(&trunk.coarse, low, work);
        trunk.middle.add_doubled_and_rectify(low);
        self.to_middle.1.run(&trunk.middle, high, work);
        self.to_fine.0.run(high, low, work);
        let fine = match &self.fine {
            Some(matched) => {
                matched.run(&trunk.fine, high, work);
                high
            }
            None => &mut trunk.fine,
        };
        fine.add_doubled_and_rectify(low);
        self.to_fine.1.run(fine, low, work);
        self.head.run(low, &mut self.maps, work);
        &self.maps
    }
}
