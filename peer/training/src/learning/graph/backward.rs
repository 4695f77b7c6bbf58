//! The gradient's way back through a graph.

use rayon::prelude::*;

use super::super::convolution::{Tap, correlate, correlate_weights};
use super::super::parameters::Gradient;
use super::super::phases::{PHASES, add_phase, phase};
use super::{Graph, Id, LANES, Planes, Shape, Step, lanes, taps};

impl Graph<'_> {
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

fn lane_products(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0_f32; LANES];
    let (a, b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest: f32 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a.zip(b) {
        sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b);
    }
    sums.iter().sum::<f32>() + rest
}
