//! What confirmed rounds say of how alike robots are.

use gestalt_protocol::{ClassId, Decision, Pool};

use crate::alike::{sharpness, strength, voices};
use crate::columns::Columns;
use crate::fusion::{clip_into, softmax};
use crate::rows::Rows;

/// The most robots of a round whose own votes are looked into: those of the smallest ids. All count in its sum.
const MAX_SINGLES: usize = 16;

/// T lies on a scale of this ratio, from the least on.
const RATIO: f64 = 1.25;
const LEAST: f64 = 0.41;
const TEMPERATURES: i32 = 13;

/// ρ lies on a scale of so many steps.
const STEPS: i32 = 20;

/// How far T and ρ may lie from what is believed beforehand: a standard deviation, of ln T and of ρ.
const SPREAD: (f64, f64) = (0.5, 0.3);

/// How much what single robots say weighs beside what they say together.
const SINGLES: f64 = 0.3;

/// How much of its weight a round keeps when the next is confirmed: robots learn, and err otherwise than they did.
const FADES: f64 = 0.97;

/// The probability of a wrong word of an instructor.
const SLIP: f64 = 0.02;

/// What is kept of the votes of a round, to be held against what an instructor says of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Testimony {
    totals: Vec<f64>,
    voices: f64,
    singles: Vec<Vec<f64>>,
    /// The gestures that any of the robots had been taught, over which the others are.
    taught: Vec<ClassId>,
}

impl Testimony {
    /// That of the votes that a decision rests on, or a round without one: `None` where nobody gave any.
    #[must_use]
    pub fn of(decision: &Decision, clip: f64) -> Option<Self> {
        let votes = || decision.certificate.votes.iter().map(|counted| &counted.vote);
        let columns = Columns::of(decision.certificate.listed(), votes());
        let rows = Rows::of(&columns, clip, votes());
        let taught: Vec<ClassId> =
            rows.taught().into_iter().filter_map(|place| columns.class(place)).collect();
        let mut totals = vec![0.0; taught.len()];
        let mut strengths = Vec::with_capacity(decision.certificate.votes.len());
        let mut singles = Vec::new();
        for row in rows.of_taught().rows() {
            let mut clipped = vec![0.0; taught.len()];
            clip_into(&mut clipped, row, clip);
            totals.iter_mut().zip(&clipped).for_each(|(total, part)| *total += part);
            strengths.push(strength(&clipped));
            if singles.len() < MAX_SINGLES {
                singles.push(clipped);
            }
        }
        (!singles.is_empty()).then(|| Self { totals, voices: voices(strengths.into_iter()), singles, taught })
    }

    /// How likely each likeness and temperature makes it that one of the possible gestures was shown, of those that any robot had been taught. `None`
    /// where there are none: what it could not have known says nothing of how robots err; and where there is nothing to choose from.
    #[must_use]
    pub fn weigh(&self, possible: &dyn Fn(ClassId) -> bool) -> Option<Weights> {
        let possible = |place: usize| self.taught.get(place).is_some_and(|class| possible(*class));
        if self.taught.len() < 2 || !(0..self.taught.len()).any(possible) {
            return None;
        }
        let mut weights = Vec::with_capacity(grid().count());
        for exponent in 0..TEMPERATURES {
            let temperature = temperature(exponent);
            let of_one = |row: &Vec<f64>| log_likelihood(row, 1.0 / temperature, &possible);
            let singles = self.singles.iter().map(of_one).sum::<f64>() / self.singles.len() as f64;
            for step in 0..=STEPS {
                let pool = Pool { likeness: likeness(step), temperature, rounds: 0 };
                let together = log_likelihood(&self.totals, sharpness(pool, self.voices), &possible);
                weights.push(together + SINGLES * singles);
            }
        }
        Some(Weights(weights))
    }
}

/// What a round says for each likeness and temperature of the grid: a logarithm.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights(Vec<f64>);

/// The likeliest likeness and temperature, given what rounds say, the oldest first. The same rounds in the same order give the same.
///
/// It maximises Σ log P(shown | pool) + .3 Σ mean log P(shown | robot) + a Gaussian prior around [`Pool::PRIOR`], on a grid: without the prior
/// twenty rounds without a mistake would be proof of any certainty.
pub fn fit<'a>(rounds: impl Iterator<Item = &'a Weights>) -> Pool {
    let mut said = vec![0.0; grid().count()];
    let mut known = 0_u16;
    for Weights(weights) in rounds {
        said.iter_mut().zip(weights).for_each(|(said, weight)| *said = FADES * *said + weight);
        known = known.saturating_add(1);
    }
    if known == 0 {
        return Pool::PRIOR;
    }
    let posterior = grid().zip(said).map(|(pool, said)| (pool, said + prior(pool)));
    let best = posterior.fold(None, |best: Option<(Pool, f64)>, (pool, total)| match best {
        Some((_, greatest)) if greatest >= total => best,
        _ => Some((pool, total)),
    });
    best.map_or(Pool::PRIOR, |(pool, _)| Pool { rounds: known, ..pool })
}

/// All pools among which one is chosen. In steps that a text holds exactly, so that whoever reads a certificate has the same numbers.
fn grid() -> impl Iterator<Item = Pool> {
    (0..TEMPERATURES).flat_map(|exponent| {
        let temperature = temperature(exponent);
        (0..=STEPS).map(move |step| Pool { likeness: likeness(step), temperature, rounds: 0 })
    })
}

fn temperature(exponent: i32) -> f64 {
    (LEAST * RATIO.powi(exponent) * 100.0).round() / 100.0
}

fn likeness(step: i32) -> f64 {
    f64::from(step) / f64::from(STEPS)
}

fn prior(pool: Pool) -> f64 {
    let temperature = (pool.temperature / Pool::PRIOR.temperature).ln() / SPREAD.0;
    let likeness = (pool.likeness - Pool::PRIOR.likeness) / SPREAD.1;
    -0.5 * (temperature * temperature + likeness * likeness)
}

fn log_likelihood(totals: &[f64], sharpness: f64, possible: &dyn Fn(usize) -> bool) -> f64 {
    let mut row: Vec<f64> = totals.iter().map(|total| sharpness * total).collect();
    softmax(&mut row);
    let heard = || row.iter().enumerate().filter(|(class, _)| possible(*class));
    let likely: f64 = heard().map(|(_, p)| p).sum();
    // A wrong word is about any gestures, as many as this one is about.
    let slipped = heard().count() as f64 / totals.len() as f64;
    ((1.0 - SLIP) * likely + SLIP * slipped).ln()
}
