//! The three small networks that learned eyes see with: forward passes alone, on one thread, of one picture at a time.
//!
//! ```text
//! the whole frame, 160×120 ─► Finder ─► where hands may be ─► 64×64 around each ─► Refiner ─► is it one, where, its mask
//!                                                             48×48 of the hand ─► Counter ─► embedding, fingers
//! ```
//!
//! They are convolutions with their batch normalisation folded in (S. Ioffe and C. Szegedy, 2015), computed with
//! vectors as the machine has them. Weights are [`shipped`] with the program. What a picture must be like that goes
//! in, and what comes out, is said at each network. All buffers are kept from one picture to the next.

mod convolution;
mod counter;
mod decoder;
mod dense;
mod feature_map;
mod finder;
mod pooling;
mod refiner;
pub mod shipped;
mod tensors;
mod trunk;

pub use counter::{Count, Counter, EMBEDDING};
pub use feature_map::FeatureMap;
pub use finder::Finder;
pub use refiner::{Refinement, Refiner};
pub use tensors::WeightsError;

/// CRC-32 of the weights of finder, refiner and counter, one file after another: embeddings of other weights mean other things.
#[must_use]
pub fn checksum<T: AsRef<[u8]>>(files: [T; 3]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    for file in &files {
        // Without its own checksum: with that, every file leaves the same behind.
        let (weights, _) = file.as_ref().split_at(file.as_ref().len().saturating_sub(4));
        hasher.update(weights);
    }
    hasher.finalize()
}

#[cfg(test)]
mod tests;
