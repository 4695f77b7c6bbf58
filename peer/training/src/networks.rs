//! The three networks as they are trained, and their weights as they are shipped.

use burn::module::Module;
use burn::nn::conv::{Conv2d, Conv2dConfig};
use burn::nn::pool::{MaxPool2d, MaxPool2dConfig};
use burn::nn::{BatchNorm, BatchNormConfig, Linear, LinearConfig, PaddingConfig2d};
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor};

/// The weights of a network, in the order in which its layers stand, normalisation folded in.
pub type Weights = Vec<Vec<f32>>;

fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_to_vec::<f32>().expect("weights are 32-bit floats")
}

/// Convolution, normalisation, rectifier.
#[derive(Module, Debug)]
pub struct Block {
    conv: Conv2d,
    norm: BatchNorm,
}

impl Block {
    fn new(i: usize, o: usize, kernel: usize, stride: usize, dilation: usize, device: &Device) -> Self {
        let pad = dilation * (kernel / 2);
        let conv = Conv2dConfig::new([i, o], [kernel, kernel])
            .with_stride([stride, stride])
            .with_dilation([dilation, dilation])
            .with_padding(PaddingConfig2d::Explicit(pad, pad, pad, pad))
            .with_bias(false)
            .init(device);
        Self { conv, norm: BatchNormConfig::new(o).init(device) }
    }

    fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        relu(self.norm.forward(self.conv.forward(x)))
    }

    fn weights(&self, out: &mut Weights) {
        let weight = values(self.conv.weight.val());
        let (gamma, beta) = (values(self.norm.gamma.val()), values(self.norm.beta.val()));
        let (mean, variance) =
            (values(self.norm.running_mean.value()), values(self.norm.running_var.value()));
        let each = weight.len() / gamma.len();
        let factor: Vec<f32> =
            gamma.iter().zip(&variance).map(|(g, v)| g / (v + self.norm.epsilon as f32).sqrt()).collect();
        out.push(weight.iter().enumerate().map(|(i, w)| w * factor[i / each]).collect());
        out.push((0..gamma.len()).map(|o| beta[o] - mean[o] * factor[o]).collect());
    }
}

fn plain(i: usize, o: usize, device: &Device) -> Conv2d {
    Conv2dConfig::new([i, o], [1, 1]).init(device)
}

fn conv_weights(conv: &Conv2d, out: &mut Weights) {
    out.push(values(conv.weight.val()));
    out.push(conv.bias.as_ref().map(|bias| values(bias.val())).unwrap_or_default());
}

fn linear_weights(linear: &Linear, out: &mut Weights) {
    // Kept as [in][out] here, shipped as [out][in].
    let [i, o] = linear.weight.dims();
    let weight = values(linear.weight.val());
    out.push((0..o).flat_map(|b| (0..i).map(move |a| (a, b))).map(|(a, b)| weight[a * o + b]).collect());
    out.push(linear.bias.as_ref().map(|bias| values(bias.val())).unwrap_or_default());
}

/// Twice as large, each value four times; cut to `rows` and `columns`.
fn enlarged(x: Tensor<4>, rows: usize, columns: usize) -> Tensor<4> {
    let [n, c, h, w] = x.dims();
    let wide: Tensor<6> = x.reshape([n, c, h, 1, w, 1]).expand([n, c, h, 2, w, 2]);
    let wide: Tensor<4> = wide.reshape([n, c, 2 * h, 2 * w]);
    if (2 * h, 2 * w) == (rows, columns) { wide } else { wide.slice([0..n, 0..c, 0..rows, 0..columns]) }
}

/// What finder and refiner begin with: a picture in three sizes, the smallest seen with the widest view.
#[derive(Module, Debug)]
pub struct Trunk {
    c1: Block,
    c2: Block,
    c3: Block,
    c4: Block,
    c5: Block,
    c6: Block,
    c7: Block,
}

impl Trunk {
    /// `second`: the stride of the second layer.
    fn new([a, b, c, d]: [usize; 4], second: usize, device: &Device) -> Self {
        let block = |from, to, stride, dilation| Block::new(from, to, 3, stride, dilation, device);
        Self {
            c1: block(3, a, 2, 1),
            c2: block(a, b, second, 1),
            c3: block(b, c, 2, 1),
            c4: block(c, c, 1, 1),
            c5: block(c, d, 2, 1),
            c6: block(d, d, 1, 1),
            c7: block(d, d, 1, 2),
        }
    }

    fn forward(&self, x: Tensor<4>) -> [Tensor<4>; 3] {
        let fine = self.c2.forward(self.c1.forward(x));
        let middle = self.c4.forward(self.c3.forward(fine.clone()));
        let coarse = self.c5.forward(middle.clone());
        let coarse = coarse.clone() + self.c6.forward(coarse);
        let coarse = coarse.clone() + self.c7.forward(coarse);
        [fine, middle, coarse]
    }

