//! The training of each network.

use std::time::Instant;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::chance::normal;
use crate::counting::{self, Shown, Variation};
use crate::frames::{CELLS, Crop, Frame, HEIGHT, MOST, WIDTH, generator};
use crate::learning::{Descent, Planes};
use crate::losses::{Loss, absolute, bent, focal, likelihood, overlap, softmax, squared};
use crate::networks::{Counter, EMBEDDING, FEATURES, Finder, Refiner};
use crate::places::{CROP, Place};

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
fn gains(rng: &mut ChaCha8Rng) -> [f32; 3] {
    let light = (0.27 * normal(rng)).exp();
    std::array::from_fn(|_| light * (0.17 * normal(rng)).exp())
}

/// How finder and refiner go downhill.
const STEEP: Descent = Descent { decay: 1e-2, longest: 5.0 };

/// One-cycle: up to the largest rate in a twentieth of the steps, then down along a cosine.
fn rate(step: usize, steps: usize, largest: f64) -> f32 {
    let done = step as f64 / steps as f64;
    (largest * (done / 0.05 + 0.02).min(1.0) * (0.5 + 0.5 * (std::f64::consts::PI * done).cos()) + 1e-5)
        as f32
}

/// What a finder's maps should be, cell by cell.
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

/// Examples made side by side, each from randomness of its own, in order.
fn batch<T: Send>(size: usize, seed: u64, step: usize, make: impl Fn(&mut ChaCha8Rng) -> T + Sync) -> Vec<T> {
    let first = (step * size) as u64;
    (0..size as u64).into_par_iter().map(|i| make(&mut generator(seed, first + i))).collect()
}

/// A row turned left to right, or as it is.
fn row<T: Copy>(row: &[T], mirror: bool) -> impl Iterator<Item = T> {
    (0..row.len()).map(move |x| row[if mirror { row.len() - 1 - x } else { x }])
}

pub fn finder(frames: &[Frame], start: Option<Finder>, steps: usize, largest: f64, seed: u64) -> Finder {
    const BATCH: usize = 32;
    let mut net = start.unwrap_or_else(|| Finder::new(seed));
    net.parameters.rest();
    let (w, h) = CELLS;
    let n = w * h;
    let (began, mut mean) = (Instant::now(), [0.0_f32; 4]);
    for step in 0..steps {
        let examples = batch(BATCH, seed, step, |rng| {
            let frame = &frames[rng.random_range(0..frames.len())];
            let mirror: bool = rng.random();
            let mut x = Vec::with_capacity(3 * WIDTH * HEIGHT);
            planes(&frame.picture, WIDTH, mirror, gains(rng), &mut x);
            let mask = frame.mask.chunks_exact(w).flat_map(|cells| row(cells, mirror));
            (x, maps(&frame.hands, mirror), mask.map(|share| f32::from(share) / 255.0).collect::<Vec<f32>>())
        });
        let x: Vec<f32> = examples.iter().flat_map(|(x, _, _)| x).copied().collect();
        let (graph, out) = net.forward(Planes::of(&x, 3, (HEIGHT, WIDTH), 0), true);
        let said = graph.value(out).to_values();
        let hands = examples.iter().flat_map(|(_, maps, _)| &maps.centre).filter(|v| **v > 0.99).count();
        let weights: f32 = examples.iter().flat_map(|(_, maps, _)| &maps.weight).sum();
        let (per_hand, per_weight) = (1.0 / hands.max(1) as f32, 1.0 / weights.max(1.0));
        let mut back = vec![0.0; said.len()];
        let mut parts = [0.0; 4];
        for ((_, maps, mask), (said, back)) in
            examples.iter().zip(said.chunks_exact(5 * n).zip(back.chunks_exact_mut(5 * n)))
        {
            for i in 0..n {
                let mut take =
                    |part: usize, map: usize, Loss { value, slope }: Loss, share: f32, weight: f32| {
                        parts[part] += value * share;
                        back[map * n + i] += slope * share * weight;
                    };
                take(0, 0, focal(maps.centre[i], said[i]), per_hand, 1.0);
                take(3, 4, likelihood(mask[i], said[4 * n + i]), 4.0 / (BATCH * n) as f32, 1.0);
                let share = maps.weight[i] * per_weight;
                if share > 0.0 {
                    take(1, 1, absolute(maps.size[i], said[n + i]), share, 1.0);
                    take(2, 2, squared(maps.sin[i], said[2 * n + i]), share, 0.5);
                    take(2, 3, squared(maps.cos[i], said[3 * n + i]), share, 0.5);
                }
            }
        }
        let gradient = graph.backward(vec![(out, Planes::of(&back, 5, (h, w), 1))]);
        STEEP.step(&mut net.parameters, &gradient, rate(step, steps, largest));
        report("finder", step, steps, began, &mut mean, parts);
    }
    net
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
    if (step + 1).is_multiple_of(200) || step + 1 == steps {
        let shown: Vec<String> = mean.iter().map(|v| format!("{v:.3}")).collect();
        println!("{name} {}/{steps} {:.0} s {}", step + 1, began.elapsed().as_secs_f32(), shown.join(" "));
    }
}

