//! Which pixels have the colour of the hand: a colour model learned anew from every frame.
//!
//! Colours are compared as logarithms of channel ratios, log(R/G) and log(B/G). There a change of the light's
//! colour or of the camera's white balance is a shift, common to all pixels, and a change of its strength (a
//! shadow, a vignette) is none at all; so what is measured relative to the frame's own background needs no
//! further colour constancy. The hand is what differs most from the frame's border, and Fisher's linear
//! discriminant (R. A. Fisher, 1936) between the two says along which direction of colour to look, be it skin
//! or a glove of any colour.

use opencv::core::{BORDER_DEFAULT, CV_8U, Mat, MatTraitConst, MatTraitConstManual, MatTraitManual};
use opencv::core::{Scalar, Size};
use opencv::imgproc::{INTER_AREA, THRESH_BINARY, gaussian_blur, resize, threshold};

use super::frame::View;
use super::{NoHand, NoObservation};

/// The model is learned on a thumbnail smaller than the glance by this factor.
const THUMBNAIL: i32 = 2;
/// Rows and columns of the thumbnail's border that are taken for background.
const BORDER: usize = 2;
/// Where between the means of background (0) and hand (1) the boundary lies: nearer to the background, which
/// varies less.
const BOUNDARY: f32 = 0.38;
/// Added to a channel before the logarithm, so that the noise of dark pixels stays small.
const DARK: f32 = 8.0;
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

/// Finds the pixels that have the colour of the hand.
pub struct ColourModel {
    minimum_contrast: f32,
    logarithm: [f32; 256],
    thumbnail: Mat,
    chroma: Vec<Chroma>,
    is_hand: Vec<bool>,
    border: Vec<f32>,
    background: Chroma,
    /// What each value of blue, green and red adds to the score of a pixel.
    tables: [[i32; 256]; 3],
    separation: f32,
}

/// A pixel belongs to the hand where `weights · chroma > boundary`.
#[derive(Clone, Copy)]
struct Discriminant {
    weights: Chroma,
    boundary: f32,
    /// Distance of the two means along the weights' direction, nats.
    contrast: f32,
    /// The same in standard deviations (of both sides added).
    separation: f32,
}

impl ColourModel {
    pub fn new(minimum_contrast: f32) -> Self {
        let logarithm = std::array::from_fn(|value| (value as f32 + DARK).ln());
        Self {
            minimum_contrast,
            logarithm,
            thumbnail: Mat::default(),
            chroma: Vec::new(),
            is_hand: Vec::new(),
            border: Vec::new(),
            background: [0.0; 2],
            tables: [[0; 256]; 3],
            separation: 0.0,
        }
    }

    /// How plainly hand and background differed in the last frame, `0.0..=1.0`: from 0.8 standard deviations to
    /// 2.
    pub fn plausibility(&self) -> f32 {
        ((self.separation - 0.8) / 1.2).clamp(0.0, 1.0)
    }

    /// Learns the hand's colour from the frame at a glance.
    pub fn learn(&mut self, glance: &View) -> Result<(), NoObservation> {
        self.take_thumbnail(&glance.image)?;
        let found = self.discriminate();
        let Some(model) = found.filter(|model| model.contrast >= self.minimum_contrast) else {
            let contrast = found.map_or(0.0, |model| model.contrast);
            return Err(NoHand::NothingStandsOut { contrast }.into());
        };
        self.separation = model.separation;
        self.tabulate(&model);
        Ok(())
    }

    /// Marks the pixels of a view that have the colour learned.
    pub fn mark(&self, view: &mut View) -> Result<(), opencv::Error> {
        let size = view.image.size()?;
        if view.score.size()? != size {
            view.score = Mat::new_size_with_default(size, CV_8U, Scalar::all(0.0))?;
        }
        let [b, g, r] = &self.tables;
        let pixels = view.image.data_bytes()?.chunks_exact(3);
        for (score, bgr) in view.score.data_bytes_mut()?.iter_mut().zip(pixels) {
            let sum = b[usize::from(bgr[0])] + g[usize::from(bgr[1])] + r[usize::from(bgr[2])];
            *score = (sum >> FRACTION).clamp(0, 255) as u8;
        }
        gaussian_blur(&view.score, &mut view.blurred, Size::new(3, 3), 0.0, 0.0, BORDER_DEFAULT)?;
        threshold(&view.blurred, &mut view.mask, ZERO_SCORE, 255.0, THRESH_BINARY)?;
        Ok(())
    }
}

