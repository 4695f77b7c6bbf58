//! The three networks as they are trained, and their weights as they are shipped.

use crate::learning::{Graph, Id, Normalised, Parameter, Parameters, Planes, Shape};
use crate::places::CROP;

/// The weights of a network, in the order in which its layers stand, normalisation folded in.
pub type Weights = Vec<Vec<f32>>;

/// A convolution with a bias, or a layer in which everything depends on everything: that is one of single pixels.
#[derive(Clone, Copy, Debug)]
struct Plain {
    weight: Parameter,
    bias: Parameter,
    shape: Shape,
}

impl Plain {
    fn new(from: usize, to: usize, parameters: &mut Parameters) -> Self {
        let shape = Shape::point(from, to);
        let weight = parameters.weights(from * to, from);
        Self { weight, bias: parameters.constant(to, 0.0), shape }
    }

    fn forward(self, graph: &mut Graph, from: Id) -> Id {
        graph.convolution(from, self.weight, Some(self.bias), self.shape, 0)
    }

    fn weights(self, parameters: &Parameters, out: &mut Weights) {
        out.extend([self.weight, self.bias].map(|parameter| parameters.get(parameter).to_vec()));
    }
}

/// Convolution, normalisation, rectifier.
#[derive(Clone, Copy, Debug)]
struct Block {
    weight: Parameter,
    norm: Normalised,
    shape: Shape,
    /// Zeros around what it makes.
    border: usize,
}

