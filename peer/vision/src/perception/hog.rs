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

/// A descriptor, column by column of its blocks, as OpenCV lays them out: for each block from the top down, the mean over
/// its cells of each orientation.
#[must_use]
pub fn columns(descriptor: &[f32]) -> Vec<Vec<f32>> {
    let bins = BINS as usize;
    let cells = ((BLOCK / CELL) * (BLOCK / CELL)) as usize;
    let rows = ((SIDE - BLOCK) / CELL + 1) as usize;
    let of_block = |block: &[f32]| -> Vec<f32> {
        let of_bin = |bin| block.iter().skip(bin).step_by(bins).sum::<f32>() / cells as f32;
        (0..bins).map(of_bin).collect()
    };
    let of_column = |column: &[f32]| column.chunks(cells * bins).flat_map(of_block).collect();
    descriptor.chunks(rows * cells * bins).map(of_column).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_descriptor_falls_into_seven_columns_of_seven_blocks_of_nine_means() {
        let mut descriptor = vec![0.0; LENGTH];
        // The second column, its third block, the fifth orientation, in each of four cells.
        for cell in 0..4 {
            descriptor[(7 + 2) * 36 + 9 * cell + 4] = 1.0 + cell as f32;
        }
        let columns = columns(&descriptor);
        assert!(columns.len() == 7 && columns.iter().all(|column| column.len() == 7 * 9));
        for (i, column) in columns.iter().enumerate() {
            for (k, mean) in column.iter().enumerate() {
                assert_eq!(*mean, if (i, k) == (1, 2 * 9 + 4) { 2.5 } else { 0.0 }, "column {i}, value {k}");
            }
        }
    }
}
