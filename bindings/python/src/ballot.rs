//! Votes, and what they amount to.

use gestalt_protocol::{FusionRule, HeldVote, MAX_CLASSES, RobotId, RoundId, Stamp, Vote};
use gestalt_rounds::Cast;
use gestalt_strategies::fusion::{self, Fusion};
use gestalt_strategies::{Ballot as Votes, Vocabulary};
use pyo3::prelude::*;

use crate::errors::{data, settings};

/// Probabilities, the likeliest class, and by how much it leads.
type Fused = (Vec<f64>, u32, f64);

fn fused(Fusion { probabilities, top, margin }: Fusion) -> Fused {
    (probabilities, top.0, margin)
}

fn rule_of(name: &str) -> PyResult<FusionRule> {
    let named = FusionRule::ALL.into_iter().find(|rule| rule.name() == name);
    named.ok_or_else(|| {
        let known = FusionRule::ALL.map(|rule| rule.name().to_owned()).join(", ");
        settings(format!("'{name}' is no fusion rule: take one of {known}"))
    })
}

fn check_clip(clip: f64) -> PyResult<()> {
    if clip > 0.0 && clip <= 1000.0 {
        return Ok(());
    }
    Err(settings(format!("clip is {clip}: choose it above 0 and at most 1000 nats, for example 6")))
}

/// Fuses one row of centred log-evidence per robot; `None` when they say nothing.
#[pyfunction]
pub(crate) fn fuse(rule: &str, votes: Vec<Vec<f32>>, clip: f64) -> PyResult<Option<Fused>> {
    let rule = rule_of(rule)?;
    check_clip(clip)?;
    let classes = votes.first().map_or(2, Vec::len);
    if !(2..=MAX_CLASSES).contains(&classes) || votes.iter().any(|vote| vote.len() != classes) {
        return Err(data(format!("votes are rows of one length, from 2 to {MAX_CLASSES} classes")));
    }
    if !votes.iter().flatten().all(|evidence| evidence.is_finite()) {
        return Err(data("evidence that is not finite"));
    }
    Ok(fusion::fuse(rule, clip, classes, votes.iter().map(Vec::as_slice)).map(fused))
}

/// The latest vote of each robot in one round.
#[pyclass(module = "gestalt_swarm._native")]
pub(crate) struct Ballot {
    vocabulary: Vocabulary,
    votes: Votes,
}

#[pymethods]
impl Ballot {
    #[new]
    fn new(labels: Vec<String>) -> PyResult<Self> {
        let vocabulary = Vocabulary::new(labels).map_err(settings)?;
        Ok(Self { vocabulary, votes: Votes::default() })
    }

    /// Puts a vote in, if it is the latest of its robot: `counted`, `known` or `full`. No evidence is a null vote.
    fn cast(
        &mut self,
        robot: u32,
        stamp: (u32, u32),
        evidence: Vec<f32>,
        looks: f32,
    ) -> PyResult<&'static str> {
        if !evidence.is_empty() && evidence.len() != self.vocabulary.classes() {
            return Err(data(format!(
                "evidence for {} classes, the vocabulary has {}",
                evidence.len(),
                self.vocabulary.classes()
            )));
        }
        let round = RoundId { counter: 1, opener: RobotId(0), life: 0 };
        let vote =
            Vote { round, vocabulary: self.vocabulary.id(), evidence, looks, unknown: None, named: vec![] };
        vote.check().map_err(data)?;
        let (boot, sequence) = stamp;
        let stamp = Stamp { boot, sequence };
        let cast = self.votes.cast(HeldVote { robot: RobotId(robot), stamp, vote, signature: None });
        Ok(match cast {
            Cast::Counted => "counted",
            Cast::Known => "known",
            Cast::Full => "full",
        })
    }

    /// All evidence as one distribution; `None` when there is none.
    fn fuse(&self, rule: &str, clip: f64) -> PyResult<Option<Fused>> {
        let rule = rule_of(rule)?;
        check_clip(clip)?;
        let Some(scale) = self.votes.prevailing_scale() else { return Ok(None) };
        Ok(self.votes.fuse(&rule, clip, scale).map(fused))
    }

    fn __len__(&self) -> usize {
        self.votes.len()
    }
}
