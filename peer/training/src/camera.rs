//! What a camera does to a picture.

use rand::{Rng, RngExt};

use crate::chance::{chance, normal, uniform};
use crate::image::Canvas;
use crate::surfaces::smooth_noise;

/// Another exposure, tone curve and white balance.
pub fn tone(canvas: &mut Canvas, rng: &mut impl Rng, cast: f32) {
    let (gamma, gain) = ((0.3 * normal(rng)).exp(), (0.25 * normal(rng)).exp());
    let factor: [f32; 3] = std::array::from_fn(|_| 255.0 * gain * (cast * 0.6 * normal(rng)).exp());
    for pixel in canvas.values.chunks_exact_mut(3) {
        for (value, factor) in pixel.iter_mut().zip(factor) {
            *value = ((*value / 255.0).clamp(0.0, 1.0).powf(gamma) * factor).clamp(0.0, 255.0);
        }
    }
}

/// What a camera does: blur, motion, exposure, noise, compression.
pub fn expose(canvas: &mut Canvas, rng: &mut impl Rng) {
    let kind: f32 = rng.random();
    if kind < 0.3 {
        *canvas = canvas.blurred(uniform(rng, 0.4, 1.1));
    } else if kind < 0.38 {
        let angle = uniform(rng, 0.0, std::f32::consts::PI);
        let source = canvas.clone();
        canvas.values.fill(0.0);
        for step in -2..=2_i32 {
            let (dx, dy) =
                ((step as f32 * angle.cos()).round() as i64, (step as f32 * angle.sin()).round() as i64);
            for y in 0..source.height {
                for x in 0..source.width {
                    let px = (x as i64 + dx).clamp(0, source.width as i64 - 1) as usize;
                    let py = (y as i64 + dy).clamp(0, source.height as i64 - 1) as usize;
                    for c in 0..3 {
                        canvas.values[(y * source.width + x) * 3 + c] +=
                            source.values[(py * source.width + px) * 3 + c] / 5.0;
                    }
                }
            }
        }
    }
    if chance(rng, 0.6) {
        tone(canvas, rng, 0.12);
    }
    // Light from a window: a part of the picture is full.
    if chance(rng, 0.1) {
        let light = smooth_noise(rng, canvas.width, canvas.height, 2, 1);
        for (pixel, light) in canvas.values.chunks_exact_mut(3).zip(&light.values) {
            pixel.iter_mut().for_each(|v| *v *= (0.5 * light).exp());
        }
    }
    if chance(rng, 0.5) {
        let sigma = uniform(rng, 1.0, 9.0);
        canvas.values.iter_mut().for_each(|v| *v += sigma * normal(rng));
    }
    if chance(rng, 0.1) {
        for pixel in canvas.values.chunks_exact_mut(3) {
            let mean = pixel.iter().sum::<f32>() / 3.0;
            pixel.fill(mean);
        }
    }
    canvas.values.iter_mut().for_each(|v| *v = v.clamp(0.0, 255.0));
}
