//! What was computed, step by step, so that the gradient can go back through it.

mod backward;
#[cfg(test)]
mod tests;

use rayon::prelude::*;

use super::convolution::{Tap, correlate};
use super::parameters::{Parameter, Parameters};
use super::phases::{PHASES, add_phase, phase};
use super::planes::Planes;

/// A result of a [`Graph`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Id(usize);

/// What a convolution does, but for its weights.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// Channels in and out.
    pub channels: (usize, usize),
    /// Side of the square under each pixel, odd.
    pub side: usize,
    /// Pixels from one patch to the next: 1 or 2.
    pub stride: usize,
    /// Pixels from one value of a patch to the next; more than 1 only with a stride of 1.
    pub dilation: usize,
}

/// What normalises a layer's channels.
#[derive(Clone, Copy, Debug)]
pub struct Normalised {
    pub factor: Parameter,
    pub shift: Parameter,
    /// What to expect where there is no batch. Not learned: followed.
    pub mean: Parameter,
    pub variance: Parameter,
}

impl Normalised {
    pub const LEAST: f32 = 1e-5;
    /// Share of a new batch in what to expect.
    const NEW: f32 = 0.05;
}

enum Step {
    Given,
    Convolution {
        from: Id,
        weight: Parameter,
        bias: Option<Parameter>,
        shape: Shape,
        /// Every second pixel of every second row, from (0, 0), (0, 1), (1, 0), (1, 1) on, where the stride is 2.
        phases: Vec<Planes>,
    },
    Normal {
        from: Id,
        by: Normalised,
        mean: Vec<f32>,
        /// One over the deviation.
        scale: Vec<f32>,
    },
    Sum {
        from: [Id; 2],
        rectified: bool,
    },
    Rectified {
        from: Id,
    },
    Enlarged {
        from: Id,
    },
    Halved {
        from: Id,
    },
    Flat {
        from: Id,
    },
    Scaled {
        from: Id,
        by: Vec<f32>,
    },
}

/// Steps from pictures to what a network says of them.
pub struct Graph<'a> {
    parameters: &'a mut Parameters,
    /// Whether batches are normalised by themselves.
    training: bool,
    steps: Vec<(Planes, Step)>,
}

impl Shape {
    /// The usual: 3×3.
    pub fn usual(from: usize, to: usize) -> Self {
        Self { channels: (from, to), side: 3, stride: 1, dilation: 1 }
    }

    /// Each pixel by itself.
    pub fn point(from: usize, to: usize) -> Self {
        Self { side: 1, ..Self::usual(from, to) }
    }

    /// Values that go into a sum.
    pub fn inputs(self) -> usize {
        self.channels.0 * self.side * self.side
    }

    /// For each value of a patch: of which phase it is, and how many values further on, rows being `stride` apart.
    fn steps(self, stride: usize) -> Vec<(usize, isize)> {
        let (middle, every) = ((self.side / 2) as isize, self.stride as isize);
        let along = |k: usize| {
            let away = (k as isize - middle) * self.dilation as isize;
            (away.rem_euclid(every) as usize, away.div_euclid(every))
        };
        let patch = (0..self.side).flat_map(|y| (0..self.side).map(move |x| (y, x)));
        patch
            .map(|(y, x)| {
                let ((odd_row, down), (odd_column, right)) = (along(y), along(x));
                (2 * odd_row + odd_column, down * stride as isize + right)
            })
            .collect()
    }
}

impl<'a> Graph<'a> {
    /// Without steps. `training`: whether batches are normalised by themselves, and gradients are wanted.
    pub fn new(parameters: &'a mut Parameters, training: bool) -> Self {
        Self { parameters, training, steps: Vec::new() }
    }

    fn push(&mut self, value: Planes, step: Step) -> Id {
        self.steps.push((value, step));
        Id(self.steps.len() - 1)
    }

    pub fn value(&self, id: Id) -> &Planes {
        &self.steps[id.0].0
    }

    pub fn give(&mut self, value: Planes) -> Id {
        self.push(value, Step::Given)
    }

    /// A convolution. With a stride of 2, its result gets the border `border`; else that of what it is made from.
    pub fn convolution(
        &mut self,
        from: Id,
        weight: Parameter,
        bias: Option<Parameter>,
        shape: Shape,
        border: usize,
    ) -> Id {
        let input = self.value(from);
        assert_eq!(input.channels, shape.channels.0);
        let phases: Vec<Planes> = match shape.stride {
            1 => Vec::new(),
            _ => PHASES.map(|at| phase(input, at, border)).into(),
        };
        let mut out = phases.first().unwrap_or(input).like(shape.channels.1);
        let weights = self.parameters.get(weight);
        let taps = taps(input, &phases, shape);
        let (channels, each) = (shape.channels.0, taps.len());
        correlate(&taps, channels, |o, i, t| weights[(o * channels + i) * each + t], &mut out);
        if let Some(bias) = bias {
            let bias = self.parameters.get(bias);
            let (each, starts, width) = (out.each(), out.row_starts(), out.width);
            for (channel, bias) in out.values_mut().chunks_exact_mut(each).zip(bias.iter().cycle()) {
                for start in &starts {
                    channel[*start..start + width].iter_mut().for_each(|value| *value += bias);
                }
            }
        }
        self.push(out, Step::Convolution { from, weight, bias, shape, phases })
    }

