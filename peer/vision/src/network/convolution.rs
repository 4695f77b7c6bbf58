//! A convolution: the patch under each pixel laid out as a row of a matrix, times the weights.

use nalgebra::{DMatrixView, DMatrixViewMut};

use super::feature_map::FeatureMap;
use super::tensors::{Tensors, WeightsError};

/// Patches are laid out for so many values at a time: what stays in the cache until it is multiplied.
const BLOCK: usize = 48 * 1024;

/// What a convolution does, but for its weights.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// Channels in and out.
    pub channels: (usize, usize),
    /// Side of the square under each pixel, odd.
    pub side: usize,
    /// Pixels from one patch to the next.
    pub stride: usize,
    /// Pixels from one value of a patch to the next.
    pub dilation: usize,
    /// Whether what is below zero becomes zero.
    pub rectified: bool,
}

impl Shape {
    /// The usual: 3×3, rectified.
    pub fn usual(from: usize, to: usize) -> Self {
        Self { channels: (from, to), side: 3, stride: 1, dilation: 1, rectified: true }
    }

    /// The same with every second pixel in each direction.
    pub fn halving(from: usize, to: usize) -> Self {
        Self { stride: 2, ..Self::usual(from, to) }
    }

    /// Each pixel by itself, not rectified.
    pub fn point(from: usize, to: usize) -> Self {
        Self { side: 1, rectified: false, ..Self::usual(from, to) }
    }

    /// Pixels of zero around the picture, so that a stride of 1 keeps its size.
    fn padding(self) -> usize {
        self.dilation * (self.side / 2)
    }

    /// Values of a patch.
    fn patch(self) -> usize {
        self.channels.0 * self.side * self.side
    }

    /// How many patches lie along so many pixels.
    fn steps(self, pixels: usize) -> usize {
        pixels.div_ceil(self.stride)
    }
}

/// A convolution with its weights, and zeros around the picture.
#[derive(Clone, Debug)]
pub struct Convolution {
    shape: Shape,
    /// A row of a patch's values for each channel out: `[out][in][y][x]`.
    weights: Vec<f32>,
    bias: Vec<f32>,
}

impl Convolution {
    /// The next two tensors of a file.
    pub fn decode(shape: Shape, tensors: &mut Tensors) -> Result<Self, WeightsError> {
        let weights = tensors.take(shape.channels.1 * shape.patch())?;
        Ok(Self { shape, weights, bias: tensors.take(shape.channels.1)? })
    }

    /// Fills `output`; `patches` is a buffer of any content.
    pub fn run(&self, input: &FeatureMap, output: &mut FeatureMap, patches: &mut Vec<f32>) {
        let (channels, height, width) = input.shape();
        debug_assert_eq!(channels, self.shape.channels.0);
        let (rows, columns) = (self.shape.steps(height), self.shape.steps(width));
        output.reshape(self.shape.channels.1, rows, columns);
        if self.shape.side == 1 && self.shape.stride == 1 {
            self.multiply(input.values(), 0, output);
            return;
        }
        let patch = self.shape.patch();
        let at_once = (BLOCK / (columns * patch).max(1)).clamp(1, rows.max(1));
        patches.resize(patches.len().max(at_once * columns * patch), 0.0);
        for first in (0..rows).step_by(at_once) {
            let count = at_once.min(rows - first);
            let patches = &mut patches[..count * columns * patch];
            self.lay_out(input, first, columns, patches);
            self.multiply(patches, first * columns, output);
        }
    }

    /// Lays out the patches of some rows of the output: for each value of a patch, its pixels in all of them.
    fn lay_out(&self, input: &FeatureMap, first: usize, columns: usize, patches: &mut [f32]) {
        let (_, height, width) = input.shape();
        let Shape { channels, side, stride, dilation, .. } = self.shape;
        let padding = self.shape.padding();
        let mut rows = patches.chunks_exact_mut(columns);
        let count = rows.len() / self.shape.patch();
        for channel in 0..channels.0 {
            let picture = input.channel(channel);
            for (y, x) in (0..side).flat_map(|y| (0..side).map(move |x| (y * dilation, x * dilation))) {
                // Where the row of pixels begins to be within the picture, and where it ends to be.
                let begin = padding.saturating_sub(x).div_ceil(stride).min(columns);
                let end = (width + padding).saturating_sub(x).div_ceil(stride).clamp(begin, columns);
                for (row, target) in (first..first + count).zip(rows.by_ref()) {
                    let Some(line) = (row * stride + y).checked_sub(padding).filter(|line| *line < height)
                    else {
                        target.fill(0.0);
                        continue;
                    };
                    let line = &picture[line * width..][..width];
                    target[..begin].fill(0.0);
                    target[end..].fill(0.0);
                    if begin == end {
                        continue;
                    }
                    let (target, from) = (&mut target[begin..end], begin * stride + x - padding);
                    match stride {
                        1 => target.copy_from_slice(&line[from..][..target.len()]),
                        _ => {
                            for (value, pixels) in target.iter_mut().zip(line[from..].chunks(stride)) {
                                *value = pixels[0];
                            }
                        }
                    }
                }
            }
        }
    }

    /// Multiplies the patches of the pixels from the `first` on, value by value as they are laid out, by the weights.
    fn multiply(&self, patches: &[f32], first: usize, output: &mut FeatureMap) {
        let (patch, channels) = (self.shape.patch(), self.shape.channels.1);
        let pixels = patches.len() / patch;
        let (_, height, width) = output.shape();
        let area = height * width;
        let patches = DMatrixView::from_slice(patches, pixels, patch);
        let weights = DMatrixView::from_slice(&self.weights, patch, channels);
        let mut whole = DMatrixViewMut::from_slice(output.values_mut(), area, channels);
        whole.rows_mut(first, pixels).gemm(1.0, &patches, &weights, 0.0);
        let least = if self.shape.rectified { 0.0 } else { f32::NEG_INFINITY };
        for (channel, bias) in output.values_mut().chunks_exact_mut(area).zip(&self.bias) {
            for value in &mut channel[first..first + pixels] {
                *value = (*value + bias).max(least);
            }
        }
    }
}
