//! Which pixels have the colour of the hand: a colour model learned anew from every frame.
//!
//! Colours are compared as logarithms of channel ratios, log(R/G) and log(B/G), relative to the balanced background.
//! There a change of the light's colour or of the camera's white balance is a shift, common to all pixels, and a change
//! of its strength (a shadow, a vignette) is none at all. The hand is what differs most from the background, and
//! Fisher's linear discriminant (R. A. Fisher, 1936) between the two says along which direction of colour to look, be
//! it skin or a glove of any colour.
//!
//! Two cases need no discriminant, only a distance from grey: a background so bright that anything of a colour stands
//! out from it; and the stage of colour switched off, where a fixed threshold takes the camera's colours at their word.

use opencv::core::{BORDER_DEFAULT, CV_8U, Mat, MatTraitConst, MatTraitConstManual, MatTraitManual};
use opencv::core::{Scalar, Size};
use opencv::imgproc::{
    INTER_AREA, MORPH_CLOSE, MORPH_ELLIPSE, THRESH_BINARY, gaussian_blur, get_structuring_element_def,
    morphology_ex_def, resize, threshold,
};

use super::background::{cast, unchanged};
use super::frame::View;
use super::white_balance::{Channels, WhiteBalance, is_full};
use super::{NoHand, NoObservation};

/// The model is learned on a thumbnail smaller than the glance by this factor.
const THUMBNAIL: i32 = 2;
/// Where between the means of background (0) and hand (1) the boundary lies: nearer to the background, which
/// varies less.
const BOUNDARY: f32 = 0.38;
/// Before a background without colour or texture, this much colour is a hand's, nats.
const OFF_WHITE: f32 = 0.03;
/// A pixel with a full channel that may be this near to the background is background, nats.
const NEAR_BACKGROUND: f32 = 0.05;
/// The fewest pixels of the thumbnail that are a hand.
const FEWEST: usize = 8;
/// With the stage of colour off, this much colour is a hand's, nats: half of what skin has in an even light.
const OFF_GREY: f32 = 0.35;
/// Side of the gaps closed in a hand with overexposed patches, pixels.
const PATCH: i32 = 5;
/// Variance of a colour coordinate that is always assumed, nats²: quantisation, and no division by zero.
const NOISE: f32 = 7.5e-4;
/// Bins of the histogram of colour distances, and their width in nats.
const BINS: usize = 256;
const BIN: f32 = 1.0 / 73.0;
/// The score of a pixel on the boundary, and how much the means of background and hand differ in score.
const ZERO_SCORE: f64 = 127.0;
const CONTRAST_SCORE: f32 = 160.0;
/// Bits after the binary point of the score's tables.
const FRACTION: i32 = 6;

/// log(R/G) and log(B/G) of a pixel.
type Chroma = [f32; 2];

fn chroma([blue, green, red]: Channels) -> Chroma {
    [red - green, blue - green]
}

/// Finds the pixels that have the colour of the hand.
pub struct ColourModel {
    minimum_contrast: f32,
    /// Whether a discriminant is learned at all.
    relative: bool,
    balance: WhiteBalance,
    thumbnail: Mat,
    before: Mat,
    /// Of each pixel of the thumbnail: its colour, how much it stands out, and whether it may be a hand at all.
    chroma: Vec<Chroma>,
    distance: Vec<f32>,
    changed: Vec<bool>,
    is_hand: Vec<bool>,
    rule: Rule,
    /// How much brighter each channel is than in the scene without anyone, nats; `None` without such a scene.
    cast: Option<Channels>,
    separation: f32,
}

/// What makes a pixel one of the hand.
enum Rule {
    /// The sum of what its blue, green and red values add to the score.
    Score { tables: Box<[[i32; 256]; 3]>, model: Discriminant },
    /// That much colour, nats.
    Colourful(f32),
}

/// A pixel belongs to the hand where `weights · chroma > boundary`.
#[derive(Clone, Copy)]
struct Discriminant {
    weights: Chroma,
    boundary: f32,
    /// The hand's mean.
    hand: Chroma,
    /// Distance of the two means along the weights' direction, nats.
    contrast: f32,
    /// The same in standard deviations (of both sides added).
    separation: f32,
}

impl Discriminant {
    /// The score of a pixel: [`ZERO_SCORE`] on the boundary, more inside the hand's colours.
    fn score(&self, chroma: Chroma) -> f32 {
        ZERO_SCORE as f32 + (dot(self.weights, chroma) - self.boundary) * self.unit()
    }

