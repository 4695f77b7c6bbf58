//! What the scene looks like without anyone, compared with what is seen now.

use std::array::from_fn;

use opencv::core::{Mat, MatTraitConstManual};

use super::white_balance::{Channels, is_full};

/// Less change of colour than this, in nats, is noise; and less change of lightness is noise or a shadow.
const COLOUR: f32 = 0.12;
const LIGHTNESS: f32 = 0.25;
/// The share of the frame that must still be as it was for the background to be of any use.
const RECOGNISED: f32 = 0.3;
/// Bins of the histogram of changes, their width in nats, and the change in the middle of it.
const BINS: usize = 256;
const BIN: f32 = 0.02;

/// Whether two pixels, relative to the background's level, show the same thing.
pub fn unchanged(seen: Channels, before: Channels) -> bool {
    let change: Channels = from_fn(|c| seen[c] - before[c]);
    (change[2] - change[1]).abs() + (change[0] - change[1]).abs() < COLOUR && change[1].abs() < LIGHTNESS
}

/// How much brighter each channel has become since the scene was empty, in nats: the median over all pixels without a
/// full channel. `None` when the scene is another one: the camera has moved, or the room is full.
pub fn cast(seen: &Mat, before: &Mat) -> Result<Option<Channels>, opencv::Error> {
    let log = |value: u8| (f32::from(value) + 8.0).ln();
    let logs: [f32; 256] = from_fn(|value| log(value as u8));
    let pixels = |image: &'_ Mat| -> Result<Vec<[u8; 3]>, opencv::Error> {
        Ok(image.data_bytes()?.chunks_exact(3).map(|bgr| [bgr[0], bgr[1], bgr[2]]).collect())
    };
    let (seen, before) = (pixels(seen)?, pixels(before)?);
    let known = || seen.iter().zip(&before).filter(|(now, then)| !is_full(**now) && !is_full(**then));
    let change = |now: &[u8; 3], then: &[u8; 3]| -> Channels {
        from_fn(|c| logs[usize::from(now[c])] - logs[usize::from(then[c])])
    };
    let mut histograms = [[0_u32; BINS]; 3];
    let mut count = 0;
    for (now, then) in known() {
        count += 1;
        for (histogram, change) in histograms.iter_mut().zip(change(now, then)) {
            let bin = (change / BIN).round() + (BINS / 2) as f32;
            histogram[bin.clamp(0.0, (BINS - 1) as f32) as usize] += 1;
        }
    }
    let cast = histograms.map(|histogram| {
        let mut below = 0;
        let middle = histogram.iter().position(|n| {
            below += n;
            2 * below >= count
        });
        (middle.unwrap_or(BINS / 2) as f32 - (BINS / 2) as f32) * BIN
    });
    let as_before = known().filter(|(now, then)| unchanged(change(now, then), cast)).count();
    Ok((as_before as f32 > RECOGNISED * seen.len() as f32).then_some(cast))
}
