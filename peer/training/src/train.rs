//! The training of each network.

use std::time::Instant;

use burn::grad_clipping::GradientClippingConfig;
use burn::module::Module;
use burn::optim::{AdamWConfig, GradientsParams};
use burn::tensor::activation::{log_sigmoid, log_softmax, sigmoid};
use burn::tensor::{Device, Tensor, TensorData};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::chance::normal;
use crate::counting::{self, Shown};
use crate::frames::{CELLS, Crop, Frame, HEIGHT, MOST, WIDTH};
use crate::networks::{Counter, EMBEDDING, Finder, Refiner, Said};
use crate::places::{CROP, Place};

fn tensor<const D: usize>(values: Vec<f32>, shape: [usize; D], device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(values, shape), device)
}

fn scalar(tensor: &Tensor<1>) -> f32 {
    tensor.clone().into_scalar::<f32>()
}

/// Planes of a picture of blue, green, red, less its mean and over its deviation, after each channel was multiplied by its gain and
/// clipped; `mirror` turns left to right.
pub fn planes(picture: &[u8], width: usize, mirror: bool, gains: [f32; 3], out: &mut Vec<f32>) {
    let lit = |value: u8, channel: usize| (f32::from(value) * gains[channel]).min(255.0);
    let all = || picture.iter().enumerate().map(|(i, value)| lit(*value, i % 3));
    let n = picture.len() as f32;
    let mean = all().sum::<f32>() / n;
    let variance = all().map(|value| (value - mean).powi(2)).sum::<f32>() / n;
    let scale = 1.0 / (variance.sqrt() + 12.0);
    for channel in 0..3 {
        for row in picture.chunks_exact(3 * width) {
            let value = |x: usize| (lit(row[3 * x + channel], channel) - mean) * scale;
            if mirror {
                out.extend((0..width).rev().map(value));
            } else {
                out.extend((0..width).map(value));
            }
        }
    }
}

/// What lamps and cameras make of white.
fn gains(rng: &mut impl Rng) -> [f32; 3] {
    let light = (0.2 * normal(rng)).exp();
    std::array::from_fn(|_| light * (0.13 * normal(rng)).exp())
}

/// The optimizer of finder and refiner.
fn clipped() -> AdamWConfig {
    let config = AdamWConfig::new().with_weight_decay(1e-2).with_epsilon(1e-8);
    config.with_grad_clipping(Some(GradientClippingConfig::Norm(5.0)))
}

/// How likely what is true was said to be, in nats: `truth` from 0 to 1, of logits.
fn log_likelihood<const D: usize>(truth: Tensor<D>, logits: Tensor<D>) -> Tensor<D> {
    truth.clone() * log_sigmoid(logits.clone()) + (truth * -1.0 + 1.0) * log_sigmoid(logits * -1.0)
}

/// One-cycle: up to the largest rate in a twentieth of the steps, then down along a cosine.
fn rate(step: usize, steps: usize, largest: f64) -> f64 {
    let done = step as f64 / steps as f64;
    largest * (done / 0.05 + 0.02).min(1.0) * (0.5 + 0.5 * (std::f64::consts::PI * done).cos()) + 1e-5
}

/// What a finder's maps should be.
struct Maps {
    centre: Vec<f32>,
    weight: Vec<f32>,
    size: Vec<f32>,
    sin: Vec<f32>,
    cos: Vec<f32>,
}

