//! The space that the classifier judges in: scaled, then reduced.

use gestalt_protocol::FeatureSpaceId;
use rand::Rng;
use serde::{Deserialize, Serialize};

use crate::{Components, Pca, Scaling, ScalingMethod};

/// From raw features to the few coordinates that carry their variance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Space {
    pub scaling: Scaling,
    pub pca: Pca,
}

impl Space {
    /// Fits the space of these feature vectors: at least two, of one length, finite.
    pub fn fit<'a>(
        rows: impl Iterator<Item = &'a [f32]> + Clone,
        method: ScalingMethod,
        keep: Components,
        rng: &mut impl Rng,
    ) -> Self {
        let scaling = Scaling::fit(rows.clone(), method);
        let (mut all, mut row) = (Vec::new(), Vec::new());
        for features in rows {
            scaling.apply(features, &mut row);
            all.extend_from_slice(&row);
        }
        let pca = Pca::fit(&all, scaling.width(), keep, rng);
        Self { scaling, pca }
    }

    /// The coordinates of a feature vector of the right length.
    pub fn project(&self, features: &[f32]) -> Vec<f32> {
        let mut scaled = Vec::with_capacity(self.scaling.width());
        self.scaling.apply(features, &mut scaled);
        let mut coordinates = Vec::with_capacity(self.pca.kept());
        self.pca.project(&scaled, &mut coordinates);
        coordinates
    }

    /// Names what the coordinates mean: the 64-bit FNV-1a hash of the feature set's name, a zero byte, then
    /// means, factors and basis, each as little-endian f32.
    pub fn id(&self, feature_set: &str) -> FeatureSpaceId {
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        let mut add = |byte: u8| hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        feature_set.bytes().for_each(&mut add);
        add(0);
        for values in [&self.scaling.mean, &self.scaling.factor, &self.pca.basis] {
            values.iter().flat_map(|value| value.to_le_bytes()).for_each(&mut add);
        }
        FeatureSpaceId(hash)
    }
}
