//! A convolution, with vectors as the machine has them: AVX2, NEON, SSE4.2, or one value at a time.
//!
//! Zeros are put around the picture, and of a stride of s its pixels are dealt to s × s planes. What one weight is multiplied by then lies in one
//! piece for all pixels of the result, from some place on, and a channel of the result is the sum of such pieces. What lies between the
//! rows of the result comes along, and is left out.

use std::ops::Range;

use pulp::{Arch, Scalar, Simd, WithSimd};

use super::feature_map::FeatureMap;
use super::tensors::{Tensors, WeightsError};

/// Channels that are added up side by side, two registers of pixels each: twelve sums, two of pixels and a weight are fifteen of sixteen registers, and where products are
/// added in a step of their own they take the last.
const CHANNELS: usize = 6;

/// Pixels of which all channels are worked out before the next: what is read for them stays in the cache meanwhile. Whole pairs of registers of any machine.
const TILE: usize = 512;

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

    /// Pixels from the first to the last of a patch, in steps of the stride.
    fn reach(self) -> usize {
        (self.side - 1) * self.dilation / self.stride
    }

    /// Whether each pixel is the patch of its own.
    fn is_point(self) -> bool {
        self.side == 1 && self.stride == 1
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

/// What convolutions work in, kept from one to the next.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    /// The picture in planes, with zeros around.
    planes: Vec<f32>,
    /// Where what each weight is multiplied by begins.
    starts: Vec<usize>,
}

/// A convolution with its weights, and zeros around the picture.
#[derive(Clone, Debug)]
pub struct Convolution {
    shape: Shape,
    /// Of so many channels out at a time, for each value of a patch, `[in][y][x]`, one of each; zeros after the last channel.
    weights: Vec<[f32; CHANNELS]>,
    bias: Vec<f32>,
}

impl Convolution {
    /// The next two tensors of a file.
    pub fn decode(shape: Shape, tensors: &mut Tensors) -> Result<Self, WeightsError> {
        let (patch, channels) = (shape.patch(), shape.channels.1);
        let by_channel = tensors.take(channels * patch)?;
        let mut weights = vec![[0.0; CHANNELS]; channels.div_ceil(CHANNELS) * patch];
        for (channel, of_channel) in by_channel.chunks_exact(patch).enumerate() {
            let block = &mut weights[channel / CHANNELS * patch..][..patch];
            for (weights, weight) in block.iter_mut().zip(of_channel) {
                weights[channel % CHANNELS] = *weight;
            }
        }
        Ok(Self { shape, weights, bias: tensors.take(channels)? })
    }

    /// Fills `output`; what is in the workspace does not matter.
    pub fn run(&self, input: &FeatureMap, output: &mut FeatureMap, work: &mut Workspace) {
        self.run_by(input, output, work, |run| match Arch::new() {
            Arch::Scalar => run.plainly(),
            wide => wide.dispatch(run),
        });
    }