fn maps(hands: &[Place], mirror: bool) -> Maps {
    let (w, h) = CELLS;
    let n = w * h;
    let mut maps = Maps {
        centre: vec![0.0; n],
        weight: vec![0.0; n],
        size: vec![0.0; n],
        sin: vec![0.0; n],
        cos: vec![0.0; n],
    };
    for hand in hands.iter().take(MOST) {
        let (x, up) = if mirror { (WIDTH as f32 - 1.0 - hand.x, -hand.up) } else { (hand.x, hand.up) };
        let cell = |v: f32, limit: usize| ((v + 0.5) / 4.0 - 0.5).clamp(0.0, limit as f32 - 1.0).round();
        let (cx, cy) = (cell(x, w), cell(hand.y, h));
        let sigma = (hand.side / 4.0 * 0.11).max(0.6);
        for i in 0..n {
            let squared = ((i % w) as f32 - cx).powi(2) + ((i / w) as f32 - cy).powi(2);
            let near = (-squared / (2.0 * sigma * sigma)).exp();
            maps.centre[i] = maps.centre[i].max(near);
            if near > 0.3 && near > maps.weight[i] {
                maps.weight[i] = near;
                maps.size[i] = (hand.side.max(1.0) / 24.0).ln();
                (maps.sin[i], maps.cos[i]) = up.sin_cos();
            }
        }
    }
    maps
}

pub fn finder(frames: &[Frame], start: Option<Finder>, steps: usize, largest: f64, seed: u64) -> Finder {
    const BATCH: usize = 32;
    let device = Device::flex().autodiff();
    let mut net = start.map_or_else(|| Finder::new(&device), Module::train);
    let mut optimizer = clipped().init();
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let (w, h) = CELLS;
    let (began, mut mean) = (Instant::now(), [0.0_f32; 4]);
    for step in 0..steps {
        let mut x = Vec::with_capacity(BATCH * 3 * WIDTH * HEIGHT);
        let mut all = [const { Vec::new() }; 6];
        for _ in 0..BATCH {
            let frame = &frames[rng.random_range(0..frames.len())];
            let mirror: bool = rng.random();
            planes(&frame.picture, WIDTH, mirror, gains(rng), &mut x);
            let maps = maps(&frame.hands, mirror);
            for (to, from) in all.iter_mut().zip([maps.centre, maps.weight, maps.size, maps.sin, maps.cos]) {
                to.extend(from);
            }
            for row in frame.mask.chunks_exact(w) {
                let value = |x: usize| f32::from(row[x]) / 255.0;
                if mirror {
                    all[5].extend((0..w).rev().map(value));
                } else {
                    all[5].extend((0..w).map(value));
                }
            }
        }
        let hands = all[0].iter().filter(|v| **v > 0.99).count().max(1) as f32;
        let weights = all[1].iter().sum::<f32>().max(1.0);
        let [centre, weight, size, sin, cos, mask] = all.map(|v| tensor(v, [BATCH, 1, h, w], &device));
        let out = net.forward(tensor(x, [BATCH, 3, HEIGHT, WIDTH], &device));
        let map = |k: usize| out.clone().slice([0..BATCH, k..k + 1, 0..h, 0..w]);
        let p = map(0);
        let s = sigmoid(p.clone());
        let positive = centre.clone().greater_elem(0.99).float();
        let miss = positive.clone() * (s.clone() * -1.0 + 1.0).powi_scalar(2) * log_sigmoid(p.clone());
        let alarm = (positive * -1.0 + 1.0)
            * (centre * -1.0 + 1.0).powi_scalar(4)
            * s.powi_scalar(2)
            * log_sigmoid(p * -1.0);
        let l_centre = (miss + alarm).sum() / -hands;
        let l_size = ((map(1) - size).abs() * weight.clone()).sum() / weights;
        let l_turn =
            (((map(2) - sin).powi_scalar(2) + (map(3) - cos).powi_scalar(2)) * weight).sum() / weights;
        let l_mask = log_likelihood(mask, map(4)).mean() * -4.0;
        let parts = [&l_centre, &l_size, &l_turn, &l_mask].map(scalar);
        let loss = l_centre + l_size + l_turn * 0.5 + l_mask;
        let grads = GradientsParams::from_grads(loss.backward(), &net);
        net = optimizer.step(rate(step, steps, largest), net, grads);
        report("finder", step, steps, began, &mut mean, parts);
    }
    net.valid()
}

