//! Automatic white balance: one gain per channel that makes the background a grey of one lightness.
//!
//! Von Kries' model of colour constancy (1902): light and camera multiply each channel by a factor of their own. The
//! factors are estimated on what is most likely background: the frame's border (gray world, G. Buchsbaum 1980, with
//! the median in place of the mean, so that an arm that crosses the border is no cast), or, where the camera knows the
//! scene without anyone, on that scene's border and how the light has changed since.
//!
//! A channel that is full (255) says no more than "at least so much". Where the other channels tell that the
//! background would be brighter, it is taken to be: an overexposed wall keeps the colour of the wall.

use std::array::from_fn;

use opencv::core::{CV_8UC3, Mat, MatTraitConst, MatTraitConstManual, MatTraitManual, Scalar, Vec3b, lut};

/// Values of the blue, the green and the red channel.
pub type Channels = [f32; 3];

/// The grey level that the background is brought to.
const GREY: f32 = 150.0;
/// The least and the most that a channel is multiplied by: beyond it, noise would be made into colours.
const LEAST: f32 = 0.3;
const MOST: f32 = 4.0;
/// Added to a channel before the logarithm, so that the noise of dark pixels stays small.
const DARK: f32 = 8.0;
/// A channel of that level or more is full: sensors and codecs do not stop at 255 to the digit.
const FULL: u8 = 250;
/// Rows and columns of the thumbnail's border that are taken for background.
const BORDER: usize = 2;
/// A change of a channel's level beyond this, in nats, is another light or another scene, and taken at once.
const JUMP: f32 = 0.1;
/// How long a light takes to change, seconds.
const SETTLING: f32 = 0.5;

/// The balance of one camera.
pub struct WhiteBalance {
    /// Off: all gains are 1.
    enabled: bool,
    /// The share of a new estimate that is taken; 1 where frames have nothing to do with each other.
    pace: f32,
    /// The level of the background, which becomes grey.
    level: Option<Channels>,
    gains: Channels,
    /// Whether most of the background has a full channel.
    overexposed: bool,
    /// ln of each channel's value, balanced, relative to the background's.
    tables: [[f32; 256]; 3],
}

impl WhiteBalance {
    /// The balance of a camera that takes a frame each `period` seconds, or of unrelated pictures.
    pub fn new(enabled: bool, period: Option<f32>) -> Self {
        let pace = period.map_or(1.0, |period| 1.0 - (-period / SETTLING).exp());
        let mut balance =
            Self { enabled, pace, level: None, gains: [1.0; 3], overexposed: false, tables: [[0.0; 256]; 3] };
        balance.tabulate([GREY; 3]);
        balance
    }

    /// What each channel is multiplied by, within 0.3 and 4.
    pub fn gains(&self) -> Channels {
        self.gains
    }

    /// Whether most of the background is too bright for the camera to tell its colour.
    pub fn overexposed(&self) -> bool {
        self.overexposed
    }

    /// ln of each value of a channel, balanced, relative to the background's level.
    pub fn tables(&self) -> &[[f32; 256]; 3] {
        &self.tables
    }

    /// Estimates the balance from the border of a thumbnail, of the frame or of the scene without anyone; then `cast`
    /// says how much brighter each channel is now, in nats.
    pub fn estimate(&mut self, thumbnail: &Mat, cast: Channels) -> Result<(), opencv::Error> {
        if !self.enabled {
            return Ok(());
        }
        let (all, whole) = border_histograms(thumbnail)?;
        let (count, unclipped) = (all[0].iter().sum::<u32>(), whole[0].iter().sum::<u32>());
        self.overexposed = 2 * unclipped < count;
        // A few pixels would be the dark things before a bright wall.
        let source = if 5 * unclipped > count { whole } else { all };
        let medians = source.map(|histogram| median(&histogram));
        self.follow(from_fn(|channel| (medians[channel] as f32).max(1.0) * cast[channel].exp()));
        Ok(())
    }

    /// Goes on from the last estimate to this one.
    fn follow(&mut self, seen: Channels) {
        let near = |level: &Channels| (0..3).all(|c| (seen[c] / level[c]).ln().abs() < JUMP);
        let level = match self.level.filter(near) {
            Some(level) => from_fn(|c| level[c] * (seen[c] / level[c]).powf(self.pace)),
            None => seen,
        };
        self.level = Some(level);
        self.gains = level.map(|level| (GREY / level).clamp(LEAST, MOST));
        self.tabulate(level);
    }

    fn tabulate(&mut self, level: Channels) {
        self.tables = from_fn(|c| {
            let log = |value: f32| (self.gains[c] * value + DARK).ln();
            from_fn(|value| log(value as f32) - log(level[c]))
        });
    }

    /// A pixel (blue, green, red), relative to the background, in nats. Full channels are as bright as the background
    /// would be there, and at least as bright as they are.
    pub fn relative(&self, bgr: [u8; 3]) -> Channels {
        self.relative_to(bgr, [0.0; 3])
    }

    /// The same, with full channels as bright as a thing of that colour would be there.
    pub fn relative_to(&self, bgr: [u8; 3], thing: Channels) -> Channels {
        let mut levels: Channels = from_fn(|c| self.tables[c][usize::from(bgr[c])]);
        if !self.enabled || !is_full(bgr) {
            return levels;
        }
        let known = (0..3).filter(|&c| bgr[c] < FULL);
        let (count, sum) = known.fold((0_u8, 0.0), |(count, sum), c| (count + 1, sum + levels[c] - thing[c]));
        if count == 0 {
            return thing;
        }
        for c in 0..3 {
            if bgr[c] >= FULL {
                levels[c] = levels[c].max(thing[c] + sum / f32::from(count));
            }
        }
        levels
    }

