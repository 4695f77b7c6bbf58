//! The finder, as it is trained.

use super::Weights;
use super::layers::{Decoder, Trunk};
use crate::learning::{Graph, Id, Parameters, Planes};

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
