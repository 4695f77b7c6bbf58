//! What the counter is trained on: a hand's picture and mask at 48 by 48, in every light and with every fault of a mask.

use std::f32::consts::PI;

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::chance::{normal, uniform};
use crate::image::{Affine, Canvas, Joints, Outside, Pyramid};
use crate::surfaces::smooth_noise;

pub const SIDE: usize = 48;

/// A hand the counter may be shown.
pub struct Shown {
    pub picture: Pyramid,
    pub mask: Pyramid,
    pub arm: Pyramid,
    /// The mask's box turned upright: its centre, its side with some room, and the turn.
    pub frame: [f32; 4],
    /// `None` for another gesture, or none at all.
    pub count: Option<u8>,
    pub fingers: Option<[bool; 5]>,
    /// In the picture, where they are known.
    pub joints: Option<Joints>,
    /// It is a hand; else it was taken for one.
    pub hand: bool,
    /// Whence: of one set, or drawn.
    pub origin: u32,
    /// The picture is of light and shade alone: what surrounds the hand must be invented.
    pub drawn: bool,
    /// The mask is what the refiner made of it: it has its faults already.
    pub seen: bool,
}

/// What a hand may look like.
pub struct Variation {
    /// Two planes: grey, and the mask.
    pub picture: Vec<f32>,
    /// Across and down of each joint, -1 to 1 in the picture.
    pub joints: Option<[f32; 42]>,
}