    /// The score of a pixel with a full channel, which may be brighter than it looks: how near it may be to the
    /// background, against how near it may be to the hand.
    fn score_of_full(&self, bgr: [u8; 3], balance: &WhiteBalance) -> f32 {
        let near_background = magnitude(chroma(balance.relative(bgr)));
        if near_background < NEAR_BACKGROUND {
            return 0.0;
        }
        let [red, blue] = self.hand;
        let apart = chroma(balance.relative_to(bgr, [blue, 0.0, red]));
        let near_hand = magnitude([apart[0] - red, apart[1] - blue]);
        let share = near_background / (near_background + near_hand);
        ZERO_SCORE as f32 + (share - BOUNDARY) * CONTRAST_SCORE
    }

    fn unit(&self) -> f32 {
        CONTRAST_SCORE / self.contrast
    }
}

impl ColourModel {
    /// A model of colours relative to the balanced background, or with `relative` false, as the camera gives them.
    pub fn new(minimum_contrast: f32, relative: bool, period: Option<f32>) -> Self {
        Self {
            minimum_contrast,
            relative,
            balance: WhiteBalance::new(relative, period),
            thumbnail: Mat::default(),
            before: Mat::default(),
            chroma: Vec::new(),
            distance: Vec::new(),
            changed: Vec::new(),
            is_hand: Vec::new(),
            rule: Rule::Colourful(OFF_GREY),
            cast: None,
            separation: 0.0,
        }
    }

    /// How plainly hand and background differed in the last frame, `0.0..=1.0`: from 0.8 standard deviations to
    /// 2.
    pub fn plausibility(&self) -> f32 {
        ((self.separation - 0.8) / 1.2).clamp(0.0, 1.0)
    }

    /// The white balance of the last frame.
    pub fn balance(&self) -> &WhiteBalance {
        &self.balance
    }

    /// Learns the hand's colour from the frame at a glance.
    pub fn learn(&mut self, glance: &View) -> Result<(), NoObservation> {
        if !self.relative {
            self.separation = 2.0;
            return Ok(());
        }
        self.take_thumbnail(glance)?;
        if self.balance.overexposed() {
            if self.distance.iter().filter(|&&distance| distance > OFF_WHITE).count() < FEWEST {
                let contrast = self.distance.iter().copied().fold(0.0, f32::max);
                return Err(NoHand::NothingStandsOut { contrast }.into());
            }
            self.rule = Rule::Colourful(OFF_WHITE);
            // Half plausible: parts of the hand may be as white as the wall.
            self.separation = 1.4;
            return Ok(());
        }
        let found = self.discriminate();
        let Some(model) = found.filter(|model| model.contrast >= self.minimum_contrast) else {
            let contrast = found.map_or(0.0, |model| model.contrast);
            return Err(NoHand::NothingStandsOut { contrast }.into());
        };
        self.separation = model.separation;
        self.rule = Rule::Score { tables: self.tabulate(&model), model };
        Ok(())
    }

    /// Marks the pixels of a view that have the colour learned, and were not there before.
    pub fn mark(&self, view: &mut View) -> Result<(), opencv::Error> {
        let size = view.image.size()?;
        if view.score.size()? != size {
            view.score = Mat::new_size_with_default(size, CV_8U, Scalar::all(0.0))?;
        }
        let pixels = view.image.data_bytes()?.chunks_exact(3).map(|bgr| [bgr[0], bgr[1], bgr[2]]);
        let scores = view.score.data_bytes_mut()?;
        match &self.rule {
            Rule::Score { tables, model } => {
                let [b, g, r] = &**tables;
                for (score, bgr) in scores.iter_mut().zip(pixels) {
                    let sum = b[usize::from(bgr[0])] + g[usize::from(bgr[1])] + r[usize::from(bgr[2])];
                    *score = (sum >> FRACTION).clamp(0, 255) as u8;
                    if is_full(bgr) {
                        *score = model.score_of_full(bgr, &self.balance) as u8;
                    }
                }
                if let Some(cast) = self.cast {
                    let before =
                        view.before.data_bytes()?.chunks_exact(3).map(|bgr| [bgr[0], bgr[1], bgr[2]]);
                    let pixels = view.image.data_bytes()?.chunks_exact(3).map(|bgr| [bgr[0], bgr[1], bgr[2]]);
                    for ((score, bgr), before) in scores.iter_mut().zip(pixels).zip(before) {
                        if f64::from(*score) > ZERO_SCORE {
                            let then = brighter(self.balance.relative(before), cast);
                            let was_alike = f64::from(model.score(chroma(then))) > ZERO_SCORE;
                            if was_alike && unchanged(self.balance.relative(bgr), then) {
                                *score = 0;
                            }
                        }
                    }
                }
            }
            Rule::Colourful(least) => {
                for (score, bgr) in scores.iter_mut().zip(pixels) {
                    let colour = magnitude(chroma(self.balance.relative(bgr)));
                    *score = (ZERO_SCORE as f32 * colour / least) as u8;
                }
            }
        }
        gaussian_blur(&view.score, &mut view.blurred, Size::new(3, 3), 0.0, 0.0, BORDER_DEFAULT)?;
        threshold(&view.blurred, &mut view.mask, ZERO_SCORE, 255.0, THRESH_BINARY)?;
        view.patchy = self.balance.overexposed();
        if view.patchy {
            let patch = get_structuring_element_def(MORPH_ELLIPSE, Size::new(PATCH, PATCH))?;
            std::mem::swap(&mut view.mask, &mut view.blurred);
            morphology_ex_def(&view.blurred, &mut view.mask, MORPH_CLOSE, &patch)?;
        }
        Ok(())
    }
}

