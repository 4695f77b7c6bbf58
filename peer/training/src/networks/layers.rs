//! What the networks are made of.

use super::Weights;
use crate::learning::{Graph, Id, Normalised, Parameter, Parameters, Shape};

/// A convolution with a bias, or a layer in which everything depends on everything: that is one of single pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plain {
    weight: Parameter,
    pub bias: Parameter,
    shape: Shape,
}

impl Plain {
    pub fn new(from: usize, to: usize, parameters: &mut Parameters) -> Self {
        let shape = Shape::point(from, to);
        let weight = parameters.weights(from * to, from);
        Self { weight, bias: parameters.constant(to, 0.0), shape }
    }

    pub fn forward(self, graph: &mut Graph, from: Id) -> Id {
        graph.convolution(from, self.weight, Some(self.bias), self.shape, 0)
    }

    pub fn weights(self, parameters: &Parameters, out: &mut Weights) {
        out.extend([self.weight, self.bias].map(|parameter| parameters.get(parameter).to_vec()));
    }
}

/// Convolution, normalisation, rectifier.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    weight: Parameter,
    norm: Normalised,
    shape: Shape,
    /// Zeros around what it makes.
    border: usize,
}

impl Block {
    pub fn new(shape: Shape, border: usize, parameters: &mut Parameters) -> Self {
        let to = shape.channels.1;
        let weight = parameters.weights(to * shape.inputs(), shape.inputs());
        let norm = Normalised {
            factor: parameters.constant(to, 1.0),
            shift: parameters.constant(to, 0.0),
            mean: parameters.constant(to, 0.0),
            variance: parameters.constant(to, 1.0),
        };
        Self { weight, norm, shape, border }
    }

    pub fn forward(self, graph: &mut Graph, from: Id) -> Id {
        let made = graph.convolution(from, self.weight, None, self.shape, self.border);
        graph.normal(made, self.norm)
    }

    pub fn weights(self, parameters: &Parameters, out: &mut Weights) {
        let [weight, factor, shift, mean, variance] =
            [self.weight, self.norm.factor, self.norm.shift, self.norm.mean, self.norm.variance]
                .map(|parameter| parameters.get(parameter));
        let inputs = self.shape.inputs();
        let slope: Vec<f32> =
            factor.iter().zip(variance).map(|(f, v)| f / (v + Normalised::LEAST).sqrt()).collect();
        out.push(weight.iter().enumerate().map(|(i, w)| w * slope[i / inputs]).collect());
        out.push((0..slope.len()).map(|o| shift[o] - mean[o] * slope[o]).collect());
    }
}

/// Zeros around the coarse maps: they are looked at in wide steps.
const COARSE: usize = 2;

/// What finder and refiner begin with: a picture in three sizes, the smallest seen with the widest view.
#[derive(Clone, Debug)]
pub(super) struct Trunk([Block; 7]);

impl Trunk {
    /// `second`: the stride of the second layer.
    pub fn new([a, b, c, d]: [usize; 4], second: usize, parameters: &mut Parameters) -> Self {
        let mut block = |from, to, stride, dilation, border| {
            Block::new(Shape { stride, dilation, ..Shape::usual(from, to) }, border, parameters)
        };
        Self([
            block(3, a, 2, 1, 1),
            block(a, b, second, 1, 1),
            block(b, c, 2, 1, 1),
            block(c, c, 1, 1, 1),
            block(c, d, 2, 1, COARSE),
            block(d, d, 1, 1, COARSE),
            block(d, d, 1, 2, COARSE),
        ])
    }

    pub fn forward(&self, graph: &mut Graph, x: Id) -> [Id; 3] {
        let [c1, c2, c3, c4, c5, c6, c7] = self.0;
        let first = c1.forward(graph, x);
        let fine = c2.forward(graph, first);
        let third = c3.forward(graph, fine);
        let middle = c4.forward(graph, third);
        let mut coarse = c5.forward(graph, middle);
        for residual in [c6, c7] {
            let more = residual.forward(graph, coarse);
            coarse = graph.sum([coarse, more], false);
        }
        [fine, middle, coarse]
    }

    pub fn weights(&self, parameters: &Parameters, out: &mut Weights) {
        self.0.iter().for_each(|block| block.weights(parameters, out));
    }
}

/// Climbs back up a [`Trunk`]: from many channels of few pixels to maps as large as its finest result.
#[derive(Clone, Debug)]
pub(super) struct Decoder {
    l5: Plain,
    m4: Block,
    l4: Plain,
    /// What the trunk has there, before it is mixed; `None` where it is taken as it is.
    l3: Option<Plain>,
    m3: Block,
    pub h: Plain,
}

impl Decoder {
    /// Channels of the finest maps.
    const FINE: usize = 16;

    /// `coarse`, `middle`: channels of the trunk; `mixed`: channels of its middle once mixed; `fine`: channels of its finest result
    /// when they are matched first; `maps`: channels of the result.
    pub fn new(
        [coarse, middle, mixed]: [usize; 3],
        fine: Option<usize>,
        maps: usize,
        parameters: &mut Parameters,
    ) -> Self {
        let p = parameters;
        Self {
            l5: Plain::new(coarse, middle, p),
            m4: Block::new(Shape::usual(middle, mixed), 1, p),
            l4: Plain::new(mixed, Self::FINE, p),
            l3: fine.map(|fine| Plain::new(fine, Self::FINE, p)),
            m3: Block::new(Shape::usual(Self::FINE, Self::FINE), 1, p),
            h: Plain::new(Self::FINE, maps, p),
        }
    }

    pub fn forward(&self, g: &mut Graph, [fine, middle, coarse]: [Id; 3]) -> Id {
        let y = self.l5.forward(g, coarse);
        let y = g.enlarged(y, middle);
        let y = g.sum([y, middle], true);
        let y = self.m4.forward(g, y);
        let y = self.l4.forward(g, y);
        let y = g.enlarged(y, fine);
        let known = self.l3.map_or(fine, |l3| l3.forward(g, fine));
        let y = g.sum([y, known], true);
        let y = self.m3.forward(g, y);
        self.h.forward(g, y)
    }

    pub fn weights(&self, p: &Parameters, out: &mut Weights) {
        self.l5.weights(p, out);
        self.m4.weights(p, out);
        self.l4.weights(p, out);
        self.l3.iter().for_each(|l3| l3.weights(p, out));
        self.m3.weights(p, out);
        self.h.weights(p, out);
    }
}