    fn weights(&self, out: &mut Weights) {
        for block in [&self.c1, &self.c2, &self.c3, &self.c4, &self.c5, &self.c6, &self.c7] {
            block.weights(out);
        }
    }
}

/// Where hands are: from a frame to maps of a quarter of its size.
#[derive(Module, Debug)]
pub struct Finder {
    trunk: Trunk,
    l5: Conv2d,
    m4: Block,
    l4: Conv2d,
    l3: Conv2d,
    m3: Block,
    h: Conv2d,
}

impl Finder {
    pub fn new(device: &Device) -> Self {
        let mut h = plain(16, 5, device);
        // Hands are rare: it begins with saying so.
        h.bias = h.bias.map(|bias| bias.map(|_| Tensor::from_floats([-3.5, 0.0, 0.0, 0.0, -2.0], device)));
        Self {
            trunk: Trunk::new([8, 16, 32, 48], 2, device),
            l5: plain(48, 32, device),
            m4: Block::new(32, 32, 3, 1, 1, device),
            l4: plain(32, 16, device),
            l3: plain(16, 16, device),
            m3: Block::new(16, 16, 3, 1, 1, device),
            h,
        }
    }

    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let [x2, x3, x4] = self.trunk.forward(x);
        let [_, _, h3, w3] = x3.dims();
        let [_, _, h2, w2] = x2.dims();
        let y = self.m4.forward(relu(enlarged(self.l5.forward(x4), h3, w3) + x3));
        let y = self.m3.forward(relu(enlarged(self.l4.forward(y), h2, w2) + self.l3.forward(x2)));
        self.h.forward(y)
    }

    pub fn weights(&self) -> Weights {
        let mut out = Weights::new();
        self.trunk.weights(&mut out);
        conv_weights(&self.l5, &mut out);
        self.m4.weights(&mut out);
        conv_weights(&self.l4, &mut out);
        conv_weights(&self.l3, &mut out);
        self.m3.weights(&mut out);
        conv_weights(&self.h, &mut out);
        out
    }
}

/// Whether a crop shows a hand, where exactly, and its pixels.
#[derive(Module, Debug)]
pub struct Refiner {
    trunk: Trunk,
    g1: Conv2d,
    g2: Linear,
    g3: Linear,
    l5: Conv2d,
    m4: Block,
    l4: Conv2d,
    m3: Block,
    h: Conv2d,
}

impl Refiner {
    pub fn new(device: &Device) -> Self {
        Self {
            trunk: Trunk::new([12, 16, 28, 44], 1, device),
            g1: plain(44, 12, device),
            g2: LinearConfig::new(768, 32).init(device),
            g3: LinearConfig::new(32, 6).init(device),
            l5: plain(44, 28, device),
            m4: Block::new(28, 24, 3, 1, 1, device),
            l4: plain(24, 16, device),
            m3: Block::new(16, 16, 3, 1, 1, device),
            h: plain(16, 4, device),
        }
    }

    /// Six numbers for each crop, and the mask's logits as four planes of half its size: left and right of the upper row, then of
    /// the lower.
    pub fn forward(&self, x: Tensor<4>) -> (Tensor<2>, Tensor<4>) {
        let [x2, x3, x4] = self.trunk.forward(x);
        let g: Tensor<2> = relu(self.g1.forward(x4.clone())).flatten(1, 3);
        let g = self.g3.forward(relu(self.g2.forward(g)));
        let y = self.m4.forward(relu(enlarged(self.l5.forward(x4), 16, 16) + x3));
        let y = self.m3.forward(relu(enlarged(self.l4.forward(y), 32, 32) + x2));
        (g, self.h.forward(y))
    }

    pub fn weights(&self) -> Weights {
        let mut out = Weights::new();
        self.trunk.weights(&mut out);
        conv_weights(&self.g1, &mut out);
        linear_weights(&self.g2, &mut out);
        linear_weights(&self.g3, &mut out);
        conv_weights(&self.l5, &mut out);
        self.m4.weights(&mut out);
        conv_weights(&self.l4, &mut out);
        self.m3.weights(&mut out);
        conv_weights(&self.h, &mut out);
        out
    }
}

/// What a hand shows: 24 numbers, of which the count and the fingers follow.
#[derive(Module, Debug)]
pub struct Counter {
    c1: Block,
    c2: Block,
    c3: Block,
    c4: Block,
    pool: MaxPool2d,
    d1: Linear,
    d2: Linear,
    count: Linear,
    fingers: Linear,
    hand: Linear,
}

/// What the counter says of hands: a row each.
pub struct Said {
    pub embedding: Tensor<2>,
    /// Logits of the counts.
    pub count: Tensor<2>,
    /// Of each finger, thumb first.
    pub fingers: Tensor<2>,
    /// Of being a hand at all.
    pub hand: Tensor<2>,
}

pub const EMBEDDING: usize = 24;