/// The square around a mask's pixels in axes turned by `up`: centre, side, turn.
pub fn frame(mask: &Pyramid, up: f32) -> Option<[f32; 4]> {
    let (s, c) = up.sin_cos();
    let (mut low, mut high, mut n) = ([f32::MAX; 2], [f32::MIN; 2], 0);
    for (i, value) in mask.pixels().iter().enumerate() {
        if *value > 127 {
            let (x, y) = ((i % mask.width()) as f32, (i / mask.width()) as f32);
            let turned = [x * c + y * s, y * c - x * s];
            for axis in 0..2 {
                low[axis] = low[axis].min(turned[axis]);
                high[axis] = high[axis].max(turned[axis]);
            }
            n += 1;
        }
    }
    if n < 10 {
        return None;
    }
    let (x, y) = ((low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0);
    let side = (high[0] - low[0]).max(high[1] - low[1]) * 1.18;
    Some([x * c - y * s, x * s + y * c, side, up])
}

/// Grey, standardised within the mask, and the mask as -1 to 1: two planes.
fn standardised(grey: &[f32], mask: &[f32]) -> Vec<f32> {
    let weight: f32 = mask.iter().sum::<f32>() + 1.0;
    let mean = grey.iter().zip(mask).map(|(g, m)| g * m).sum::<f32>() / weight;
    let variance = grey.iter().zip(mask).map(|(g, m)| (g - mean).powi(2) * m).sum::<f32>() / weight;
    let scale = 1.0 / (variance.sqrt() + 6.0);
    let light = grey.iter().map(|g| ((g - mean) * scale).clamp(-3.0, 3.0));
    light.chain(mask.iter().map(|m| 2.0 * m - 1.0)).collect()
}

fn to_crop(shown: &Shown, angle: f32, size: f32, mirror: f32, shift: (f32, f32), shear: f32) -> Affine {
    // From the crop to the picture, then turned around.
    let [x, y, side, _] = shown.frame;
    let half = side / 2.0 * size;
    let (s, c) = angle.sin_cos();
    let step = 2.0 / SIDE as f32;
    let start = 1.0 / SIDE as f32 - 1.0;
    // u, v in -1..1: across and down.
    let across = |u: f32, v: f32| {
        let (u, v) = ((u * mirror + shear * v + shift.0) * half, (v + shift.1) * half);
        (x + u * c - v * s, y + u * s + v * c)
    };
    let (o, a, b) = (across(start, start), across(start + step, start), across(start, start + step));
    let back = Affine { m: [[a.0 - o.0, b.0 - o.0], [a.1 - o.1, b.1 - o.1]], t: [o.0, o.1] };
    back.inverse()
}

/// As robots see it, turned by so many degrees, and mirrored where `mirror` is -1.
pub fn turned(shown: &Shown, degrees: f32, mirror: f32) -> Vec<f32> {
    let map = to_crop(shown, shown.frame[3] + degrees * PI / 180.0, 1.0, mirror, (0.0, 0.0), 0.0);
    let picture = shown.picture.warp(&map, SIDE, SIDE, Outside::Nearest);
    let mask = shown.mask.warp(&map, SIDE, SIDE, Outside::Nearest);
    let grey: Vec<f32> = if picture.channels == 1 {
        picture.values
    } else {
        picture.values.chunks(3).map(|p| 0.114 * p[0] + 0.587 * p[1] + 0.299 * p[2]).collect()
    };
    standardised(&grey, &mask.values.iter().map(|m| m / 255.0).collect::<Vec<_>>())
}

/// In another light, from a little elsewhere, before another wall, through a mask with faults.
pub fn varied(shown: &Shown, other: &Shown, rng: &mut impl Rng) -> Variation {
    let chance = |rng: &mut _, share: f32| uniform(rng, 0.0, 1.0) < share;
    let mut angle = shown.frame[3] + normal(rng) * 25.0 * PI / 180.0;
    if chance(rng, 0.06) {
        angle = uniform(rng, -PI, PI);
    }
    let size = (0.1 * normal(rng)).exp() * 1.03;
    let mirror = if chance(rng, 0.5) { -1.0 } else { 1.0 };
    let shift = (0.06 * normal(rng), 0.06 * normal(rng));
    let map = to_crop(shown, angle, size, mirror, shift, 0.1 * normal(rng));
    let n = SIDE * SIDE;
    let picture = shown.picture.warp(&map, SIDE, SIDE, Outside::Nearest);
    let share = |p: &Pyramid| {
        p.warp(&map, SIDE, SIDE, Outside::Zero).values.iter().map(|v| v / 255.0).collect::<Vec<f32>>()
    };
    let mut mask = share(&shown.mask);
    let arm: Vec<f32> = share(&shown.arm).iter().zip(&mask).map(|(a, m)| (a - m).clamp(0.0, 1.0)).collect();
    let grey: Vec<f32> = if picture.channels == 1 {
        picture.values
    } else {
        let mut w = [0.114 + 0.25 * normal(rng), 0.587 + 0.25 * normal(rng), 0.299 + 0.25 * normal(rng)];
        let sum = w.iter().sum::<f32>().max(0.4);
        w.iter_mut().for_each(|w| *w /= sum);
        picture.values.chunks(3).map(|p| w[0] * p[0] + w[1] * p[1] + w[2] * p[2]).collect()
    };
    // The light on the hand: from a side, through another tone curve, on another skin.
    let (across, down) = (0.35 * normal(rng), 0.35 * normal(rng));
    let at = |i: usize| ((i % SIDE) as f32 / 23.5 - 1.0, (i / SIDE) as f32 / 23.5 - 1.0);
    let mut hand: Vec<f32> = (0..n)
        .map(|i| {
            let (x, y) = at(i);
            grey[i] * (across * x + down * y).exp()
        })
        .collect();
    let area = mask.iter().sum::<f32>() + 1.0;
    let level = (hand.iter().zip(&mask).map(|(h, m)| h * m).sum::<f32>() / area).max(1.0);
    let gamma = uniform(rng, 0.6, 1.6);
    hand.iter_mut().for_each(|h| *h = level * ((*h / (level + 1.0)).max(0.0) + 1e-3).powf(gamma));
    if chance(rng, 0.3) {
        let mut kernel: [f32; 9] = std::array::from_fn(|_| 0.25 * normal(rng));
        kernel[4] += 1.0;
        let sum = kernel.iter().sum::<f32>().max(0.5);
        let source = hand.clone();
        for (i, value) in hand.iter_mut().enumerate() {
            let (x, y) = ((i % SIDE) as i64, (i / SIDE) as i64);
            *value = (0..9)
                .map(|k| {
                    let px = (x + k as i64 % 3 - 1).clamp(0, SIDE as i64 - 1) as usize;
                    let py = (y + k as i64 / 3 - 1).clamp(0, SIDE as i64 - 1) as usize;
                    kernel[k] / sum * source[py * SIDE + px]
                })
                .sum();
        }
    }
    // What stands behind it.
    let base = level * (0.7 * normal(rng)).exp();
    let kind: f32 = rng.random();
    let background: Vec<f32> = if kind < 0.3 && !shown.drawn {
        grey.clone()
    } else if kind < 0.65 {
        let (noise, strength) = (smooth_noise(rng, SIDE, SIDE, 3, 1), uniform(rng, 0.0, 0.25));
        noise.values.iter().map(|v| base * (1.0 + strength * v)).collect()
    } else if kind < 0.85 {
        let factor = (0.4 * normal(rng)).exp();
        let map = to_crop(other, uniform(rng, -PI, PI), 1.2, 1.0, (0.0, 0.0), 0.0);
        let clutter = other.picture.warp(&map, SIDE, SIDE, Outside::Nearest);
        clutter
            .values
            .chunks(clutter.channels)
            .map(|p| p.iter().sum::<f32>() / p.len() as f32 * factor)
            .collect()
    } else {
        let noise = smooth_noise(rng, SIDE, SIDE, 12, 1);
        noise.values.iter().map(|v| base * (1.0 + 0.5 * v)).collect()
    };
    let (kind, cloth) = (uniform(rng, 0.0, 1.0), level * (0.8 * normal(rng)).exp());
    let rough = if chance(rng, 0.4) { 0.3 } else { 0.0 };
    let weave = smooth_noise(rng, SIDE, SIDE, 10, 1);
    let mut image = Canvas::new(SIDE, SIDE, 1);
    for i in 0..n {
        let sleeve = match kind {
            k if k < 0.5 => hand[i],
            k if k < 0.9 => cloth * (1.0 + rough * weave.values[i]),
            _ => background[i],
        };
        let rest = (1.0 - mask[i] - arm[i]).max(0.0);
        image.values[i] = background[i] * rest + arm[i] * sleeve + mask[i] * hand[i];
    }
    match uniform(rng, 0.0, 1.0) {
        k if k < 0.35 => image = image.smoothed(&[1.0 / 3.0; 3]),
        k if k < 0.5 => image = image.coarse(uniform(rng, 1.5, 2.6)),
        _ => {}
    }
    let (noise, full) = (uniform(rng, 0.0, 8.0), level * uniform(rng, 1.1, 3.0));
    image.values.iter_mut().for_each(|v| *v = (*v + noise * normal(rng)).clamp(0.0, 300.0).min(full));
    // The mask's own faults: fat, thin, with holes, with spots, with the forearm left on. What was seen has them already.
    let faults = if shown.seen { 0.35 } else { 1.0 };
    let fat = |mask: &[f32]| {
        Canvas { width: SIDE, height: SIDE, channels: 1, values: mask.to_vec() }
            .smoothed(&[1.0 / 3.0; 3])
            .values
    };
    match uniform(rng, 0.0, 1.0 / faults) {
        k if k < 0.15 => mask = fat(&mask).iter().map(|v| (v * 2.2).min(1.0)).collect(),
        k if k < 0.3 => mask = fat(&mask).iter().map(|v| (v * 2.2 - 1.2).max(0.0)).collect(),
        _ => {}
    }
    let blotched = uniform(rng, 0.0, 1.0 / faults);
    if blotched < 0.25 {
        let blotches = smooth_noise(rng, SIDE, SIDE, 6, 1);
        for (m, b) in mask.iter_mut().zip(&blotches.values) {
            *m = if blotched < 0.15 { *m * f32::from(*b < 1.1) } else { m.max(f32::from(*b > 1.3)) };
        }
    }
    if chance(rng, 0.2 * faults) {
        mask.iter_mut().zip(&arm).for_each(|(m, a)| *m = m.max(*a));
    }
    let half = (SIDE as f32 - 1.0) / 2.0;
    let joints = shown.joints.map(|joints| map.joints(&joints)).map(|joints| {
        let at = |k: usize| [joints[k / 2].0, joints[k / 2].1][k % 2];
        std::array::from_fn(|k| (at(k) / half - 1.0).clamp(-1.5, 1.5))
    });
    Variation { picture: standardised(&image.values, &mask), joints }
}

/// A batch: hands of each pool by its share, varied. The same seed and number give the same batch.
pub fn batch(pools: &[(f32, Vec<Shown>)], size: usize, seed: u64, number: u64) -> Vec<(Variation, &Shown)> {
    let total: f32 = pools.iter().map(|(share, _)| share).sum();
    (0..size as u64)
        .into_par_iter()
        .map(|i| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(number * size as u64 + i);
            let pick = |rng: &mut ChaCha8Rng| {
                let mut at = uniform(rng, 0.0, total);
                let pool = pools.iter().find(|(share, _)| {
                    at -= share;
                    at <= 0.0
                });
                let pool = &pool.unwrap_or(&pools[0]).1;
                &pool[rng.random_range(0..pool.len())]
            };
            let (shown, other) = (pick(&mut rng), pick(&mut rng));
            (varied(shown, other, &mut rng), shown)
        })
        .collect()
}