    /// The balanced picture.
    pub fn apply(&self, image: &Mat, balanced: &mut Mat) -> Result<(), opencv::Error> {
        let mut table = Mat::new_rows_cols_with_default(1, 256, CV_8UC3, Scalar::all(0.0))?;
        for (value, out) in table.data_typed_mut::<Vec3b>()?.iter_mut().enumerate() {
            // A float saturates as it becomes an integer.
            *out = Vec3b::from(self.gains.map(|gain| (gain * value as f32).round() as u8));
        }
        lut(image, &table, balanced)
    }
}

/// Whether a pixel has a full channel.
pub fn is_full(bgr: [u8; 3]) -> bool {
    bgr[0].max(bgr[1]).max(bgr[2]) >= FULL
}

type Histograms = [[u32; 256]; 3];

/// The values of each channel on the border: of all pixels, and of those without a full channel.
fn border_histograms(thumbnail: &Mat) -> Result<(Histograms, Histograms), opencv::Error> {
    let size = thumbnail.size()?;
    let (width, height) = (size.width as usize, size.height as usize);
    let (mut all, mut whole) = ([[0; 256]; 3], [[0; 256]; 3]);
    for (y, row) in thumbnail.data_bytes()?.chunks_exact(3 * width).enumerate() {
        let inside = y >= BORDER && y + BORDER < height && width > 2 * BORDER;
        let (left, right) = if inside { (BORDER, width - BORDER) } else { (width, width) };
        for bgr in row[..3 * left].chunks_exact(3).chain(row[3 * right..].chunks_exact(3)) {
            let full = is_full([bgr[0], bgr[1], bgr[2]]);
            for c in 0..3 {
                all[c][usize::from(bgr[c])] += 1;
                whole[c][usize::from(bgr[c])] += u32::from(!full);
            }
        }
    }
    Ok((all, whole))
}

/// The middle value.
fn median(histogram: &[u32; 256]) -> usize {
    let count: u32 = histogram.iter().sum();
    let mut below = 0;
    let reaches_the_middle = |n: &u32| {
        below += n;
        2 * below >= count
    };
    histogram.iter().position(reaches_the_middle).unwrap_or(255)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain(bgr: [u8; 3]) -> Mat {
        let [b, g, r] = bgr.map(f64::from);
        Mat::new_rows_cols_with_default(20, 30, CV_8UC3, Scalar::new(b, g, r, 0.0)).unwrap()
    }

    fn balanced(wall: [u8; 3]) -> WhiteBalance {
        let mut balance = WhiteBalance::new(true, None);
        balance.estimate(&plain(wall), [0.0; 3]).unwrap();
        balance
    }

    #[test]
    fn the_background_becomes_grey() {
        let balance = balanced([180, 120, 90]);
        let mut picture = Mat::default();
        balance.apply(&plain([180, 120, 90]), &mut picture).unwrap();
        assert!(picture.data_bytes().unwrap().iter().all(|value| value.abs_diff(150) <= 1));
        assert!(balance.relative([180, 120, 90]).iter().all(|level| level.abs() < 0.01));
    }

    #[test]
    fn neither_cast_nor_strength_of_the_light_changes_a_colour() {
        let colour = |gains: [f32; 3]| {
            let lit = |bgr: [u8; 3]| from_fn(|c| (f32::from(bgr[c]) * gains[c]) as u8);
            balanced(lit([150, 155, 160])).relative(lit([95, 125, 190]))
        };
        let reference = colour([1.0; 3]);
        for gains in [[1.3, 1.0, 1.0], [1.0, 0.7, 1.0], [0.5; 3], [0.6, 0.8, 1.2]] {
            for (a, b) in reference.iter().zip(colour(gains)) {
                assert!((a - b).abs() < 0.03, "{gains:?}: {a} and {b}");
            }
        }
    }

    #[test]
    fn gains_stay_sane_before_a_background_without_a_channel() {
        for wall in [[0; 3], [255; 3], [250, 3, 0]] {
            assert!(balanced(wall).gains().iter().all(|gain| (LEAST..=MOST).contains(gain)));
        }
    }

    #[test]
    fn a_full_channel_is_as_bright_as_the_background_would_be_and_no_darker_than_it_is() {
        // A wall whose green fills up where the light is strongest is still that wall.
        let balance = balanced([150, 200, 150]);
        let brightest = balance.relative([225, 255, 225]);
        assert!(brightest.iter().all(|level| (level - brightest[0]).abs() < 0.01), "{brightest:?}");
        // And a glove that fills green is still no wall.
        let glove = balance.relative([100, 255, 100]);
        assert!(glove[1] - glove[0] > 0.5, "{glove:?}");
    }

    #[test]
    fn a_camera_follows_a_slow_change_slowly_and_a_sudden_one_at_once() {
        let mut balance = WhiteBalance::new(true, Some(1.0 / 30.0));
        let mut gain = |level: u8| {
            balance.estimate(&plain([level; 3]), [0.0; 3]).unwrap();
            balance.gains()[1]
        };
        let first = gain(150);
        let nudged = gain(156);
        assert!(nudged < first && nudged > 150.0 / 156.0 + 0.02, "{first} {nudged}");
        assert!((gain(75) - 2.0).abs() < 0.05);
    }

    #[test]
    fn the_background_known_is_the_reference_whatever_stands_before_it() {
        let mut balance = WhiteBalance::new(true, None);
        let twice = 2.0_f32.ln();
        balance.estimate(&plain([50, 60, 70]), [twice, twice, 0.0]).unwrap();
        let expected = [1.5, 1.25, 150.0 / 70.0];
        for (gain, expected) in balance.gains().iter().zip(expected) {
            assert!((gain - expected).abs() < 0.03, "{:?}", balance.gains());
        }
    }
}
