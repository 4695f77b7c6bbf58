//! Convolutions over a batch: each output is a sum of inputs some steps away, and so is each gradient.

use rayon::prelude::*;

use super::planes::Planes;

/// Channels that are computed at a time, and values of each: as many sums as a processor has registers for.
const CHANNELS: usize = 4;
const WIDE: usize = if cfg!(target_feature = "avx512f") { 48 } else { 24 };
const NARROW: usize = 8;
/// Inputs that are summed at a time for the gradient of weights.
const TAPS: usize = 3;
/// Parts in which the gradient of weights is added up.
const PARTS: usize = 4;
/// Values after which the gradient of weights goes on to the next channel: what stays in the nearest cache.
const STRETCH: usize = 1024;

/// A value that goes into a sum: of a channel of `source`, so many values further on.
#[derive(Clone, Copy)]
pub struct Tap<'a> {
    pub source: &'a Planes,
    pub offset: isize,
}

impl<'a> Tap<'a> {
    /// The values of a channel of a block, as they go into those of the sum from its first pixel to its last.
    fn values(&self, channel: usize, block: usize) -> &'a [f32] {
        let first = self.source.first().checked_add_signed(self.offset).expect("the border is wide enough");
        &self.source.channel(channel, block)[first..]
    }
}

/// Where the machine has it, one instruction.
#[inline(always)]
fn add_product(sum: f32, a: f32, b: f32) -> f32 {
    if cfg!(any(target_feature = "fma", target_arch = "aarch64")) { a.mul_add(b, sum) } else { sum + a * b }
}

/// One of the inputs of a block, with its weight for each channel of it.
struct Input<'a> {
    values: &'a [f32],
    weights: [f32; CHANNELS],
}

#[inline(always)]
fn block<const W: usize>(inputs: &[Input], at: usize) -> [[f32; W]; CHANNELS] {
    let mut sums = [[0.0; W]; CHANNELS];
    for input in inputs {
        let values: &[f32; W] = input.values[at..at + W].try_into().expect("as many");
        for (sums, weight) in sums.iter_mut().zip(input.weights) {
            for (sum, value) in sums.iter_mut().zip(values) {
                *sum = add_product(*sum, weight, *value);
            }
        }
    }
    sums
}

/// `out[o] = Σ weight(o, i, t) · tap[t] of channel i`, and zeros where there is no pixel.
pub fn correlate(
    taps: &[Tap],
    channels: usize,
    weight: impl Fn(usize, usize, usize) -> f32,
    out: &mut Planes,
) {
    let (each, each_block, first, span, outs) =
        (out.each(), out.each_block(), out.first(), out.span(), out.channels);
    let shape = out.like(0);
    let of_group = |group: usize| -> Vec<[f32; CHANNELS]> {
        let each = |o: usize, i: usize, t: usize| if o < outs { weight(o, i, t) } else { 0.0 };
        (0..channels * taps.len())
            .map(|k| (k / taps.len(), k % taps.len()))
            .map(|(i, t)| std::array::from_fn(|k| each(CHANNELS * group + k, i, t)))
            .collect()
    };
    let weights: Vec<_> = (0..outs.div_ceil(CHANNELS)).map(of_group).collect();
    out.values_mut().par_chunks_mut(each_block).enumerate().for_each(|(block_number, out)| {
        let mut inputs: Vec<Input> = (0..channels)
            .flat_map(|channel| taps.iter().map(move |tap| tap.values(channel, block_number)))
            .map(|values| Input { values, weights: [0.0; CHANNELS] })
            .collect();
        for (out, weights) in out.chunks_mut(CHANNELS * each).zip(&weights) {
            inputs.iter_mut().zip(weights).for_each(|(input, weights)| input.weights = *weights);
            let mut at = 0;
            while at < span {
                let mut keep = |sums: &[&[f32]]| {
                    for (channel, sums) in out.chunks_exact_mut(each).zip(sums) {
                        channel[first + at..][..sums.len()].copy_from_slice(sums);
                    }
                };
                if at + WIDE <= span {
                    keep(&block::<WIDE>(&inputs, at).each_ref().map(|sums| &sums[..]));
                    at += WIDE;
                } else if at + NARROW <= span {
                    keep(&block::<NARROW>(&inputs, at).each_ref().map(|sums| &sums[..]));
                    at += NARROW;
                } else {
                    keep(&block::<1>(&inputs, at).each_ref().map(|sums| &sums[..]));
                    at += 1;
                }
            }
            out.chunks_exact_mut(each).for_each(|channel| shape.clear_border(channel));
        }
    });
}