/// How much a pixel of a mask counts: most where the hand ends, for there lie the fingers.
fn edges(mask: &[u8]) -> Vec<f32> {
    const REACH: i32 = 2;
    let side = CROP as i32;
    let inside = |x: i32, y: i32| mask[(y.clamp(0, side - 1) * side + x.clamp(0, side - 1)) as usize] > 127;
    (0..side * side)
        .map(|i| {
            let (x, y) = (i % side, i / side);
            let here = inside(x, y);
            let near = [(REACH, 0), (-REACH, 0), (0, REACH), (0, -REACH)];
            if near.iter().any(|(dx, dy)| inside(x + dx, y + dy) != here) { 2.5 } else { 0.6 }
        })
        .collect()
}

pub fn refiner(crops: &[Crop], start: Option<Refiner>, steps: usize, largest: f64, seed: u64) -> Refiner {
    const BATCH: usize = 48;
    const HALF: usize = CROP / 2;
    const N: usize = CROP * CROP;
    let mut net = start.unwrap_or_else(|| Refiner::new(seed));
    net.parameters.rest();
    let (began, mut mean) = (Instant::now(), [0.0_f32; 4]);
    for step in 0..steps {
        let examples = batch(BATCH, seed, step, |rng| {
            let crop = &crops[rng.random_range(0..crops.len())];
            let mirror: bool = rng.random();
            let mut x = Vec::with_capacity(3 * N);
            planes(&crop.picture, CROP, mirror, gains(rng), &mut x);
            let mask: Vec<u8> = crop.mask.chunks_exact(CROP).flat_map(|pixels| row(pixels, mirror)).collect();
            let sign = if mirror { -1.0 } else { 1.0 };
            let hand = crop.hand.map(|[dx, dy, size, up]| [sign * dx, dy, size, sign * up]);
            let edges = edges(&mask);
            // As the network says it: four planes of half the size.
            let quarters = |i: usize| {
                let (quarter, i) = (i / (HALF * HALF), i % (HALF * HALF));
                (2 * (i / HALF) + quarter / 2) * CROP + 2 * (i % HALF) + quarter % 2
            };
            let mask: Vec<(f32, f32)> =
                (0..N).map(quarters).map(|i| (f32::from(mask[i]) / 255.0, edges[i])).collect();
            (x, hand, mask)
        });
        let x: Vec<f32> = examples.iter().flat_map(|(x, _, _)| x).copied().collect();
        let (graph, six, mask) = net.forward(Planes::of(&x, 3, (CROP, CROP), 0), true);
        let (said, logits) = (graph.value(six).to_values(), graph.value(mask).to_values());
        let hands = examples.iter().filter(|(_, hand, _)| hand.is_some()).count().max(1) as f32;
        let (mut back, mut back_mask) = (vec![0.0; said.len()], vec![0.0; logits.len()]);
        let mut parts = [0.0; 4];
        for (e, (_, hand, mask)) in examples.iter().enumerate() {
            let (said, back) = (&said[6 * e..6 * e + 6], &mut back[6 * e..6 * e + 6]);
            let mut take = |part: usize, k: usize, Loss { value, slope }: Loss, share: f32, weight: f32| {
                parts[part] += value * share;
                back[k] += slope * share * weight;
            };
            take(0, 0, likelihood(f32::from(hand.is_some()), said[0]), 1.0 / BATCH as f32, 1.0);
            if let Some([dx, dy, size, up]) = hand {
                for (k, truth) in [dx, dy, size].into_iter().enumerate() {
                    take(1, 1 + k, bent(*truth, said[1 + k]), 1.0 / hands, 2.0);
                }
                let (sin, cos) = up.sin_cos();
                take(2, 4, squared(sin, said[4]), 1.0 / hands, 0.7);
                take(2, 5, squared(cos, said[5]), 1.0 / hands, 0.7);
            }
            let (logits, back) = (&logits[N * e..N * (e + 1)], &mut back_mask[N * e..N * (e + 1)]);
            let share = 1.0 / (BATCH * N) as f32;
            for ((back, logit), (truth, weight)) in back.iter_mut().zip(logits).zip(mask) {
                let Loss { value, slope } = likelihood(*truth, *logit);
                parts[3] += value * weight * share;
                *back = slope * weight * share * 2.0;
            }
            if hand.is_some() {
                parts[3] +=
                    overlap(mask.iter().map(|(truth, _)| *truth), logits, back, 1.0 / BATCH as f32) * 0.5;
            }
        }
        let back = Planes::of(&back, 6, (1, 1), 0);
        let back_mask = Planes::of(&back_mask, 4, (HALF, HALF), 1);
        let gradient = graph.backward(vec![(six, back), (mask, back_mask)]);
        STEEP.step(&mut net.parameters, &gradient, rate(step, steps, largest));
        report("refiner", step, steps, began, &mut mean, parts);
    }
    net
}

