//! Draws each recorded decision again from its votes, bit for bit.

use std::collections::BTreeMap;
use std::fmt::Display;

use gestalt_protocol::{Decision, HeldVote, RobotId, RoundId, Stamp};
use gestalt_rounds::RoundsConfig;
use serde::Serialize;
use thiserror::Error;

use crate::count::{ballot, count, scale, votes};
use crate::run::Showing;

/// Where a decision drawn again is first another than the recorded one.
#[derive(Clone, Debug, Error, PartialEq, Eq, Serialize)]
#[error("round {round}: {what} is {recorded}, and drawn again {drawn}{hint}")]
pub struct Difference {
    /// The round.
    pub round: RoundId,
    /// Which part of the decision.
    pub what: String,
    /// What the recording says.
    pub recorded: String,
    /// What comes of its votes.
    pub drawn: String,
    /// What may have led to it, and what to do; empty where nothing is known.
    pub hint: &'static str,
}

/// What all decisions of a run came to when they were drawn again.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Proof {
    /// How many were reproduced bit for bit.
    pub reproduced: u64,
    /// Of each that was not, the first difference.
    pub differences: Vec<Difference>,
    /// Votes in certificates that were recorded as they were cast, word for word.
    pub heard: u64,
    /// Votes in certificates that passed the recorder by: they reached robots on another way, or before it listened.
    pub unheard: u64,
}

const CONFIGURED: &str = ": was it decided by this configuration? --config FILE gives that of its robots";
const PROCESSOR: &str = ": within 1e-9 it is the same decision, made on another kind of processor";
const TWO_VOTES: &str = ": its author lies, or the recording was changed";

/// Draws all decisions announced in these showings again. Each by the fusion rule that it names; the rest as configured.
#[must_use]
pub fn prove(showings: &[Showing], config: &RoundsConfig) -> Proof {
    let mut proof = Proof::default();
    for showing in showings {
        let cast: Cast<'_> = showing.votes.iter().map(|(_, held)| ((held.robot, held.stamp), held)).collect();
        for decision in &showing.announced {
            let drawn = proof.draw(decision, config).and_then(|()| proof.listen(decision, &cast));
            match drawn {
                Ok(()) => proof.reproduced += 1,
                Err(difference) => proof.differences.push(difference),
            }
        }
    }
    proof
}

/// The votes that were heard, by author and stamp.
type Cast<'a> = BTreeMap<(RobotId, Stamp), &'a HeldVote>;

impl Proof {
    /// Draws a decision as its author did.
    fn draw(&self, decision: &Decision, config: &RoundsConfig) -> Result<(), Difference> {
        let certificate = &decision.certificate;
        let config = RoundsConfig { rule: certificate.rule, ..config.clone() };
        let same = Same(decision.round);
        same.check("the quorum", CONFIGURED, certificate.quorum, config.needs(certificate.robots))?;
        let drawn = count(
            &ballot(votes(certificate)),
            scale(certificate),
            certificate.robots,
            &config,
            certificate.pool,
        );
        let probabilities = drawn.fusion.as_ref().map_or(&[][..], |fusion| &fusion.probabilities);
        let recorded: Vec<f64> =
            certificate.probabilities.iter().chain(&certificate.unknown).copied().collect();
        same.check("the number of probabilities", "", recorded.len(), probabilities.len())?;
        for (class, (recorded, drawn)) in recorded.iter().zip(probabilities).enumerate() {
            same.bits(&format!("the probability of class {class}"), *recorded, *drawn)?;
        }
        let confidence = drawn.fusion.as_ref().map_or(0.0, |fusion| fusion.greatest());
        same.bits("the confidence", decision.confidence, confidence)?;
        same.check("the number of votes counted", "", certificate.votes.len(), drawn.counted.len())?;
        for (recorded, drawn) in certificate.votes.iter().zip(&drawn.counted) {
            let of = |what: &str| format!("the {what} of robot {}", recorded.robot);
            same.check(&of("class"), "", recorded.class, drawn.class)?;
            same.bits(&of("weight"), recorded.weight.into(), drawn.weight.into())?;
        }
        let named = |class: Option<_>| class.map_or("none".to_owned(), |class| format!("{class}"));
        same.check("the class", CONFIGURED, named(decision.class), named(drawn.class))
    }

    /// Whether the votes that it rests on are those that were cast.
    fn listen(&mut self, decision: &Decision, cast: &Cast<'_>) -> Result<(), Difference> {
        for held in votes(&decision.certificate) {
            match cast.get(&(held.robot, held.stamp)) {
                None => self.unheard += 1,
                Some(heard) if heard.vote == held.vote => self.heard += 1,
                Some(heard) => {
                    let what =
                        format!("vote {}.{} of robot {}", held.stamp.boot, held.stamp.sequence, held.robot);
                    let words = |held: &HeldVote| format!("{:?}", held.vote);
                    return Same(decision.round).check(&what, TWO_VOTES, words(&held), words(heard));
                }
            }
        }
        Ok(())
    }
}

/// Compares what is recorded of a round with what is drawn again.
struct Same(RoundId);

impl Same {
    fn check<T: Display + PartialEq>(
        &self,
        what: &str,
        hint: &'static str,
        recorded: T,
        drawn: T,
    ) -> Result<(), Difference> {
        if recorded == drawn {
            return Ok(());
        }
        let (recorded, drawn) = (recorded.to_string(), drawn.to_string());
        Err(Difference { round: self.0, what: what.to_owned(), recorded, drawn, hint })
    }

    fn bits(&self, what: &str, recorded: f64, drawn: f64) -> Result<(), Difference> {
        if recorded.to_bits() == drawn.to_bits() {
            return Ok(());
        }
        let hint = if (recorded - drawn).abs() <= 1e-9 { PROCESSOR } else { "" };
        let shown = |value: f64| format!("{value:e} ({:016x})", value.to_bits());
        Err(Difference {
            round: self.0,
            what: what.to_owned(),
            recorded: shown(recorded),
            drawn: shown(drawn),
            hint,
        })
    }
}
