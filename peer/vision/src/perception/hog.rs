//! The histogram of oriented gradients of the canonical crop (N. Dalal and B. Triggs, 2005).

use opencv::core::{Mat, Point, Size, Vector};
use opencv::objdetect::{HOGDescriptor, HOGDescriptorTraitConst};

use super::canonical::SIDE;

const CELL: i32 = 8;
const BLOCK: i32 = 2 * CELL;
const BINS: i32 = 9;

/// Values of the descriptor: 7×7 blocks of 2×2 cells of 9 orientations.
pub const LENGTH: usize = {
    let blocks = (SIDE - BLOCK) / CELL + 1;
    let cells = BLOCK / CELL;
    (blocks * blocks * cells * cells * BINS) as usize
};

/// The descriptor of a whole canonical crop: cells of 8×8 pixels, unsigned gradients, L2-Hys normalised.
pub fn descriptor() -> Result<HOGDescriptor, opencv::Error> {
    let square = |side| Size::new(side, side);
    HOGDescriptor::new_def(square(SIDE), square(BLOCK), square(CELL), square(CELL), BINS)
}

/// Computes the descriptor of a crop.
pub fn compute(hog: &HOGDescriptor, crop: &Mat, descriptor: &mut Vector<f32>) -> Result<(), opencv::Error> {
    let (no_stride, no_padding) = (Size::default(), Size::default());
    hog.compute(crop, descriptor, no_stride, no_padding, &Vector::<Point>::new())
}