    fn run_by(
        &self,
        input: &FeatureMap,
        output: &mut FeatureMap,
        Workspace { planes, starts }: &mut Workspace,
        add_up: impl FnOnce(Run<'_, true>),
    ) {
        let (channels, height, width) = input.shape();
        debug_assert_eq!(channels, self.shape.channels.0);
        let (rows, columns) = (self.shape.steps(height), self.shape.steps(width));
        output.reshape(self.shape.channels.1, rows, columns);
        if rows * columns == 0 {
            return;
        }
        let pitch = columns + self.shape.reach();
        let plane = (rows + self.shape.reach()) * pitch;
        self.find_starts(plane, pitch, starts);
        let values = if self.shape.is_point() {
            input.values()
        } else {
            self.lay_out(input, (plane, pitch), planes);
            planes
        };
        add_up(Run { convolution: self, values, starts, pitch, output });
    }

    /// Where each value of a patch lies for the first pixel of the result.
    fn find_starts(&self, plane: usize, pitch: usize, starts: &mut Vec<usize>) {
        let Shape { channels, side, stride, dilation, .. } = self.shape;
        starts.clear();
        let of_one = (0..side).flat_map(|y| (0..side).map(move |x| (y * dilation, x * dilation)));
        let place = |(y, x): (usize, usize)| {
            (y % stride * stride + x % stride) * plane + y / stride * pitch + x / stride
        };
        starts.extend(of_one.map(place));
        for channel in 1..channels.0 {
            starts.extend_from_within(..side * side);
            let planes = channel * stride * stride * plane;
            starts[channel * side * side..].iter_mut().for_each(|start| *start += planes);
        }
    }

    /// Deals the pixels to planes of that size, in rows of that length.
    fn lay_out(&self, input: &FeatureMap, (plane, pitch): (usize, usize), planes: &mut Vec<f32>) {
        let (channels, _, width) = input.shape();
        let (stride, padding) = (self.shape.stride, self.shape.padding());
        planes.clear();
        planes.resize(channels * stride * stride * plane, 0.0);
        for channel in 0..channels {
            for (y, line) in input.channel(channel).chunks_exact(width).enumerate() {
                let y = y + padding;
                let row = y / stride * pitch;
                if row >= plane {
                    continue;
                }
                for phase in 0..stride {
                    let of_phase = (channel * stride + y % stride) * stride + phase;
                    // The first pixel of the line that falls there.
                    let first = (phase + stride * padding - padding) % stride;
                    let target = &mut planes[of_phase * plane + row..][..pitch];
                    let target = &mut target[((first + padding) / stride).min(pitch)..];
                    let line = &line[first.min(width)..];
                    match stride {
                        1 => target[..width].copy_from_slice(line),
                        _ => target.iter_mut().zip(line.chunks(stride)).for_each(|(to, line)| *to = line[0]),
                    }
                }
            }
        }
    }
}

/// A convolution of a picture that is laid out. `FUSED`: whether products are added in one step each, with one rounding. A machine that cannot does it in
/// software, in a hundred.
struct Run<'a, const FUSED: bool> {
    convolution: &'a Convolution,
    values: &'a [f32],
    starts: &'a [usize],
    /// From one row of the result to the next.
    pitch: usize,
    output: &'a mut FeatureMap,
}

impl Run<'_, true> {
    /// In two steps each, four pixels at a time where the machine has that.
    fn plainly(self) {
        let Self { convolution, values, starts, pitch, output } = self;
        let run = Run::<false> { convolution, values, starts, pitch, output };
        #[cfg(target_arch = "x86_64")]
        if let Some(four) = pulp::x86::V2::try_new() {
            return Simd::vectorize(four, run);
        }
        Simd::vectorize(Scalar, run);
    }
}

impl<const FUSED: bool> WithSimd for Run<'_, FUSED> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let (_, rows, columns) = self.output.shape();
        let count = (rows - 1) * self.pitch + columns;
        let mut sums = [[0.0; TILE]; CHANNELS];
        for first in (0..count).step_by(TILE) {
            let tile = first..count.min(first + TILE);
            let convolution = self.convolution;
            for (block, weights) in convolution.weights.chunks_exact(self.starts.len()).enumerate() {
                self.add_up(simd, weights, tile.clone(), &mut sums);
                let biases = convolution.bias.iter().enumerate().skip(block * CHANNELS);
                for (sums, (channel, bias)) in sums.iter().zip(biases) {
                    self.put(sums, tile.clone(), channel, *bias);
                }
            }
        }
    }
}

