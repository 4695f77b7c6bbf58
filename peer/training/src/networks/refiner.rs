//! The refiner, as it is trained.

use super::Weights;
use super::layers::{Decoder, Plain, Trunk};
use crate::learning::{Graph, Id, Parameters, Planes};
use crate::places::CROP;

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
