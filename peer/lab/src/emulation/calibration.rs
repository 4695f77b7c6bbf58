//! Whether confidence means what it says.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::statistics::{Mean, Proportion};

/// Of fewer wrong decisions seeds differ too little to tell how far the error may be off.
const FEW: usize = 10;

/// So many times decisions are drawn that are right as often as they say.
const DRAWS: usize = 400;

/// One decision for a gesture, against what was shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Said {
    /// Its confidence.
    pub confidence: f64,
    /// Whether that was shown.
    pub right: bool,
    /// Whether robots that learn had been told before of a showing of this gesture that it was one.
    pub taught: bool,
}

/// How sure decisions were, and how right.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Calibration {
    /// The expected calibration error: the mean distance of confidence and share right, in ten bins of confidence, with the interval of a jackknife over
    /// seeds by Student's t; without one where fewer than ten decisions are wrong.
    pub error: Mean,
    /// Up to where the error of decisions of these confidences is in 95 of 100 cases if they are right exactly as often as they say, by a bootstrap.
    pub error_by_chance: Option<f64>,
    /// Wrong decisions, of those of a confidence of at least .99.
    pub sure_and_wrong: Proportion,
    /// Decisions of a confidence of at least .9, of the showings of a gesture that nobody had taught yet.
    pub untaught_and_sure: Proportion,
    /// Decisions, of the showings of a gesture that had been taught.
    pub taught_and_decided: Proportion,
    /// Those of them that are right.
    pub taught_and_right: Proportion,
}

/// The decisions of a seed, and how many showings it had.
#[derive(Clone, Copy, Debug)]
pub(super) struct Heard<'a> {
    pub said: &'a [Said],
    /// Showings of gestures that somebody had taught.
    pub taught: u64,
    /// Showings of gestures that nobody had taught yet.
    pub untaught: u64,
}

impl Heard<'_> {
    fn count(&self, of: impl Fn(&Said) -> bool) -> u64 {
        self.said.iter().filter(|said| of(said)).count() as u64
    }
}

impl Calibration {
    /// Of several seeds.
    pub(super) fn of(seeds: &[Heard<'_>]) -> Self {
        let sure = |said: &Said| said.confidence >= 0.99;
        let share = |of: &dyn Fn(&Heard<'_>) -> (u64, u64)| Proportion::over_seeds(seeds.iter().map(of));
        Self {
            error: jackknife(seeds),
            error_by_chance: by_chance(seeds),
            sure_and_wrong: share(&|seed| (seed.count(|said| sure(said) && !said.right), seed.count(sure))),
            untaught_and_sure: share(&|seed| {
                (seed.count(|said| !said.taught && said.confidence >= 0.9), seed.untaught)
            }),
            taught_and_decided: share(&|seed| (seed.count(|said| said.taught), seed.taught)),
            taught_and_right: share(&|seed| {
                (seed.count(|said| said.taught && said.right), seed.count(|said| said.taught))
            }),
        }
    }
}

fn error(decisions: impl Iterator<Item = Said>) -> f64 {
    let mut bins = [(0.0_f64, 0.0_f64); 10];
    let mut count = 0.0;
    for said in decisions {
        let (confidence, right) = &mut bins[((said.confidence * 10.0) as usize).min(9)];
        *confidence += said.confidence;
        *right += f64::from(u8::from(said.right));
        count += 1.0;
    }
    bins.iter().map(|(confidence, right)| (confidence - right).abs()).sum::<f64>() / f64::max(count, 1.0)
}

fn jackknife(seeds: &[Heard<'_>]) -> Mean {
    // Who said nothing was not wrong about it, nor right.
    if seeds.iter().all(|seed| seed.said.is_empty()) {
        return Mean::of(&[]);
    }
    let all = error(seeds.iter().flat_map(|seed| seed.said).copied());
    if seeds.iter().flat_map(|seed| seed.said).filter(|said| !said.right).count() < FEW {
        return Mean::of(&[all]);
    }
    let n = seeds.len();
    let without = |left: usize| {
        let others = seeds.iter().enumerate().filter(|(k, _)| *k != left);
        error(others.flat_map(|(_, seed)| seed.said).copied())
    };
    let without: Vec<f64> = (0..n).map(without).collect();
    Mean::by_jackknife(all, &without)
}

fn by_chance(seeds: &[Heard<'_>]) -> Option<f64> {
    if seeds.iter().all(|seed| seed.said.is_empty()) {
        return None;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut draw = || {
        let drawn = seeds.iter().flat_map(|seed| seed.said);
        error(drawn.map(|said| Said { right: rng.random::<f64>() < said.confidence, ..*said }))
    };
    let mut errors: Vec<f64> = (0..DRAWS).map(|_| draw()).collect();
    errors.sort_by(f64::total_cmp);
    Some(errors[DRAWS * 95 / 100])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_is_held_against_what_is_right() {
        let said = |confidence, right| Said { confidence, right, taught: true };
        let honest: Vec<Said> = (0..100).map(|n| said(0.75, n % 4 != 0)).collect();
        let boasting: Vec<Said> = (0..100).map(|n| said(0.995, n % 4 != 0)).collect();
        let of = |said: &[Said]| {
            Calibration::of(&[
                Heard { said, taught: 100, untaught: 0 },
                Heard { said, taught: 150, untaught: 0 },
            ])
        };
        assert!(of(&honest).error.mean < 1e-9);
        assert!((of(&boasting).error.mean - 0.245).abs() < 1e-9);
        assert_eq!(of(&boasting).sure_and_wrong, Proportion::over_seeds([(25, 100); 2]));
        assert_eq!(of(&honest).sure_and_wrong.trials, 0);
        assert_eq!(of(&honest).taught_and_decided, Proportion::over_seeds([(100, 100), (100, 150)]));
        assert_eq!(of(&honest).taught_and_right, Proportion::over_seeds([(75, 100); 2]));
        assert!(of(&honest).error.n == 2 && Some(of(&boasting).error.mean) > of(&boasting).error_by_chance);
        let unheard = [Said { confidence: 0.95, right: false, taught: false }];
        let of = Calibration::of(&[Heard { said: &unheard, taught: 3, untaught: 4 }]);
        assert_eq!(of.untaught_and_sure, Proportion::new(1, 4));
        assert_eq!(of.taught_and_decided, Proportion::new(0, 3));
    }

    #[test]
    fn where_hardly_anything_is_wrong_chance_says_how_far_the_error_is_off() {
        let right = [Said { confidence: 0.95, right: true, taught: true }; 20];
        let of = Calibration::of(&[Heard { said: &right, taught: 20, untaught: 0 }; 4]);
        assert_eq!((of.error.n, of.error.decimals(3)), (1, "0.050".to_owned()));
        // Of 80 decisions of .95 the share is off by .0375 or less in 94 cases of 100, and by .05 or less in 98.
        assert!(of.error_by_chance.is_some_and(|error| (0.035..=0.055).contains(&error)), "{of:?}");
        let silent = Calibration::of(&[Heard { said: &[], taught: 9, untaught: 0 }]);
        assert_eq!((silent.error_by_chance, silent.error.n), (None, 0), "nothing was measured");
    }
}