impl ColourModel {
    /// The frame's colours, small enough to learn from at once.
    fn take_thumbnail(&mut self, glance: &View) -> Result<(), NoObservation> {
        let size = glance.image.size()?;
        let small = Size::new(size.width / THUMBNAIL, size.height / THUMBNAIL);
        resize(&glance.image, &mut self.thumbnail, small, 0.0, 0.0, INTER_AREA)?;
        self.cast = None;
        if !glance.before.empty() {
            resize(&glance.before, &mut self.before, small, 0.0, 0.0, INTER_AREA)?;
            self.cast = cast(&self.thumbnail, &self.before)?;
        }
        match self.cast {
            Some(cast) => self.balance.estimate(&self.before, cast)?,
            None => self.balance.estimate(&self.thumbnail, [0.0; 3])?,
        }
        let balance = &self.balance;
        let levels = |image: &Mat| -> Result<Vec<Channels>, opencv::Error> {
            let pixels = image.data_bytes()?.chunks_exact(3);
            Ok(pixels.map(|bgr| balance.relative([bgr[0], bgr[1], bgr[2]])).collect())
        };
        let seen = levels(&self.thumbnail)?;
        self.chroma.clear();
        self.chroma.extend(seen.iter().map(|&levels| chroma(levels)));
        self.distance.clear();
        self.distance.extend(self.chroma.iter().map(|&chroma| magnitude(chroma)));
        self.changed.clear();
        self.changed.resize(seen.len(), true);
        if let Some(cast) = self.cast {
            let before = levels(&self.before)?;
            for (i, (seen, before)) in seen.iter().zip(before).enumerate() {
                let then = brighter(before, cast);
                let ([red, blue], [red_then, blue_then]) = (chroma(*seen), chroma(then));
                // What stands out from the border, and was not there before.
                let change = magnitude([red - red_then, blue - blue_then]);
                self.distance[i] = self.distance[i].min(change);
                self.changed[i] = !unchanged(*seen, then);
            }
        }
        Ok(())
    }

    /// Finds the discriminant: seeds by Otsu's threshold of the distance to the background, then a few rounds
    /// of Fisher's discriminant on the pixels that the last round took for the hand. `None` where all pixels
    /// are alike.
    fn discriminate(&mut self) -> Option<Discriminant> {
        let mut histogram = [0u32; BINS];
        for &distance in &self.distance {
            histogram[bin(distance)] += 1;
        }
        let seed = otsu(&histogram);
        self.is_hand.clear();
        self.is_hand.extend(self.distance.iter().map(|&distance| bin(distance) > seed));
        let mut learned = None;
        for _ in 0..3 {
            let model = fisher(&self.chroma, &self.is_hand)?;
            for ((is_hand, chroma), changed) in self.is_hand.iter_mut().zip(&self.chroma).zip(&self.changed) {
                *is_hand = *changed && dot(model.weights, *chroma) > model.boundary;
            }
            learned = Some(model);
        }
        learned
    }