impl Counter {
    pub fn new(device: &Device) -> Self {
        Self {
            c1: Block::new(2, 16, 5, 2, 1, device),
            c2: Block::new(16, 32, 3, 1, 1, device),
            c3: Block::new(32, 48, 3, 1, 1, device),
            c4: Block::new(48, 64, 3, 1, 1, device),
            pool: MaxPool2dConfig::new([2, 2]).with_strides([2, 2]).init(),
            d1: LinearConfig::new(576, 64).init(device),
            d2: LinearConfig::new(64, EMBEDDING).init(device),
            count: LinearConfig::new(EMBEDDING, 6).init(device),
            fingers: LinearConfig::new(EMBEDDING, 5).init(device),
            hand: LinearConfig::new(EMBEDDING, 1).init(device),
        }
    }

    pub fn forward(&self, x: Tensor<4>, drop: Option<Tensor<2>>) -> Said {
        let x = self.pool.forward(self.c1.forward(x));
        let x = self.pool.forward(self.c2.forward(x));
        let x = self.pool.forward(self.c4.forward(self.c3.forward(x)));
        let mut x: Tensor<2> = x.flatten(1, 3);
        if let Some(kept) = drop {
            x = x * kept;
        }
        let e = self.d2.forward(relu(self.d1.forward(x)));
        Said {
            count: self.count.forward(e.clone()),
            fingers: self.fingers.forward(e.clone()),
            hand: self.hand.forward(e.clone()),
            embedding: e,
        }
    }

    pub fn weights(&self) -> Weights {
        let mut out = Weights::new();
        for block in [&self.c1, &self.c2, &self.c3, &self.c4] {
            block.weights(&mut out);
        }
        for linear in [&self.d1, &self.d2, &self.count, &self.fingers, &self.hand] {
            linear_weights(linear, &mut out);
        }
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
    use burn::tensor::TensorData;
    use gestalt_vision::network as robots;

    use super::*;
    use crate::counting::{self, Shown};
    use crate::frames::{CELLS, Crop, Frame, HEIGHT, WIDTH};
    use crate::image::Pyramid;
    use crate::places::{CROP, Place};
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

    fn input(values: &[f32], [c, h, w]: [usize; 3]) -> Tensor<4> {
        Tensor::from_data(TensorData::new(values.to_vec(), [1, c, h, w]), &Device::flex())
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

    #[test]
    fn the_finder_of_robots_says_what_it_was_trained_to_say() {
        let frame = Frame {
            picture: noise(3 * WIDTH * HEIGHT),
            hands: vec![Place { x: 70.0, y: 50.0, side: 40.0, up: 0.3 }],
            mask: vec![90; CELLS.0 * CELLS.1],
        };
        let finder = train::finder(&[frame], None, 3, 1e-2, 1);
        let x = numbers(3 * WIDTH * HEIGHT);
        let mut theirs = robots::Finder::decode(&encode(&finder.weights())).unwrap();
        let maps = values(finder.forward(input(&x, [3, HEIGHT, WIDTH])));
        assert_near(theirs.run(&map(3, [HEIGHT, WIDTH], &x)).values(), &maps);
    }

    #[test]
    fn the_refiner_of_robots_says_what_it_was_trained_to_say() {
        let crop = Crop {
            picture: noise(3 * CROP * CROP),
            mask: noise(CROP * CROP),
            hand: Some([0.1, 0.0, 0.2, -0.5]),
        };
        let refiner = train::refiner(&[crop], None, 3, 1e-2, 1);
        let x = numbers(3 * CROP * CROP);
        let (six, quarters) = refiner.forward(input(&x, [3, CROP, CROP]));
        let mut theirs = robots::Refiner::decode(&encode(&refiner.weights())).unwrap();
        let (said, logits) = theirs.run_with_mask(&map(3, [CROP, CROP], &x));
        assert_near(&[said.hand, said.right, said.down, said.larger, said.sine, said.cosine], &values(six));
        let quarters = values(quarters);
        let half = CROP / 2;
        let logit = |i: usize| {
            let (x, y) = (i % CROP, i / CROP);
            quarters[(y % 2 * 2 + x % 2) * half * half + y / 2 * half + x / 2]
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
            hand: true,
            origin: 0,
            drawn: false,
            seen: false,
        };
        let counter = train::counter(&[(1.0, vec![shown])], 3, 1e-2, 1);
        let x = numbers(2 * 48 * 48);
        let said = counter.forward(input(&x, [2, 48, 48]), None);
        let mut theirs = robots::Counter::decode(&encode(&counter.weights())).unwrap();
        let count = theirs.run(&map(2, [48, 48], &x));
        assert_near(&count.embedding, &values(said.embedding));
        assert_near(&count.counts, &values(said.count));
        assert_near(&count.fingers, &values(said.fingers));
        assert_near(&[count.hand], &values(said.hand));
    }
}
