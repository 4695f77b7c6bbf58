//! The counter, as it is trained.

use super::Weights;
use super::layers::{Block, Plain};
use crate::learning::{Graph, Id, Parameters, Planes, Shape};

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