impl Block {
    fn new(shape: Shape, border: usize, parameters: &mut Parameters) -> Self {
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

    fn forward(self, graph: &mut Graph, from: Id) -> Id {
        let made = graph.convolution(from, self.weight, None, self.shape, self.border);
        graph.normal(made, self.norm)
    }

    fn weights(self, parameters: &Parameters, out: &mut Weights) {
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
struct Trunk([Block; 7]);

impl Trunk {
    /// `second`: the stride of the second layer.
    fn new([a, b, c, d]: [usize; 4], second: usize, parameters: &mut Parameters) -> Self {
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

    fn forward(&self, graph: &mut Graph, x: Id) -> [Id; 3] {
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

    fn weights(&self, parameters: &Parameters, out: &mut Weights) {
        self.0.iter().for_each(|block| block.weights(parameters, out));
    }
}

/// Climbs back up a [`Trunk`]: from many channels of few pixels to maps as large as its finest result.
#[derive(Clone, Debug)]
struct Decoder {
    l5: Plain,
    m4: Block,
    l4: Plain,
    /// What the trunk has there, before it is mixed; `None` where it is taken as it is.
    l3: Option<Plain>,
    m3: Block,
    h: Plain,
}

impl Decoder {
    /// Channels of the finest maps.
    const FINE: usize = 16;

    /// `coarse`, `middle`: channels of the trunk; `mixed`: channels of its middle once mixed; `fine`: channels of its finest result
    /// when they are matched first; `maps`: channels of the result.
    fn new(
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

    fn forward(&self, g: &mut Graph, [fine, middle, coarse]: [Id; 3]) -> Id {
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

    fn weights(&self, p: &Parameters, out: &mut Weights) {
        self.l5.weights(p, out);
        self.m4.weights(p, out);
        self.l4.weights(p, out);
        self.l3.iter().for_each(|l3| l3.weights(p, out));
        self.m3.weights(p, out);
        self.h.weights(p, out);
    }
}

/// Where hands are: from a frame to maps of a quarter of its size.
#[derive(Clone, Debug)]
pub struct Finder {
    pub parameters: Parameters,
    layers: FinderLayers,
}

#[derive(Clone, Debug)]
struct FinderLayers {
    trunk: Trunk,
    decoder: Decoder,
}

impl Finder {
    /// What its maps begin with: hands are rare.
    const FIRST: [f32; 5] = [-3.5, 0.0, 0.0, 0.0, -2.0];

    pub fn new(seed: u64) -> Self {
        let mut all = Parameters::new(seed);
        let p = &mut all;
        let layers = FinderLayers {
            trunk: Trunk::new([12, 24, 48, 64], 2, p),
            decoder: Decoder::new([64, 48, 32], Some(24), Self::FIRST.len(), p),
        };
        p.get_mut(layers.decoder.h.bias).copy_from_slice(&Self::FIRST);
        Self { parameters: all, layers }
    }

    /// Steps from a frame to its five maps.
    pub fn forward(&mut self, x: Planes, training: bool) -> (Graph<'_>, Id) {
        let mut graph = Graph::new(&mut self.parameters, training);
        let (g, l) = (&mut graph, &self.layers);
        let x = g.give(x);
        let seen = l.trunk.forward(g, x);
        let maps = l.decoder.forward(g, seen);
        (graph, maps)
    }

    pub fn weights(&self) -> Weights {
        let (mut out, p, l) = (Weights::new(), &self.parameters, &self.layers);
        l.trunk.weights(p, &mut out);
        l.decoder.weights(p, &mut out);
        out
    }
}

/// Whether a crop shows a hand, where exactly, and its pixels.
#[derive(Clone, Debug)]
pub struct Refiner {
    pub parameters: Parameters,
    layers: RefinerLayers,
}

#[derive(Clone, Debug)]
struct RefinerLayers {
    trunk: Trunk,
    g1: Plain,
    g2: Plain,
    g3: Plain,
    decoder: Decoder,
}

impl Refiner {
    pub fn new(seed: u64) -> Self {
        let mut all = Parameters::new(seed);
        let p = &mut all;
        let layers = RefinerLayers {
            trunk: Trunk::new([12, 16, 40, 64], 1, p),
            g1: Plain::new(64, 12, p),
            g2: Plain::new(12 * (CROP / 8).pow(2), 32, p),
            g3: Plain::new(32, 6, p),
            decoder: Decoder::new([64, 40, 24], None, 4, p),
        };
        Self { parameters: all, layers }
    }

    /// Steps to six numbers for each crop, and to the mask's logits as four planes of half its size: left and right of the upper row,
    /// then of the lower.
    pub fn forward(&mut self, x: Planes, training: bool) -> (Graph<'_>, Id, Id) {
        let mut graph = Graph::new(&mut self.parameters, training);
        let (g, l) = (&mut graph, &self.layers);
        let x = g.give(x);
        let seen = l.trunk.forward(g, x);
        let [_, _, coarse] = seen;
        let said = l.g1.forward(g, coarse);
        let said = g.rectified(said);
        let said = g.flat(said);
        let said = l.g2.forward(g, said);
        let said = g.rectified(said);
        let said = l.g3.forward(g, said);
        let mask = l.decoder.forward(g, seen);
        (graph, said, mask)
    }

    pub fn weights(&self) -> Weights {
        let (mut out, p, l) = (Weights::new(), &self.parameters, &self.layers);
        l.trunk.weights(p, &mut out);
        [l.g1, l.g2, l.g3].iter().for_each(|plain| plain.weights(p, &mut out));
        l.decoder.weights(p, &mut out);
        out
    }
}

/// What a hand shows: 24 numbers, of which the count and the fingers follow.
#[derive(Clone, Debug)]
pub struct Counter {
    pub parameters: Parameters,
    layers: CounterLayers,
}

#[derive(Clone, Debug)]
struct CounterLayers {
    convolutions: [Block; 4],
    d1: Plain,
    d2: Plain,
    count: Plain,
    fingers: Plain,
    hand: Plain,
    /// Only for training: who knows where the joints are has understood the hand.
    joints: Plain,
}

/// What the counter says of hands.
#[derive(Clone, Copy, Debug)]
pub struct Said {
    pub embedding: Id,
    /// Logits of the counts.
    pub count: Id,
    /// Of each finger, thumb first.
    pub fingers: Id,
    /// Of being a hand at all.
    pub hand: Id,
    /// Across and down of each joint, -1 to 1.
    pub joints: Id,
}

pub const EMBEDDING: usize = 24;

/// Values between the pictures and the layers in which everything depends on everything.
pub const FEATURES: usize = 9 * 96;

impl Counter {
    pub fn new(seed: u64) -> Self {
        let mut all = Parameters::new(seed);
        let p = &mut all;
        let mut block = |shape| Block::new(shape, 1, p);
        let convolutions = [
            block(Shape { side: 5, stride: 2, ..Shape::usual(2, 24) }),
            block(Shape::usual(24, 40)),
            block(Shape::usual(40, 64)),
            block(Shape::usual(64, 96)),
        ];
        let layers = CounterLayers {
            convolutions,
            d1: Plain::new(FEATURES, 96, p),
            d2: Plain::new(96, EMBEDDING, p),
            count: Plain::new(EMBEDDING, 6, p),
            fingers: Plain::new(EMBEDDING, 5, p),
            hand: Plain::new(EMBEDDING, 1, p),
            joints: Plain::new(96, 42, p),
        };
        Self { parameters: all, layers }
    }

    /// `drop`: a factor for each of the [`FEATURES`] of each picture, in the order `[feature][picture]`.
    pub fn forward(&mut self, x: Planes, drop: Option<Vec<f32>>) -> (Graph<'_>, Said) {
        let mut graph = Graph::new(&mut self.parameters, drop.is_some());
        let (g, l) = (&mut graph, &self.layers);
        let mut x = g.give(x);
        for (i, block) in l.convolutions.iter().enumerate() {
            x = block.forward(g, x);
            if i != 2 {
                x = g.halved(x, 1);
            }
        }
        x = g.flat(x);
        if let Some(by) = drop {
            x = g.scaled(x, by);
        }
        let hidden = l.d1.forward(g, x);
        let hidden = g.rectified(hidden);
        let embedding = l.d2.forward(g, hidden);
        let said = Said {
            embedding,
            count: l.count.forward(g, embedding),
            fingers: l.fingers.forward(g, embedding),
            hand: l.hand.forward(g, embedding),
            joints: l.joints.forward(g, hidden),
        };
        (graph, said)
    }

    pub fn weights(&self) -> Weights {
        let (mut out, p, l) = (Weights::new(), &self.parameters, &self.layers);
        l.convolutions.iter().for_each(|block| block.weights(p, &mut out));
        [l.d1, l.d2, l.count, l.fingers, l.hand].iter().for_each(|plain| plain.weights(p, &mut out));
        out
    }
}

/// The bytes of a weights file: see `gestalt_vision::network`.
pub fn encode(weights: &Weights) -> Vec<u8> {
    let mut bytes = b"GESTNET1".to_vec();
    bytes.extend((weights.len() as u32).to_le_bytes());
    for tensor in weights {
        bytes.extend((tensor.len() as u32).to_le_bytes());
    }
    for value in weights.iter().flatten() {
        bytes.extend(half(*value).to_le_bytes());
    }
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    bytes
}

/// The nearest 16-bit float (IEEE 754 binary16).
fn half(value: f32) -> u16 {
    let bits = value.to_bits();
    let sign = (bits >> 16) as u16 & 0x8000;
    let magnitude = value.abs();
    if magnitude >= 65504.0 {
        return sign | 0x7BFF;
    }
    if magnitude < 2.0_f32.powi(-14) {
        return sign | (magnitude * 2.0_f32.powi(24)).round_ties_even() as u16;
    }
    // Rounding may carry into the exponent, as it should.
    let bits = bits & 0x7FFF_FFFF;
    let rounded = bits + 0xFFF + (bits >> 13 & 1);
    sign | ((rounded >> 13) - (112 << 10)) as u16
}

#[cfg(test)]
mod tests {
    use gestalt_vision::network as robots;

    use super::*;
    use crate::counting::{self, Shown};
    use crate::frames::{CELLS, Crop, Frame, HEIGHT, WIDTH};
    use crate::image::Pyramid;
    use crate::places::Place;
    use crate::train;

    fn noise(n: usize) -> Vec<u8> {
        (0..n).map(|i| (i * 7919 % 251) as u8).collect()
    }

    fn numbers(n: usize) -> Vec<f32> {
        noise(n).into_iter().map(|byte| f32::from(byte) / 100.0 - 1.2).collect()
    }

    fn map(channels: usize, side: [usize; 2], values: &[f32]) -> robots::FeatureMap {
        let mut map = robots::FeatureMap::new(channels, side[0], side[1]);
        map.values_mut().copy_from_slice(values);
        map
    }

    /// Weights are shipped in 16 bits: a thousandth of each.
    #[track_caller]
    fn assert_near(robots: &[f32], trained: &[f32]) {
        assert_eq!(robots.len(), trained.len());
        let largest = trained.iter().fold(0.0, |a: f32, b| a.max(b.abs()));
        for (a, b) in robots.iter().zip(trained) {
            assert!((a - b).abs() < 0.02 * largest + 1e-3, "{a}, trained as {b}");
        }
    }

    fn frame() -> Frame {
        Frame {
            picture: noise(3 * WIDTH * HEIGHT),
            hands: vec![Place { x: 70.0, y: 50.0, side: 40.0, up: 0.3 }],
            mask: vec![90; CELLS.0 * CELLS.1],
        }
    }

    #[test]
    fn the_finder_of_robots_says_what_it_was_trained_to_say() {
        let mut finder = train::finder(&[frame()], None, 3, 1e-2, 1);
        let x = numbers(3 * WIDTH * HEIGHT);
        let mut theirs = robots::Finder::decode(&encode(&finder.weights())).unwrap();
        let (graph, out) = finder.forward(Planes::of(&x, 3, (HEIGHT, WIDTH), 0), false);
        assert_near(theirs.run(&map(3, [HEIGHT, WIDTH], &x)).values(), &graph.value(out).to_values());
    }

    #[test]
    fn the_same_seed_trains_the_same_weights() {
        let weights = |seed| encode(&train::finder(&[frame()], None, 2, 1e-2, seed).weights());
        assert_eq!(weights(1), weights(1));
        assert_ne!(weights(1), weights(2));
    }

    #[test]
    fn the_refiner_of_robots_says_what_it_was_trained_to_say() {
        let crop = Crop {
            picture: noise(3 * CROP * CROP),
            mask: noise(CROP * CROP),
            hand: Some([0.1, 0.0, 0.2, -0.5]),
        };
        let mut refiner = train::refiner(&[crop], None, 3, 1e-2, 1);
        let x = numbers(3 * CROP * CROP);
        let mut theirs = robots::Refiner::decode(&encode(&refiner.weights())).unwrap();
        let (graph, six, mask) = refiner.forward(Planes::of(&x, 3, (CROP, CROP), 0), false);
        let (said, logits) = theirs.run_with_mask(&map(3, [CROP, CROP], &x));
        let six = graph.value(six).to_values();
        assert_near(&[said.hand, said.right, said.down, said.larger, said.sine, said.cosine], &six);
        let quarters = graph.value(mask).to_values();
        let half = CROP / 2;
        let logit = |i: usize| {
            let (x, y) = (i % CROP, i / CROP);
            quarters[((2 * (y % 2) + x % 2) * half + y / 2) * half + x / 2]
        };
        assert_near(logits, &(0..CROP * CROP).map(logit).collect::<Vec<_>>());
    }

    #[test]
    fn the_counter_of_robots_says_what_it_was_trained_to_say() {
        let mask = Pyramid::new(64, 64, 1, vec![255; 64 * 64]);
        let shown = Shown {
            picture: Pyramid::new(64, 64, 3, noise(3 * 64 * 64)),
            arm: mask.clone(),
            frame: counting::frame(&mask, 0.1).unwrap(),
            mask,
            count: Some(3),
            fingers: Some([false, true, true, true, false]),
            joints: Some([(30.0, 20.0); 21]),
            hand: true,
            origin: 0,
            drawn: false,
            seen: false,
        };
        let mut counter = train::counter(&[(1.0, vec![shown])], 3, 1e-2, 1);
        let x = numbers(2 * 48 * 48);
        let mut theirs = robots::Counter::decode(&encode(&counter.weights())).unwrap();
        let (graph, said) = counter.forward(Planes::of(&x, 2, (48, 48), 0), None);
        let values = |id| graph.value(id).to_values();
        let count = theirs.run(&map(2, [48, 48], &x));
        assert_near(&count.embedding, &values(said.embedding));
        assert_near(&count.counts, &values(said.count));
        assert_near(&count.fingers, &values(said.fingers));
        assert_near(&[count.hand], &values(said.hand));
    }
}