/// Adds to `gradient`, in the order `[out][in][tap]`, what the weights of a [`correlate`] get of the gradient of what came out.
pub fn correlate_weights(taps: &[Tap], channels: usize, out: &Planes, gradient: &mut [f32]) {
    let blocks: Vec<usize> = (0..out.blocks()).collect();
    // The same parts whatever the machine, so that the sum is the same.
    let parts: Vec<Vec<f32>> = blocks
        .par_chunks(blocks.len().div_ceil(PARTS))
        .map(|blocks| {
            let mut sum = vec![0.0; gradient.len()];
            blocks.iter().for_each(|block| add_block(taps, channels, out, *block, &mut sum));
            sum
        })
        .collect();
    for part in parts {
        gradient.iter_mut().zip(part).for_each(|(sum, value)| *sum += value);
    }
}

fn add_block(taps: &[Tap], channels: usize, out: &Planes, block: usize, gradient: &mut [f32]) {
    let (first, span, per_channel) = (out.first(), out.span(), channels * taps.len());
    for (group, gradient) in gradient.chunks_mut(CHANNELS * per_channel).enumerate() {
        let last = gradient.len() / per_channel - 1;
        let of = |k: usize| &out.channel(CHANNELS * group + k.min(last), block)[first..first + span];
        let outs: [&[f32]; CHANNELS] = std::array::from_fn(of);
        for begin in (0..span).step_by(STRETCH) {
            let end = (begin + STRETCH).min(span);
            let outs = outs.map(|out| &out[begin..end]);
            for channel in 0..channels {
                for (t, few) in taps.chunks(TAPS).enumerate() {
                    let values: [&[f32]; TAPS] = std::array::from_fn(|k| {
                        &few[k.min(few.len() - 1)].values(channel, block)[begin..end]
                    });
                    let sums = if few.len() == 1 {
                        products(outs, [values[0]]).map(|[sum]| [sum, 0.0, 0.0])
                    } else {
                        products(outs, values)
                    };
                    for (gradient, sums) in gradient.chunks_exact_mut(per_channel).zip(sums) {
                        let at = taps.len() * channel + TAPS * t;
                        for (sum, gradient) in sums.iter().zip(&mut gradient[at..at + few.len()]) {
                            *gradient += sum;
                        }
                    }
                }
            }
        }
    }
}

/// Some values side by side, as a processor takes them.
type Lane = [f32; NARROW];

#[inline(always)]
fn add_products(sums: Lane, a: &Lane, b: &Lane) -> Lane {
    std::array::from_fn(|i| add_product(sums[i], a[i], b[i]))
}

/// The sums of products of each with each, lane by lane. Nothing else is done here, so that the compiler keeps all sums in registers.
#[inline(never)]
fn lane_products<const T: usize>(outs: [&[Lane]; CHANNELS], values: [&[Lane]; T]) -> [[Lane; T]; CHANNELS] {
    let mut sums = [[[0.0_f32; NARROW]; T]; CHANNELS];
    for at in 0..outs[0].len() {
        let values: [Lane; T] = std::array::from_fn(|t| values[t][at]);
        for o in 0..CHANNELS {
            let out = outs[o][at];
            for t in 0..T {
                sums[o][t] = add_products(sums[o][t], &out, &values[t]);
            }
        }
    }
    sums
}

/// The sums of products of each with each.
fn products<const T: usize>(outs: [&[f32]; CHANNELS], values: [&[f32]; T]) -> [[f32; T]; CHANNELS] {
    let sums = lane_products(outs.map(|o| o.as_chunks().0), values.map(|v| v.as_chunks().0));
    let rest = outs[0].len() / NARROW * NARROW;
    let mut all = [[0.0; T]; CHANNELS];
    for o in 0..CHANNELS {
        for t in 0..T {
            all[o][t] = sums[o][t].iter().sum();
            for at in rest..outs[0].len() {
                all[o][t] += outs[o][at] * values[t][at];
            }
        }
    }
    all
}