    /// Each channel less its mean and over its deviation, times a factor, plus a shift, and no less than zero.
    pub fn normal(&mut self, from: Id, by: Normalised) -> Id {
        let input = &self.steps[from.0].0;
        let n = input.pixels() as f64;
        let (mean, variance): (Vec<f32>, Vec<f32>) = if self.training {
            let moments = |channel| {
                let (mut sum, mut squares) = (0.0_f64, 0.0_f64);
                for block in 0..input.blocks() {
                    let part = input.channel(channel, block);
                    sum += f64::from(lanes(part, |v| v));
                    squares += f64::from(lanes(part, |v| v * v));
                }
                let mean = sum / n;
                (mean as f32, (squares / n - mean * mean).max(0.0) as f32)
            };
            (0..input.channels).into_par_iter().map(moments).unzip()
        } else {
            (self.parameters.get(by.mean).to_vec(), self.parameters.get(by.variance).to_vec())
        };
        let scale: Vec<f32> = variance.iter().map(|v| 1.0 / (v + Normalised::LEAST).sqrt()).collect();
        let mut out = input.like(input.channels);
        let (factor, shift) = (self.parameters.get(by.factor), self.parameters.get(by.shift));
        let (each, starts, width) = (out.each(), out.row_starts(), out.width);
        out.values_mut().par_chunks_mut(each).enumerate().for_each(|(i, out)| {
            let (block, c) = (i / input.channels, i % input.channels);
            let slope = factor[c] * scale[c];
            let level = shift[c] - mean[c] * slope;
            let from = input.channel(c, block);
            for &start in &starts {
                let (out, from) = (&mut out[start..start + width], &from[start..start + width]);
                out.iter_mut().zip(from).for_each(|(out, from)| *out = (from * slope + level).max(0.0));
            }
        });
        if self.training {
            let follow = |known: &mut [f32], new: &[f32], factor: f32| {
                for (known, new) in known.iter_mut().zip(new) {
                    *known += Normalised::NEW * (new * factor - *known);
                }
            };
            follow(self.parameters.get_mut(by.mean), &mean, 1.0);
            follow(self.parameters.get_mut(by.variance), &variance, (n / (n - 1.0).max(1.0)) as f32);
        }
        self.push(out, Step::Normal { from, by, mean, scale })
    }

    pub fn sum(&mut self, from: [Id; 2], rectified: bool) -> Id {
        let mut out = self.value(from[0]).clone();
        out.add(self.value(from[1]));
        if rectified {
            out.values_mut().iter_mut().for_each(|value| *value = value.max(0.0));
        }
        self.push(out, Step::Sum { from, rectified })
    }

    pub fn rectified(&mut self, from: Id) -> Id {
        let mut out = self.value(from).clone();
        out.values_mut().iter_mut().for_each(|value| *value = value.max(0.0));
        self.push(out, Step::Rectified { from })
    }

    /// Twice as large, each value four times; cut to the size of `like`, with its border.
    pub fn enlarged(&mut self, from: Id, like: Id) -> Id {
        let input = self.value(from);
        let mut out = self.value(like).like(input.channels);
        for at in PHASES {
            add_phase(input, at, &mut out);
        }
        self.push(out, Step::Enlarged { from })
    }

    /// The largest of each four.
    pub fn halved(&mut self, from: Id, border: usize) -> Id {
        let input = self.value(from);
        let [mut out, rest @ ..] = PHASES.map(|at| phase(input, at, border));
        for other in rest {
            out.values_mut().iter_mut().zip(other.values()).for_each(|(a, b)| *a = a.max(*b));
        }
        self.push(out, Step::Halved { from })
    }

    /// Each pixel a channel of its own: in the order `[channel][y][x]`.
    pub fn flat(&mut self, from: Id) -> Id {
        let input = self.value(from);
        let features = input.channels * input.height * input.width;
        let values = input.to_values();
        let flat = Planes::of(&values, features, (1, 1), 0);
        self.push(flat, Step::Flat { from })
    }

    /// Each value by a factor, in the order of [`Planes::values`] of a flat one.
    pub fn scaled(&mut self, from: Id, by: Vec<f32>) -> Id {
        let mut out = self.value(from).clone();
        assert_eq!(out.values().len(), by.len());
        out.values_mut().iter_mut().zip(&by).for_each(|(value, by)| *value *= by);
        self.push(out, Step::Scaled { from, by })
    }
}

fn taps<'a>(input: &'a Planes, phases: &'a [Planes], shape: Shape) -> Vec<Tap<'a>> {
    let stride = phases.first().unwrap_or(input).stride();
    let source = |phase: usize| phases.get(phase).unwrap_or(input);
    shape.steps(stride).into_iter().map(|(phase, offset)| Tap { source: source(phase), offset }).collect()
}

const LANES: usize = 16;

/// A sum in so many parts, which the machine adds up side by side.
fn lanes(values: &[f32], of: impl Fn(f32) -> f32) -> f32 {
    let mut sums = [0.0_f32; LANES];
    let chunks = values.chunks_exact(LANES);
    let rest: f32 = chunks.remainder().iter().copied().map(&of).sum();
    for chunk in chunks {
        sums.iter_mut().zip(chunk).for_each(|(sum, value)| *sum += of(*value));
    }
    sums.iter().sum::<f32>() + rest
}
