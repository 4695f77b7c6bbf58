//! The weights that the program brings along.

use std::sync::LazyLock;

/// Weights of the [`Finder`](super::Finder).
pub const FINDER: &[u8] = include_bytes!("../../weights/finder.net");
/// Weights of the [`Refiner`](super::Refiner).
pub const REFINER: &[u8] = include_bytes!("../../weights/refiner.net");
/// Weights of the [`Counter`](super::Counter).
pub const COUNTER: &[u8] = include_bytes!("../../weights/counter.net");

/// The [`checksum`](super::checksum) of these three.
#[must_use]
pub fn checksum() -> u32 {
    static CHECKSUM: LazyLock<u32> = LazyLock::new(|| super::checksum([FINDER, REFINER, COUNTER]));
    *CHECKSUM
}
