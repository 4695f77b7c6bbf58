//! A graph's gradient against that of small steps.

use super::*;
use crate::learning::Descent;
use crate::learning::parameters::Gradient;

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
            for (i, ky, kx) in (0..3 * side * side).map(|k| (k / (side * side), k / side % side, k % side)) {
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
