//! Where the finder's maps have their peaks.

use super::place::Place;
use super::probability;
use crate::network::FeatureMap;

/// How many places are looked at.
const MOST: usize = 3;
/// So many peaks are considered: among the first, some are near copies of each other.
const PEAKS: usize = MOST + 2;
/// A peak nearer to a higher one than this share of the larger one's side is the same hand's.
const NEAR: f32 = 0.35;
/// Pixels of the picture from one cell of the maps to the next.
const CELL: f32 = 4.0;
/// The side that the maps are relative to, pixels, and how far from it they are believed, in nats.
const SIDE: f32 = 24.0;
const SMALLEST: f32 = -1.6;
const LARGEST: f32 = 1.7;

/// Where a hand may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// How likely it is, `0.0..=1.0`.
    pub peak: f32,
    /// In pixels of the finder's picture.
    pub place: Place,
}

/// The likeliest places, likeliest first, at most three.
pub fn candidates(maps: &FeatureMap) -> impl Iterator<Item = Candidate> + use<> {
    let mut peaks: [Option<Candidate>; PEAKS] = [None; PEAKS];
    let (_, height, width) = maps.shape();
    let centre = maps.channel(0);
    let lowest =
        |peaks: &[Option<Candidate>; PEAKS]| peaks[PEAKS - 1].map_or(0.0, |candidate| candidate.peak);
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let logit = centre[y * width + x];
        let around = || {
            let rows = y.saturating_sub(1)..(y + 2).min(height);
            rows.flat_map(move |j| (x.saturating_sub(1)..(x + 2).min(width)).map(move |i| (j, i)))
        };
        let peak = probability::alone(logit);
        if peak <= lowest(&peaks) || around().any(|(j, i)| centre[j * width + i] > logit) {
            continue;
        }
        // Between the cells: where the peak and its neighbours balance.
        let (mut sum, mut right, mut down) = (0.0, 0.0, 0.0);
        for (j, i) in around() {
            let weight = probability::alone(centre[j * width + i]);
            (sum, right, down) = (sum + weight, right + weight * i as f32, down + weight * j as f32);
        }
        let at = |cells: f32| (cells + 0.5) * CELL - 0.5;
        let [larger, sine, cosine] = [1, 2, 3].map(|channel| maps.channel(channel)[y * width + x]);
        let place = Place {
            x: at(right / sum),
            y: at(down / sum),
            side: SIDE * larger.clamp(SMALLEST, LARGEST).exp(),
            up: sine.atan2(cosine),
        };
        peaks[PEAKS - 1] = Some(Candidate { peak, place });
        peaks.sort_by(|a, b| b.map_or(0.0, |b| b.peak).total_cmp(&a.map_or(0.0, |a| a.peak)));
    }
    for index in 1..PEAKS {
        let (higher, rest) = peaks.split_at_mut(index);
        let is_copy = |of: &Candidate, other: &Candidate| of.place.is_near(&other.place, NEAR);
        if rest[0].is_some_and(|peak| higher.iter().flatten().any(|other| is_copy(&peak, other))) {
            rest[0] = None;
        }
    }
    peaks.into_iter().flatten().take(MOST)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn maps(peaks: &[(usize, usize, f32)]) -> FeatureMap {
        let mut maps = FeatureMap::new(5, 30, 40);
        maps.values_mut()[..1200].fill(-9.0);
        maps.values_mut()[3 * 1200..4 * 1200].fill(1.0);
        for (y, x, logit) in peaks {
            maps.values_mut()[y * 40 + x] = *logit;
        }
        maps
    }

    #[test]
    fn the_highest_peaks_come_first_and_near_copies_not_at_all() {
        let maps =
            maps(&[(3, 4, 1.0), (20, 30, 2.0), (20, 32, 1.5), (9, 12, -1.0), (28, 2, 0.0), (0, 39, -2.0)]);
        let found: Vec<Candidate> = candidates(&maps).collect();
        let places = found.iter().map(|found| (found.place.x.round(), found.place.y.round()));
        assert_eq!(places.collect::<Vec<_>>(), [(122.0, 82.0), (18.0, 14.0), (10.0, 114.0)]);
        assert!(found.iter().all(|found| (found.place.side, found.place.up) == (24.0, 0.0)));
        assert!((found[0].peak - 0.880_797).abs() < 1e-5);
    }

    #[test]
    fn a_peak_between_two_cells_is_between_them() {
        let maps = maps(&[(10, 10, 3.0), (10, 11, 3.0)]);
        let found: Vec<Candidate> = candidates(&maps).collect();
        assert!((found[0].place.x - 43.5).abs() < 0.1 && (found[0].place.y - 41.5).abs() < 0.1, "{found:?}");
    }
}