fn report<const N: usize>(
    name: &str,
    step: usize,
    steps: usize,
    began: Instant,
    mean: &mut [f32; N],
    now: [f32; N],
) {
    for (mean, now) in mean.iter_mut().zip(now) {
        *mean = if step == 0 { now } else { 0.98 * *mean + 0.02 * now };
    }
    if (step + 1) % 200 == 0 || step + 1 == steps {
        let shown: Vec<String> = mean.iter().map(|v| format!("{v:.3}")).collect();
        println!("{name} {}/{steps} {:.0} s {}", step + 1, began.elapsed().as_secs_f32(), shown.join(" "));
    }
}

pub fn refiner(crops: &[Crop], start: Option<Refiner>, steps: usize, largest: f64, seed: u64) -> Refiner {
    const BATCH: usize = 48;
    let device = Device::flex().autodiff();
    let mut net = start.map_or_else(|| Refiner::new(&device), Module::train);
    let mut optimizer = clipped().init();
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let (began, mut mean) = (Instant::now(), [0.0_f32; 4]);
    let half = CROP / 2;
    for step in 0..steps {
        let mut x = Vec::with_capacity(BATCH * 3 * CROP * CROP);
        let (mut is, mut place, mut turn, mut mask) = (vec![], vec![], vec![], vec![]);
        for _ in 0..BATCH {
            let crop = &crops[rng.random_range(0..crops.len())];
            let mirror: bool = rng.random();
            planes(&crop.picture, CROP, mirror, gains(rng), &mut x);
            let sign = if mirror { -1.0 } else { 1.0 };
            let [dx, dy, size, up] = crop.hand.unwrap_or_default();
            is.push(f32::from(crop.hand.is_some()));
            place.extend([sign * dx, dy, size]);
            let (s, c) = (sign * up).sin_cos();
            turn.extend([s, c]);
            for quarter in 0..4 {
                for i in 0..half * half {
                    let (y, mut px) = (2 * (i / half) + quarter / 2, 2 * (i % half) + quarter % 2);
                    if mirror {
                        px = CROP - 1 - px;
                    }
                    mask.push(f32::from(crop.mask[y * CROP + px]) / 255.0);
                }
            }
        }
        let hands = is.iter().sum::<f32>().max(1.0);
        let is = tensor(is, [BATCH, 1], &device);
        let place = tensor(place, [BATCH, 3], &device);
        let turn = tensor(turn, [BATCH, 2], &device);
        let mask = tensor(mask, [BATCH, 4, half, half], &device);
        let (g, m) = net.forward(tensor(x, [BATCH, 3, CROP, CROP], &device));
        let logit = g.clone().slice([0..BATCH, 0..1]);
        let l_is = log_likelihood(is.clone(), logit).mean() * -1.0;
        // Smooth L1 with its bend at .05.
        let away = (g.clone().slice([0..BATCH, 1..4]) - place).abs();
        let small = away.clone().lower_elem(0.05).float();
        let smooth =
            small.clone() * away.clone().powi_scalar(2) * 10.0 + (small * -1.0 + 1.0) * (away - 0.025);
        let l_place = (smooth.sum_dim(1) * is.clone()).sum() / hands;
        let l_turn =
            ((g.slice([0..BATCH, 4..6]) - turn).powi_scalar(2).sum_dim(1) * is.clone()).sum() / hands;
        let p = sigmoid(m.clone());
        let cross = log_likelihood(mask.clone(), m).mean() * -1.0;
        let sum = |t: Tensor<4>| -> Tensor<2> { t.flatten::<2>(1, 3).sum_dim(1) };
        let dice = (sum(p.clone() * mask.clone()) * 2.0 + 1.0) / (sum(p) + sum(mask) + 1.0) * -1.0 + 1.0;
        let l_mask = cross + (dice * is).mean() * 0.5;
        let parts = [&l_is, &l_place, &l_turn, &l_mask].map(scalar);
        let loss = l_is + l_place * 2.0 + l_turn * 0.7 + l_mask * 2.0;
        let grads = GradientsParams::from_grads(loss.backward(), &net);
        net = optimizer.step(rate(step, steps, largest), net, grads);
        report("refiner", step, steps, began, &mut mean, parts);
    }
    net.valid()
}

