//! What was computed, step by step, so that the gradient can go back through it.

use rayon::prelude::*;

use super::convolution::{Tap, correlate, correlate_weights};
use super::parameters::{Gradient, Parameter, Parameters};
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

    /// The gradient of the parameters, of that of some results.
    pub fn backward(self, of: Vec<(Id, Planes)>) -> Gradient {
        let Self { parameters, steps, .. } = self;
        let mut gradient = parameters.no_gradient();
        let mut open: Vec<Option<Planes>> = steps.iter().map(|_| None).collect();
        for (id, value) in of {
            assert!(value.same_shape(&steps[id.0].0));
            add_to(&mut open, id, value);
        }
        for (at, (value, step)) in steps.iter().enumerate().rev() {
            let Some(mut back) = open[at].take() else { continue };
            let input = |id: &Id| &steps[id.0].0;
            match step {
                Step::Given => (),
                Step::Convolution { from, weight, bias, shape, phases } => {
                    let taps = taps(input(from), phases, *shape);
                    correlate_weights(&taps, shape.channels.0, &back, gradient.of(*weight));
                    if let Some(bias) = bias {
                        for (c, gradient) in gradient.of(*bias).iter_mut().enumerate() {
                            *gradient +=
                                (0..back.blocks()).map(|b| lanes(back.channel(c, b), |v| v)).sum::<f32>();
                        }
                    }
                    if !matches!(steps[from.0].1, Step::Given) {
                        let weights = parameters.get(*weight);
                        add_to(
                            &mut open,
                            *from,
                            convolution_back(&back, input(from), phases, *shape, weights),
                        );
                    }
                }
                Step::Normal { from, by, mean, scale } => {
                    let x = input(from);
                    // What was cut off at zero does not count.
                    rectify_back(&mut back, value);
                    let sums = |c: usize| {
                        let (mut sum, mut with) = (0.0_f64, 0.0_f64);
                        for block in 0..x.blocks() {
                            let (g, x) = (back.channel(c, block), x.channel(c, block));
                            sum += f64::from(lanes(g, |v| v));
                            with += f64::from(lane_products(g, x));
                        }
                        (sum as f32, ((with - sum * f64::from(mean[c])) * f64::from(scale[c])) as f32)
                    };
                    let sums: Vec<(f32, f32)> = (0..x.channels).into_par_iter().map(sums).collect();
                    let (n, each, starts, width) = (x.pixels() as f32, x.each(), x.row_starts(), x.width);
                    let factor = parameters.get(by.factor);
                    back.values_mut().par_chunks_mut(each).enumerate().for_each(|(i, back)| {
                        let (block, c) = (i / x.channels, i % x.channels);
                        let (sum, with) = sums[c];
                        let k = factor[c] * scale[c];
                        let slope = scale[c] * with / n;
                        let level = sum / n - mean[c] * slope;
                        let x = x.channel(c, block);
                        for &start in &starts {
                            let (g, x) = (&mut back[start..start + width], &x[start..start + width]);
                            g.iter_mut().zip(x).for_each(|(g, x)| *g = k * (*g - level - slope * x));
                        }
                    });
                    for (c, (sum, with)) in sums.into_iter().enumerate() {
                        gradient.of(by.shift)[c] += sum;
                        gradient.of(by.factor)[c] += with;
                    }
                    add_to(&mut open, *from, back);
                }
                Step::Sum { from, rectified } => {
                    if *rectified {
                        rectify_back(&mut back, value);
                    }
                    add_to(&mut open, from[0], back.clone());
                    add_to(&mut open, from[1], back);
                }
                Step::Rectified { from } => {
                    rectify_back(&mut back, value);
                    add_to(&mut open, *from, back);
                }
                Step::Enlarged { from } => {
                    let mut sum = input(from).like(input(from).channels);
                    for at in PHASES {
                        sum.add(&phase(&back, at, sum.border));
                    }
                    add_to(&mut open, *from, sum);
                }
                Step::Halved { from } => {
                    let mut sum = input(from).like(input(from).channels);
                    for at in PHASES {
                        let mut part = phase(input(from), at, back.border);
                        // To the first that was the largest, and only to it.
                        for ((part, largest), back) in
                            part.values_mut().iter_mut().zip(value.values()).zip(back.values_mut())
                        {
                            *part = if part == largest { std::mem::take(back) } else { 0.0 };
                        }
                        add_phase(&part, at, &mut sum);
                    }
                    add_to(&mut open, *from, sum);
                }
                Step::Flat { from } => {
                    let x = input(from);
                    let values = back.to_values();
                    add_to(&mut open, *from, Planes::of(&values, x.channels, (x.height, x.width), x.border));
                }
                Step::Scaled { from, by } => {
                    back.values_mut().iter_mut().zip(by).for_each(|(g, by)| *g *= by);
                    add_to(&mut open, *from, back);
                }
            }
        }
        gradient
    }
}