pub fn counter(pools: &[(f32, Vec<Shown>)], steps: usize, largest: f64, seed: u64) -> Counter {
    const BATCH: usize = 128;
    const SMOOTHING: f32 = 0.05;
    let mut net = Counter::new(seed);
    let descent = Descent { decay: 2e-2, longest: f32::INFINITY };
    let (began, mut mean) = (Instant::now(), [0.0_f32; 5]);
    let batch = |step: usize| counting::batch(pools, BATCH, seed, step as u64);
    let mut next = batch(0);
    for step in 0..steps {
        let examples = next;
        let learn = || {
            let x: Vec<f32> =
                examples.iter().flat_map(|(variation, _)| &variation.picture).copied().collect();
            let rng = &mut generator(seed, u64::MAX - step as u64);
            let kept = (0..FEATURES * BATCH).map(|_| if rng.random::<f32>() < 0.1 { 0.0 } else { 1.0 / 0.9 });
            let side = counting::SIDE;
            let (graph, said) = net.forward(Planes::of(&x, 2, (side, side), 0), Some(kept.collect()));
            let values = [said.count, said.fingers, said.hand, said.joints, said.embedding]
                .map(|id| graph.value(id).to_values());
            let mut back = values.each_ref().map(|values| vec![0.0; values.len()]);
            let counted = examples.iter().filter(|(_, shown)| shown.count.is_some()).count().max(1) as f32;
            let sure = examples.iter().filter(|(_, shown)| shown.fingers.is_some()).count().max(1) as f32;
            let posed =
                examples.iter().filter(|(variation, _)| variation.joints.is_some()).count().max(1) as f32;
            let mut parts = [0.0; 5];
            for (e, (Variation { joints, .. }, shown)) in examples.iter().enumerate() {
                if let Some(count) = shown.count.map(usize::from) {
                    let logits: &[f32; 6] = values[0][6 * e..][..6].try_into().expect("six");
                    let rest = SMOOTHING / 6.0;
                    let truth =
                        std::array::from_fn(|c| if c == count { 1.0 - SMOOTHING + rest } else { rest });
                    let (value, slopes) = softmax(&truth, logits);
                    parts[0] += value / counted;
                    for (back, slope) in back[0][6 * e..].iter_mut().zip(slopes) {
                        *back = slope / counted;
                    }
                    parts[4] += f32::from(logits.iter().all(|logit| *logit <= logits[count])) / counted;
                }
                let mut take =
                    |part: usize, at: usize, Loss { value, slope }: Loss, share: f32, weight: f32| {
                        parts[part] += value * share;
                        back[part][at] += slope * share * weight;
                    };
                for (finger, out) in shown.fingers.iter().flatten().enumerate() {
                    let at = 5 * e + finger;
                    take(1, at, likelihood(f32::from(*out), values[1][at]), 0.2 / sure, 0.5);
                }
                take(2, e, likelihood(f32::from(shown.hand), values[2][e]), 1.0 / BATCH as f32, 0.5);
                for (k, truth) in joints.iter().flatten().enumerate() {
                    let at = 42 * e + k;
                    take(3, at, absolute(*truth, values[3][at]), 1.0 / 42.0 / posed, 2.0);
                }
            }
            // Numbers that stay near zero keep their meaning in eight bits.
            let share = 2e-3 / values[4].len() as f32;
            back[4].iter_mut().zip(&values[4]).for_each(|(back, value)| *back = value * share);
            let ids = [said.count, said.fingers, said.hand, said.joints, said.embedding];
            let back = ids
                .into_iter()
                .zip(back)
                .map(|(id, back)| (id, Planes::of(&back, back.len() / BATCH, (1, 1), 0)));
            let gradient = graph.backward(back.collect());
            descent.step(&mut net.parameters, &gradient, rate(step, steps, largest));
            parts
        };
        // One core learns, the other makes the next examples.
        let parts;
        (parts, next) = rayon::join(learn, || batch(step + 1));
        report("counter", step, steps, began, &mut mean, parts);
    }
    net
}

/// Where hands lie that are shown like this: their embeddings.
pub fn embed(net: &mut Counter, inputs: &[&[f32]]) -> Vec<Vec<f32>> {
    let mut out = Vec::with_capacity(inputs.len());
    for part in inputs.chunks(64) {
        let x = Planes::of(&part.concat(), 2, (counting::SIDE, counting::SIDE), 0);
        let (graph, said) = net.forward(x, None);
        out.extend(graph.value(said.embedding).to_values().chunks(EMBEDDING).map(<[f32]>::to_vec));
    }
    out
}