    /// Prepares the scores. They are linear in the logarithms of the channels, so one table per channel holds them
    /// exactly.
    fn tabulate(&self, model: &Discriminant) -> Box<[[i32; 256]; 3]> {
        let [red, blue] = model.weights;
        let [b, g, r] = self.balance.tables();
        let (offset, scale) = (model.score([0.0; 2]), f32::from(1u16 << FRACTION));
        let table = |logarithms: &[f32; 256], weight: f32, offset: f32| {
            logarithms.map(|logarithm| ((weight * model.unit() * logarithm + offset) * scale) as i32)
        };
        Box::new([table(b, blue, 0.0), table(g, -red - blue, offset), table(r, red, 0.0)])
    }
}

fn brighter(levels: Channels, cast: Channels) -> Channels {
    std::array::from_fn(|channel| levels[channel] + cast[channel])
}

fn magnitude([red, blue]: Chroma) -> f32 {
    red.abs() + blue.abs()
}

fn dot(a: Chroma, b: Chroma) -> f32 {
    a[0] * b[0] + a[1] * b[1]
}

fn bin(distance: f32) -> usize {
    ((distance / BIN) as usize).min(BINS - 1)
}

/// The last bin of the lower class, by the largest variance between classes (N. Otsu, 1979).
fn otsu(histogram: &[u32; BINS]) -> usize {
    let moment = |(bin, &count): (usize, &u32)| bin as f64 * f64::from(count);
    let total: f64 = histogram.iter().map(|&count| f64::from(count)).sum();
    let sum: f64 = histogram.iter().enumerate().map(moment).sum();
    let (mut below, mut sum_below) = (0.0, 0.0);
    let (mut best, mut threshold) = (-1.0, 0);
    for (bin, &count) in histogram.iter().enumerate() {
        below += f64::from(count);
        sum_below += bin as f64 * f64::from(count);
        let above = total - below;
        if below == 0.0 || above == 0.0 {
            continue;
        }
        let gap = sum_below / below - (sum - sum_below) / above;
        let between = below * above * gap * gap;
        if between > best {
            (best, threshold) = (between, bin);
        }
    }
    threshold
}

/// Mean and covariance (xx, xy, yy) of the chosen pixels, and how many there are.
fn statistics(chroma: &[Chroma], chosen: impl Iterator<Item = bool>) -> (Chroma, [f32; 3], usize) {
    let (mut count, mut sum, mut squares) = (0, [0.0; 2], [0.0; 3]);
    for (&[x, y], _) in chroma.iter().zip(chosen).filter(|(_, chosen)| *chosen) {
        count += 1;
        sum = [sum[0] + x, sum[1] + y];
        squares = [squares[0] + x * x, squares[1] + x * y, squares[2] + y * y];
    }
    let n = count.max(1) as f32;
    let mean = [sum[0] / n, sum[1] / n];
    let [xx, xy, yy] = squares.map(|square| square / n);
    (mean, [xx - mean[0] * mean[0], xy - mean[0] * mean[1], yy - mean[1] * mean[1]], count)
}

/// Fisher's linear discriminant between the pixels of the hand and the others; `None` when either are too few.
fn fisher(chroma: &[Chroma], is_hand: &[bool]) -> Option<Discriminant> {
    let (hand, hand_spread, hand_count) = statistics(chroma, is_hand.iter().copied());
    let (other, other_spread, other_count) = statistics(chroma, is_hand.iter().map(|hand| !hand));
    if hand_count < FEWEST || other_count < FEWEST {
        return None;
    }
    let spread = |i: usize| (hand_spread[i] + other_spread[i]) / 2.0;
    let (xx, xy, yy) = (spread(0) + NOISE, spread(1), spread(2) + NOISE);
    let apart = [hand[0] - other[0], hand[1] - other[1]];
    // The inverse of the 2×2 covariance times the difference of the means, to scale; then scaled to a largest
    // weight of 1.
    let weights = [yy * apart[0] - xy * apart[1], xx * apart[1] - xy * apart[0]];
    let largest = weights[0].abs().max(weights[1].abs());
    if !largest.is_normal() {
        return None;
    }
    let weights = weights.map(|weight| weight / largest);
    let low = dot(weights, other);
    let contrast = dot(weights, hand) - low;
    let deviation = |[xx, xy, yy]: [f32; 3]| {
        let [a, b] = weights;
        (a * a * xx + 2.0 * a * b * xy + b * b * yy + NOISE).max(NOISE).sqrt()
    };
    let separation = contrast / (deviation(hand_spread) + deviation(other_spread));
    Some(Discriminant { weights, boundary: low + BOUNDARY * contrast, hand, contrast, separation })
}