impl<const FUSED: bool> Run<'_, FUSED> {
    /// The sums of some channels over the pixels of a tile.
    #[inline(always)]
    fn add_up<S: Simd>(
        &self,
        simd: S,
        weights: &[[f32; CHANNELS]],
        tile: Range<usize>,
        sums: &mut [[f32; TILE]; CHANNELS],
    ) {
        let lanes = S::F32_LANES;
        for from in tile.clone().step_by(2 * lanes) {
            let added = if from + 2 * lanes <= tile.end {
                self.add(simd, weights, |start| {
                    let (pixels, _) = S::as_simd_f32s(&self.values[start + from..][..2 * lanes]);
                    [pixels[0], pixels[1]]
                })
            } else {
                self.add(simd, weights, |start| {
                    let pixels = &self.values[start + from..start + tile.end];
                    let (first, second) = pixels.split_at(lanes.min(pixels.len()));
                    [simd.partial_load_f32s(first), simd.partial_load_f32s(second)]
                })
            };
            for (sums, added) in sums.iter_mut().zip(added) {
                let (sums, _) = S::as_mut_simd_f32s(&mut sums[from - tile.start..][..2 * lanes]);
                sums.copy_from_slice(&added);
            }
        }
    }

    #[inline(always)]
    fn add<S: Simd>(
        &self,
        simd: S,
        weights: &[[f32; CHANNELS]],
        pixels: impl Fn(usize) -> [S::f32s; 2],
    ) -> [[S::f32s; 2]; CHANNELS] {
        let mut sums = [[simd.splat_f32s(0.0); 2]; CHANNELS];
        let add = |weight: S::f32s, pixels: S::f32s, sum: S::f32s| match FUSED {
            true => simd.mul_add_e_f32s(weight, pixels, sum),
            false => simd.add_f32s(simd.mul_f32s(weight, pixels), sum),
        };
        for (weights, start) in weights.iter().zip(self.starts) {
            let [first, second] = pixels(*start);
            for (sums, weight) in sums.iter_mut().zip(weights) {
                let weight = simd.splat_f32s(*weight);
                *sums = [add(weight, first, sums[0]), add(weight, second, sums[1])];
            }
        }
        sums
    }

    /// Puts the sums of a tile in their rows of a channel.
    #[inline(always)]
    fn put(&mut self, sums: &[f32; TILE], tile: Range<usize>, channel: usize, bias: f32) {
        let (_, rows, columns) = self.output.shape();
        let least = if self.convolution.shape.rectified { 0.0 } else { f32::NEG_INFINITY };
        let of_channel = &mut self.output.values_mut()[channel * rows * columns..][..rows * columns];
        for row in tile.start / self.pitch..=(tile.end - 1) / self.pitch {
            let begin = row * self.pitch;
            let (from, to) = (tile.start.max(begin), tile.end.min(begin + columns));
            if from < to {
                let target = &mut of_channel[row * columns + from - begin..][..to - from];
                for (value, sum) in target.iter_mut().zip(&sums[from - tile.start..]) {
                    *value = (sum + bias).max(least);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_an_old_machine_adds_up_is_the_same() {
        for (stride, side, width) in [(1, 3, 37), (2, 3, 40), (2, 5, 9), (1, 1, 300)] {
            let shape = Shape { side, stride, ..Shape::usual(5, 13) };
            let number = |k: usize| (k * 7919 % 1000) as f32 / 500.0 - 1.0;
            let weights = (0..13usize.div_ceil(CHANNELS) * shape.patch())
                .map(|k| std::array::from_fn(|c| number(k + c)));
            let bias = (0..13).map(number).collect();
            let layer = Convolution { shape, weights: weights.collect(), bias };
            let mut input = FeatureMap::new(5, 23, width);
            input.values_mut().iter_mut().enumerate().for_each(|(k, value)| *value = number(k));
            let [mut wide, mut plain] = [(); 2].map(|()| FeatureMap::default());
            layer.run(&input, &mut wide, &mut Workspace::default());
            layer.run_by(&input, &mut plain, &mut Workspace::default(), |run| run.plainly());
            assert_eq!(wide.shape(), plain.shape());
            let far = wide.values().iter().zip(plain.values()).filter(|(a, b)| (*a - *b).abs() > 1e-4);
            assert_eq!(far.count(), 0);
            assert!(wide.values().iter().any(|value| *value > 1.0), "nothing was added up");
        }
    }
}
