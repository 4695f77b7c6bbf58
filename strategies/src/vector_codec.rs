//! How coordinates in a feature space become the few bytes that travel, and back.

use gestalt_protocol::{FeatureSpaceId, Vector};
use gestalt_svm::FeatureSpace;
use half::f16;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// How the components of a shared vector travel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// IEEE single precision: 4 bytes a component, exact within ±10σ of that component.
    F32,
    /// IEEE half precision: 2 bytes a component, a relative error of at most 2⁻¹¹.
    F16,
    /// 1 byte a component, in steps of 4σ/127 of that component, cut off at ±4σ; σ is its
    /// [`spread`](FeatureSpace::spread).
    #[default]
    I8,
}

/// A received vector that is no vector of this space.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum VectorError {
    /// Of another space.
    #[error(
        "samples of feature space {found}, this robot learns in {expected}: give all robots the same model file"
    )]
    Space {
        /// The space named with it.
        found: FeatureSpaceId,
        /// This robot's.
        expected: FeatureSpaceId,
    },
    /// Of another length.
    #[error("a vector of {found} components, the feature space has {expected}")]
    Length {
        /// How many it has.
        found: usize,
        /// How many it should have.
        expected: usize,
    },
    /// With a component that is infinite, or no number.
    #[error("component {0} of a vector is not finite")]
    NotFinite(usize),
    /// With a component further out than any robot sends.
    #[error("component {0} of a vector lies beyond {FURTHEST} standard deviations")]
    FarOut(usize),
}

/// Components are cut off at this many standard deviations.
const REACH: f32 = 4.0;

/// Further out than so many standard deviations nothing travels: what lies there is no hand, and no other sample's like,
/// so it would never be forgotten for being redundant.
const FURTHEST: f32 = 10.0;

impl Precision {
    /// All of them, from the longest to the shortest.
    pub const ALL: [Self; 3] = [Self::F32, Self::F16, Self::I8];

    /// Coordinates in `space` as they travel.
    #[must_use]
    pub fn encode(self, coordinates: &[f32], space: &FeatureSpace) -> Vector {
        let within: Vec<f32> = within(coordinates, space).collect();
        match self {
            Self::F32 => Vector::F32(within),
            Self::F16 => {
                // Past the largest half would be infinite.
                let half = |x: &f32| f16::from_f32(x.clamp(f16::MIN.to_f32(), f16::MAX.to_f32()));
                Vector::F16(within.iter().flat_map(|x| half(x).to_le_bytes()).collect())
            }
            Self::I8 => {
                let steps = within.iter().zip(space.spread());
                Vector::I8(steps.map(|(x, spread)| quantised(*x, *spread)).collect())
            }
        }
    }

    /// How many bytes a component takes.
    #[must_use]
    pub fn bytes(self) -> usize {
        match self {
            Self::F32 => 4,
            Self::F16 => 2,
            Self::I8 => 1,
        }
    }
}

/// The coordinates that a received vector stands for in `space`.
///
/// # Errors
/// [`VectorError::Length`], [`VectorError::NotFinite`] and [`VectorError::FarOut`].
pub fn decode_vector(vector: &Vector, space: &FeatureSpace) -> Result<Vec<f32>, VectorError> {
    let (found, expected) = (vector.components(), space.components());
    if found != expected {
        return Err(VectorError::Length { found, expected });
    }
    let coordinates: Vec<f32> = match vector {
        Vector::F32(values) => values.clone(),
        Vector::F16(bytes) => {
            bytes.chunks_exact(2).map(|half| f16::from_le_bytes([half[0], half[1]]).to_f32()).collect()
        }
        Vector::I8(steps) => steps
            .iter()
            .zip(space.spread())
            .map(|(step, spread)| f32::from(*step) * step_of(*spread))
            .collect(),
    };
    if let Some(component) = coordinates.iter().position(|x| !x.is_finite()) {
        return Err(VectorError::NotFinite(component));
    }
    // A hair more, for what rounding adds.
    let far = |(x, spread): (&f32, &f32)| x.abs() > FURTHEST * spread * 1.001;
    match coordinates.iter().zip(space.spread()).position(far) {
        Some(component) => Err(VectorError::FarOut(component)),
        None => Ok(coordinates),
    }
}