impl ColourModel {
    /// The frame's colours, small enough to learn from at once.
    fn take_thumbnail(&mut self, glance: &Mat) -> Result<(), opencv::Error> {
        let size = glance.size()?;
        let small = Size::new(size.width / THUMBNAIL, size.height / THUMBNAIL);
        resize(glance, &mut self.thumbnail, small, 0.0, 0.0, INTER_AREA)?;
        let log = &self.logarithm;
        self.chroma.clear();
        self.chroma.extend(self.thumbnail.data_bytes()?.chunks_exact(3).map(|bgr| {
            let [b, g, r] = [0, 1, 2].map(|channel| log[usize::from(bgr[channel])]);
            [r - g, b - g]
        }));
        let background = self.border_median(small.width as usize, small.height as usize);
        self.background = background;
        for chroma in &mut self.chroma {
            chroma[0] -= background[0];
            chroma[1] -= background[1];
        }
        Ok(())
    }

    /// The median colour of the thumbnail's border.
    fn border_median(&mut self, width: usize, height: usize) -> Chroma {
        let (chroma, border) = (&self.chroma, &mut self.border);
        [0, 1].map(|coordinate| {
            border.clear();
            for (y, row) in chroma.chunks_exact(width).enumerate() {
                let values = row.iter().map(|c| c[coordinate]);
                if y < BORDER || y + BORDER >= height {
                    border.extend(values);
                } else {
                    border.extend(values.clone().take(BORDER).chain(values.skip(width - BORDER)));
                }
            }
            let middle = border.len() / 2;
            *border.select_nth_unstable_by(middle, f32::total_cmp).1
        })
    }

    /// Finds the discriminant: seeds by Otsu's threshold of the distance to the background, then a few rounds
    /// of Fisher's discriminant on the pixels that the last round took for the hand. `None` where all pixels
    /// are alike.
    fn discriminate(&mut self) -> Option<Discriminant> {
        let distance = |c: &Chroma| c[0].abs() + c[1].abs();
        let mut histogram = [0u32; BINS];
        for chroma in &self.chroma {
            histogram[bin(distance(chroma))] += 1;
        }
        let seed = otsu(&histogram);
        self.is_hand.clear();
        self.is_hand.extend(self.chroma.iter().map(|chroma| bin(distance(chroma)) > seed));
        let mut learned = None;
        for _ in 0..3 {
            let model = fisher(&self.chroma, &self.is_hand)?;
            for (is_hand, chroma) in self.is_hand.iter_mut().zip(&self.chroma) {
                *is_hand = dot(model.weights, *chroma) > model.boundary;
            }
            learned = Some(model);
        }
        learned
    }

    /// Prepares the scores: [`ZERO_SCORE`] on the boundary, more inside the hand's colours. They are linear in
    /// the logarithms of the channels, so one table per channel holds them exactly.
    fn tabulate(&mut self, model: &Discriminant) {
        let [red, blue] = model.weights;
        let unit = CONTRAST_SCORE / model.contrast;
        let offset = ZERO_SCORE as f32 - (dot(model.weights, self.background) + model.boundary) * unit;
        let scale = f32::from(1u16 << FRACTION);
        let table = |weight: f32, offset: f32| {
            self.logarithm.map(|logarithm| ((weight * unit * logarithm + offset) * scale) as i32)
        };
        self.tables = [table(blue, 0.0), table(-red - blue, offset), table(red, 0.0)];
    }
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
    const FEWEST: usize = 8;
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
    Some(Discriminant { weights, boundary: low + BOUNDARY * contrast, contrast, separation })
}
