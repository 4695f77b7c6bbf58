//! How much of a view is different from another, when light, noise and trembling are allowed for.

use std::time::Duration;

use opencv::core::Vec3b;
use opencv::prelude::*;

use super::View;

/// Every this many pixels one is sampled for the light and the noise.
const STRIDE: usize = 29;

/// The fewest samples from which a channel's gain is taken.
const FEWEST: usize = 40;

/// A pixel must change by more grey levels than this, however little noise there is: codecs err by as much.
const FLOOR: f32 = 8.0;

/// And by more than this share of its brightness: shadows and exposure err by as much.
const RELATIVE: f32 = 0.05;

/// Below it a channel says nothing about the light, above it the sensor is saturated.
const USABLE: std::ops::Range<u8> = 16..246;

/// The noise of a camera is followed this fast.
const MEMORY: Duration = Duration::from_secs(3);

/// A normal distribution's median absolute value, in standard deviations.
const MEDIAN_DEVIATION: f32 = 0.6745;

/// Compares views, and learns a camera's noise while it does.
#[derive(Default)]
pub(super) struct Difference {
    /// Standard deviation of a view's pixel, in grey levels; `None` before the first comparison.
    noise: Option<f32>,
    /// As the last comparison had it.
    noise_now: f32,
    ratios: [Vec<f32>; 3],
    deviations: Vec<f32>,
}

impl Difference {
    /// The share of the pixels of `view` that nothing but a change of the scene explains, `0.0..=1.0`. A pixel has not
    /// changed when its value, after matching the light of each channel, lies between the least and the greatest value
    /// around it in `reference`, give or take `deviations` standard deviations of the noise.
    pub fn share(&mut self, view: &View, reference: &View, deviations: f64) -> opencv::Result<f64> {
        let now = view.picture.data_typed::<Vec3b>()?;
        let then = reference.picture.data_typed::<Vec3b>()?;
        let gain = self.gain(now, then);
        self.noise_now = self.deviation(now, then, gain);
        let noise = self.noise.unwrap_or(self.noise_now);
        let margin = (deviations as f32 * std::f32::consts::SQRT_2 * noise).max(FLOOR);
        let bounds = gain.map(|gain| Bounds::new(gain, margin));
        let least = reference.least.data_typed::<Vec3b>()?;
        let greatest = reference.greatest.data_typed::<Vec3b>()?;
        let mut changed = 0_usize;
        for ((pixel, least), greatest) in now.iter().zip(least).zip(greatest) {
            // Without branches: which pixels change is hard to foresee.
            let outside = |c: usize| {
                (pixel[c] < bounds[c].lowest[usize::from(least[c])])
                    | (pixel[c] > bounds[c].highest[usize::from(greatest[c])])
            };
            changed += usize::from(outside(0) | outside(1) | outside(2));
        }
        Ok(changed as f64 / now.len().max(1) as f64)
    }

    /// Takes the noise of the last comparison into account; `gap` is the time since the one before.
    pub fn learn_noise(&mut self, gap: Duration) {
        let weight = 1.0 - (-gap.as_secs_f32() / MEMORY.as_secs_f32()).exp();
        let noise = self.noise.get_or_insert(self.noise_now);
        *noise += weight * (self.noise_now - *noise);
    }

    /// How much brighter each channel has become: exposure and white balance change all of it by a factor. The median over
    /// the picture does not mind somebody who covers less than half of it.
    fn gain(&mut self, now: &[Vec3b], then: &[Vec3b]) -> [f32; 3] {
        for (channel, ratios) in self.ratios.iter_mut().enumerate() {
            ratios.clear();
            let samples =
                now.iter().zip(then).step_by(STRIDE).map(|(now, then)| (now[channel], then[channel]));
            let usable = samples.filter(|(now, then)| USABLE.contains(now) && USABLE.contains(then));
            ratios.extend(usable.map(|(now, then)| f32::from(now) / f32::from(then)));
        }
        self.ratios.each_mut().map(|ratios| if ratios.len() < FEWEST { 1.0 } else { median(ratios) })
    }

    /// The noise of one view's pixel, by the median difference: what moves is not noise, as long as it is less than half.
    fn deviation(&mut self, now: &[Vec3b], then: &[Vec3b], gain: [f32; 3]) -> f32 {
        self.deviations.clear();
        let samples = now.iter().zip(then).step_by(STRIDE);
        self.deviations.extend(samples.flat_map(|(now, then)| {
            std::array::from_fn::<f32, 3, _>(|c| (f32::from(now[c]) - gain[c] * f32::from(then[c])).abs())
        }));
        median(&mut self.deviations) / (MEDIAN_DEVIATION * std::f32::consts::SQRT_2)
    }
}

/// The values a channel may have without having changed, by its least and greatest value before.
struct Bounds {
    lowest: [u8; 256],
    highest: [u8; 256],
}

impl Bounds {
    fn new(gain: f32, margin: f32) -> Self {
        let saturated = f32::from(USABLE.end);
        let matched = |before: usize| gain * before as f32;
        Self {
            // What was matched to beyond the sensor's range is saturated now.
            lowest: std::array::from_fn(|b| {
                (matched(b).min(saturated) * (1.0 - RELATIVE) - margin).clamp(0.0, 255.0) as u8
            }),
            // What was saturated may have been brighter by any amount.
            highest: std::array::from_fn(|b| match b as f32 >= saturated {
                true => u8::MAX,
                false => (matched(b) * (1.0 + RELATIVE) + margin).clamp(0.0, 255.0) as u8,
            }),
        }
    }
}

fn median(values: &mut [f32]) -> f32 {
    let middle = values.len() / 2;
    match values.get(middle) {
        Some(_) => *values.select_nth_unstable_by(middle, f32::total_cmp).1,
        None => 0.0,
    }
}