/// Coordinates, cut off where they lie too far out.
fn within<'a>(coordinates: &'a [f32], space: &'a FeatureSpace) -> impl Iterator<Item = f32> + 'a {
    let both = coordinates.iter().zip(space.spread());
    both.map(|(x, spread)| x.clamp(-FURTHEST * spread, FURTHEST * spread))
}

fn step_of(spread: f32) -> f32 {
    REACH * spread / 127.0
}

fn quantised(x: f32, spread: f32) -> i8 {
    let step = step_of(spread);
    // A component that never varied says nothing.
    if step > 0.0 { (x / step).round().clamp(-128.0, 127.0) as i8 } else { 0 }
}

#[cfg(test)]
mod tests {
    use gestalt_svm::{Components, ScalingMethod};
    use proptest::prelude::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn space() -> FeatureSpace {
        let rows: Vec<Vec<f32>> = (0..40)
            .map(|i| vec![(i * 7 % 11) as f32, (i * 5 % 13) as f32 * 0.1, (i % 3) as f32 * 50.0])
            .collect();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let rows = rows.iter().map(Vec::as_slice);
        FeatureSpace::fit("test", rows, ScalingMethod::PerComponent, Components::Count(3), &mut rng)
    }

    proptest! {
        #[test]
        fn what_arrives_is_what_was_sent_within_its_precision(x in prop::collection::vec(-3.0f32..3.0, 3)) {
            let space = space();
            let x: Vec<f32> = x.iter().zip(space.spread()).map(|(x, spread)| x * spread).collect();
            for (precision, relative, steps) in
                [(Precision::F32, 0.0, 0.0), (Precision::F16, 1.0 / 2048.0, 0.0), (Precision::I8, 0.0, 0.5001)]
            {
                let vector = precision.encode(&x, &space);
                let back = decode_vector(&vector, &space).unwrap();
                for ((x, back), spread) in x.iter().zip(&back).zip(space.spread()) {
                    let allowed = relative * x.abs() + steps * step_of(*spread) + 1e-7;
                    prop_assert!((x - back).abs() <= allowed, "{:?}: {} became {}", precision, x, back);
                }
                // What was received and is sent again stays what it is.
                prop_assert_eq!(precision.encode(&back, &space), vector);
            }
        }
    }

    #[test]
    fn what_lies_far_out_is_cut_off_and_stays_finite() {
        let space = space();
        for precision in Precision::ALL {
            let vector = precision.encode(&[1e30, -1e30, 0.0], &space);
            assert!(decode_vector(&vector, &space).unwrap().iter().all(|x| x.is_finite()), "{precision:?}");
        }
        let far = decode_vector(&Precision::I8.encode(&[1e30, 0.0, 0.0], &space), &space).unwrap()[0];
        assert!((far - REACH * space.spread()[0]).abs() < 1e-4);
    }

    #[test]
    fn a_vector_of_another_length_or_with_no_number_in_it_is_refused() {
        let space = space();
        assert_eq!(
            decode_vector(&Vector::I8(vec![0; 2]), &space),
            Err(VectorError::Length { found: 2, expected: 3 })
        );
        assert_eq!(
            decode_vector(&Vector::F32(vec![0.0, f32::NAN, 0.0]), &space),
            Err(VectorError::NotFinite(1))
        );
        let beyond = 11.0 * space.spread()[2];
        for far in [1e30, -1e6, beyond] {
            let found = decode_vector(&Vector::F32(vec![0.0, 0.0, far]), &space);
            assert_eq!(found, Err(VectorError::FarOut(2)), "{far}");
        }
    }
}