pub fn counter(pools: &[(f32, Vec<Shown>)], steps: usize, largest: f64, seed: u64) -> Counter {
    const BATCH: usize = 128;
    const SMOOTHING: f32 = 0.05;
    let device = Device::flex().autodiff();
    let mut net = Counter::new(&device);
    let mut optimizer = AdamWConfig::new().with_weight_decay(2e-2).with_epsilon(1e-8).init();
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let (began, mut mean) = (Instant::now(), [0.0_f32; 4]);
    for step in 0..steps {
        let batch = counting::batch(pools, BATCH, seed, step as u64);
        let mut x = Vec::with_capacity(BATCH * 2 * counting::SIDE * counting::SIDE);
        let (mut count, mut fingers, mut known, mut right, mut hand) =
            (vec![], vec![], vec![], vec![], vec![]);
        for (picture, shown) in &batch {
            x.extend(picture);
            right.push(shown.count.map(i32::from));
            let all = shown.count.map_or(0.0, |_| SMOOTHING / 6.0);
            count.extend((0..6).map(|c| if Some(c) == shown.count { 1.0 - SMOOTHING } else { 0.0 } + all));
            fingers.extend(shown.fingers.unwrap_or_default().map(f32::from));
            known.push(f32::from(shown.fingers.is_some()));
            hand.push(f32::from(shown.hand));
        }
        let sure = known.iter().sum::<f32>().max(1.0);
        let counted = right.iter().flatten().count().max(1) as f32;
        let kept =
            (0..BATCH * 576).map(|_| if rng.random::<f32>() < 0.1 { 0.0 } else { 1.0 / 0.9 }).collect();
        let x = tensor(x, [BATCH, 2, counting::SIDE, counting::SIDE], &device);
        let Said { embedding: e, count: c, fingers: f, hand: h } =
            net.forward(x, Some(tensor(kept, [BATCH, 576], &device)));
        let l_count = (log_softmax(c.clone(), 1) * tensor(count, [BATCH, 6], &device)).sum() / -counted;
        let hand = tensor(hand, [BATCH, 1], &device);
        let l_hand = log_likelihood(hand, h).mean() * -1.0;
        let known = tensor(known, [BATCH, 1], &device);
        let each = log_likelihood(tensor(fingers, [BATCH, 5], &device), f);
        let l_fingers = (each.mean_dim(1) * known).sum() / -sure;
        let said: Vec<i32> = c.argmax(1).flatten::<1>(0, 1).into_data().iter::<i32>().collect();
        let hits = said.iter().zip(&right).filter(|(a, b)| Some(**a) == **b).count() as f32 / counted;
        let parts = [scalar(&l_count), scalar(&l_fingers), scalar(&l_hand), hits];
        let loss = l_count + l_fingers * 0.5 + l_hand * 0.5 + e.powi_scalar(2).mean() * 1e-3;
        let grads = GradientsParams::from_grads(loss.backward(), &net);
        net = optimizer.step(rate(step, steps, largest), net, grads);
        report("counter", step, steps, began, &mut mean, parts);
    }
    net.valid()
}

/// Where hands lie that are shown like this: their embeddings.
pub fn embed(net: &Counter, inputs: &[&[f32]]) -> Vec<Vec<f32>> {
    let device = Device::flex();
    let mut out = Vec::with_capacity(inputs.len());
    for part in inputs.chunks(64) {
        let x = tensor(part.concat(), [part.len(), 2, counting::SIDE, counting::SIDE], &device);
        let e = net.forward(x, None).embedding.into_data().try_to_vec::<f32>().expect("floats");
        out.extend(e.chunks(EMBEDDING).map(<[f32]>::to_vec));
    }
    out
}