fn add_to(open: &mut [Option<Planes>], id: Id, value: Planes) {
    match &mut open[id.0] {
        Some(sum) => sum.add(&value),
        none => *none = Some(value),
    }
}

fn rectify_back(back: &mut Planes, value: &Planes) {
    for (g, y) in back.values_mut().iter_mut().zip(value.values()) {
        *g = if *y > 0.0 { *g } else { 0.0 };
    }
}

fn taps<'a>(input: &'a Planes, phases: &'a [Planes], shape: Shape) -> Vec<Tap<'a>> {
    let stride = phases.first().unwrap_or(input).stride();
    let source = |phase: usize| phases.get(phase).unwrap_or(input);
    shape.steps(stride).into_iter().map(|(phase, offset)| Tap { source: source(phase), offset }).collect()
}

/// From the gradient of what a convolution made to that of what it made it from.
fn convolution_back(
    back: &Planes,
    input: &Planes,
    phases: &[Planes],
    shape: Shape,
    weights: &[f32],
) -> Planes {
    let steps = shape.steps(back.stride());
    let (channels, outs) = shape.channels;
    let of_phase = |wanted: usize| -> Option<Planes> {
        let (which, taps): (Vec<usize>, Vec<Tap>) = steps
            .iter()
            .enumerate()
            .filter(|(_, (phase, _))| *phase == wanted)
            .map(|(t, (_, offset))| (t, Tap { source: back, offset: -offset }))
            .unzip();
        let mut out = back.like(channels);
        let weight = |i: usize, o: usize, t: usize| weights[(o * channels + i) * steps.len() + which[t]];
        correlate(&taps, outs, weight, &mut out);
        (!taps.is_empty()).then_some(out)
    };
    if phases.is_empty() {
        return of_phase(0).expect("the middle is always there");
    }
    let mut sum = input.like(channels);
    for (number, at) in PHASES.into_iter().enumerate() {
        if let Some(part) = of_phase(number) {
            add_phase(&part, at, &mut sum);
        }
    }
    sum
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

fn lane_products(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0_f32; LANES];
    let (a, b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest: f32 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a.zip(b) {
        sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b);
    }
    sums.iter().sum::<f32>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learning::Descent;

    /// Numbers without pattern, -1 to 1.
    fn numbers(n: usize, seed: usize) -> Vec<f32> {
        (0..n).map(|i| ((i * 7919 + seed * 104_729) % 2003) as f32 / 1001.0 - 1.0).collect()
    }

    /// All steps there are, in one network: two results.
    struct Net {
        parameters: Parameters,
        all: Vec<Parameter>,
        layers: Vec<(Parameter, Normalised, Shape, usize)>,
        plain: (Parameter, Parameter),
        dense: (Parameter, Parameter),
    }

    const SIZE: (usize, usize) = (10, 14);
    const PICTURES: usize = 3;

    impl Net {
        fn new() -> Self {
            let mut parameters = Parameters::new(5);
            let mut all = Vec::new();
            let shapes = [
                (Shape { side: 5, stride: 2, ..Shape::usual(2, 5) }, 1),
                (Shape { stride: 2, ..Shape::usual(5, 6) }, 2),
                (Shape { dilation: 2, ..Shape::usual(6, 6) }, 2),
            ];
            let layers = shapes
                .map(|(shape, border)| {
                    let p = &mut parameters;
                    let weight = p.weights(shape.channels.1 * shape.inputs(), shape.inputs());
                    let [factor, shift, mean, variance] =
                        [1.0, 0.1, 0.0, 1.0].map(|value| p.constant(shape.channels.1, value));
                    all.extend([weight, factor, shift]);
                    (weight, Normalised { factor, shift, mean, variance }, shape, border)
                })
                .into();
            let plain = (parameters.weights(6 * 5, 6), parameters.constant(5, 0.2));
            let dense = (parameters.weights(6 * 2 * 2 * 3, 24), parameters.constant(3, -0.1));
            all.extend([plain.0, plain.1, dense.0, dense.1]);
            Self { parameters, all, layers, plain, dense }
        }

        fn forward(&mut self, x: &[f32], training: bool) -> (Graph<'_>, [Id; 2]) {
            let mut g = Graph::new(&mut self.parameters, training);
            let mut x = g.give(Planes::of(x, 2, SIZE, 0));
            let mut results = Vec::new();
            for (weight, norm, shape, border) in &self.layers {
                let made = g.convolution(x, *weight, None, *shape, *border);
                x = g.normal(made, *norm);
                results.push(x);
            }
            let x = g.sum([results[1], results[2]], true);
            let up = g.convolution(x, self.plain.0, Some(self.plain.1), Shape::point(6, 5), 0);
            let up = g.enlarged(up, results[0]);
            let up = g.sum([up, results[0]], false);
            let up = g.rectified(up);
            let small = g.halved(x, 1);
            let flat = g.flat(small);
            let flat = g.scaled(flat, numbers(6 * 2 * 2 * PICTURES, 9));
            let dense = g.convolution(flat, self.dense.0, Some(self.dense.1), Shape::point(24, 3), 0);
            (g, [up, dense])
        }

        /// Some number that depends on all results, and its gradient.
        fn loss(&mut self, x: &[f32]) -> (f64, Gradient) {
            let (graph, results) = self.forward(x, true);
            let mut loss = 0.0;
            let back = results.map(|id| {
                let value = graph.value(id);
                let values = value.to_values();
                let weights = numbers(values.len(), 3);
                loss += values.iter().zip(&weights).map(|(v, w)| f64::from(*v) * f64::from(*w)).sum::<f64>();
                (id, Planes::of(&weights, value.channels, (value.height, value.width), value.border))
            });
            (loss, graph.backward(back.into()))
        }
    }

    #[test]
    fn a_gradient_says_how_the_loss_changes() {
        let mut net = Net::new();
        let x = numbers(2 * SIZE.0 * SIZE.1 * PICTURES, 1);
        let (_, gradient) = net.loss(&x);
        let (mut wrong, mut all) = (0, 0);
        for parameter in net.all.clone() {
            let count = net.parameters.get(parameter).len();
            for i in (0..count).step_by(count.div_ceil(12)) {
                let mut at = |change: f32| {
                    net.parameters.get_mut(parameter)[i] += change;
                    let (loss, _) = net.loss(&x);
                    net.parameters.get_mut(parameter)[i] -= change;
                    loss
                };
                let step = 2e-3;
                let slope = (at(step) - at(-step)) / (2.0 * f64::from(step));
                let said = f64::from(gradient.get(parameter)[i]);
                all += 1;
                // Where a value crosses zero on the way, both are right.
                wrong += usize::from((slope - said).abs() > 0.03 * slope.abs().max(said.abs()) + 0.02);
            }
        }
        assert!(all > 80 && wrong <= all / 20, "{wrong} of {all} are wrong");
    }

    #[test]
    fn a_convolution_is_the_sum_it_is_defined_as() {
        for (side, stride, dilation) in [(3, 1, 1), (3, 2, 1), (3, 1, 2), (5, 2, 1), (1, 1, 1)] {
            let shape = Shape { channels: (3, 6), side, stride, dilation };
            let (h, w) = (7, 9);
            let x = numbers(3 * h * w * 2, 1);
            let mut parameters = Parameters::new(1);
            let weight = parameters.weights(6 * shape.inputs(), 1);
            let weights = parameters.get(weight).to_vec();
            let mut graph = Graph::new(&mut parameters, true);
            let given = graph.give(Planes::of(&x, 3, (h, w), 2));
            let out = graph.convolution(given, weight, None, shape, 1);
            let out = graph.value(out);
            let (oh, ow) = (h.div_ceil(stride), w.div_ceil(stride));
            assert_eq!((out.channels, out.height, out.width), (6, oh, ow));
            let middle = (side / 2) as isize;
            for (at, value) in out.to_values().into_iter().enumerate() {
                let (picture, o, y, x0) = (at / (6 * oh * ow), at / (oh * ow) % 6, at / ow % oh, at % ow);
                let mut sum = 0.0;
                for (i, ky, kx) in
                    (0..3 * side * side).map(|k| (k / (side * side), k / side % side, k % side))
                {
                    let along = |out: usize, k: usize| {
                        (out * stride) as isize + (k as isize - middle) * dilation as isize
                    };
                    let (py, px) = (along(y, ky), along(x0, kx));
                    if (0..h as isize).contains(&py) && (0..w as isize).contains(&px) {
                        let pixel = x[((picture * 3 + i) * h + py as usize) * w + px as usize];
                        sum += pixel * weights[((o * 3 + i) * side + ky) * side + kx];
                    }
                }
                assert!((sum - value).abs() < 1e-4, "{shape:?}: {value}, should be {sum}");
            }
        }
    }

    #[test]
    fn steps_lead_downhill() {
        let mut net = Net::new();
        let x = numbers(2 * SIZE.0 * SIZE.1 * PICTURES, 1);
        let (before, _) = net.loss(&x);
        for _ in 0..20 {
            let (_, gradient) = net.loss(&x);
            Descent { decay: 0.0, longest: 1.0 }.step(&mut net.parameters, &gradient, 1e-2);
        }
        assert!(net.loss(&x).0 < before - 1.0);
    }
}
