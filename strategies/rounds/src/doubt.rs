//! How unsure a swarm was of what it was shown, by the votes of the round alone: whoever has them finds the same.

use gestalt_protocol::{Certificate, ClassId, Vote};

use crate::fusion::{clip_into, softmax};
use crate::rows::knows;

/// What the votes of a round leave open.
///
/// Outcomes are the gestures that any of the robots was taught, and one for all else: a gesture nobody was taught, or none.
#[derive(Clone, Debug, PartialEq)]
pub struct Doubt {
    /// H of the pooled opinion over these outcomes, in nats: how unsure the swarm is.
    pub entropy: f64,
    /// H over the gestures alone, if it is one of those that were taught, in nats: how unsure the swarm is which of them.
    pub among_gestures: f64,
    /// H(mean of p) − mean of H(p) over the robots' own opinions p, in nats: the Jensen-Shannon divergence. It is high where robots see different
    /// things, as for a committee (BALD; Houlsby et al. 2011), and nothing where each is as unsure as all.
    pub disagreement: f64,
    /// How likely it is something that nobody was taught, `0.0..=1.0`.
    pub unknown: f64,
    /// The gestures that any of the robots was taught, the likelier first; of equals the smaller.
    pub gestures: Vec<ClassId>,
}

impl Doubt {
    /// That of the votes that a decision, or the want of one, rests on; evidence counts up to ±`clip`, as in their fusion. `None` where nobody saw
    /// anything.
    #[must_use]
    pub fn of(certificate: &Certificate, clip: f64) -> Option<Self> {
        let Certificate { probabilities, unknown, votes, .. } = certificate;
        if votes.is_empty() || probabilities.is_empty() {
            return None;
        }
        let votes = || votes.iter().map(|counted| &counted.vote);
        let mut taught: Vec<(ClassId, f64)> = certificate
            .classes()
            .zip(probabilities)
            .filter(|(class, _)| votes().any(|vote| knows(vote, *class)))
            .map(|(class, p)| (class, *p))
            .collect();
        taught.sort_by(|(a, of_a), (b, of_b)| of_b.total_cmp(of_a).then(a.cmp(b)));
        let known: f64 = taught.iter().map(|(_, p)| p).sum();
        let rest = (1.0 - known).clamp(0.0, 1.0);
        let pooled: Vec<f64> = taught.iter().map(|(_, p)| *p).chain([rest]).collect();
        let among: Vec<f64> = taught.iter().map(|(_, p)| p / known.max(f64::MIN_POSITIVE)).collect();
        let gestures: Vec<ClassId> = taught.into_iter().map(|(class, _)| class).collect();

        let untaught = probabilities.len() - gestures.len();
        let tells = unknown.is_some();
        let opinions = votes().filter(|vote| !tells || vote.unknown.is_some());
        let opinions: Vec<Vec<f64>> = opinions.map(|vote| opinion(vote, &gestures, untaught, clip)).collect();
        Some(Self {
            entropy: entropy(&pooled),
            among_gestures: entropy(&among),
            disagreement: divergence(&opinions),
            unknown: if tells || untaught > 0 { rest } else { 0.0 },
            gestures,
        })
    }
}

/// What that robot alone believes, over these gestures and, where it tells, all else.
fn opinion(vote: &Vote, gestures: &[ClassId], untaught: usize, clip: f64) -> Vec<f64> {
    let for_others = vote.unknown.unwrap_or(0.0);
    let said = gestures.iter().map(|class| vote.evidence_for(*class).unwrap_or(for_others));
    let said: Vec<f32> = said.chain(vote.unknown).collect();
    let mut row = vec![0.0; said.len()];
    clip_into(&mut row, &said, clip);
    if vote.unknown.is_some()
        && let Some(rest) = row.last_mut()
    {
        // "Unknown" and each gesture that nobody was taught are as likely.
        *rest += (untaught as f64 + 1.0).ln();
    }
    softmax(&mut row);
    row
}

/// H in nats.
fn entropy(p: &[f64]) -> f64 {
    p.iter().filter(|p| **p > 0.0).map(|p| -p * p.ln()).sum::<f64>().max(0.0)
}

/// H of the mean less the mean of H.
fn divergence(opinions: &[Vec<f64>]) -> f64 {
    let Some(outcomes) = opinions.first().map(Vec::len) else { return 0.0 };
    let robots = opinions.len() as f64;
    let mean = |k: usize| opinions.iter().filter_map(|p| p.get(k)).sum::<f64>() / robots;
    let mean: Vec<f64> = (0..outcomes).map(mean).collect();
    let own = opinions.iter().map(|p| entropy(p)).sum::<f64>() / robots;
    (entropy(&mean) - own).max(0.0)
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{
        CountedVote, FusionRule, HeldVote, Pool, RobotId, RoundId, Stamp, Terms, VocabularyId, Vote,
    };
    use proptest::prelude::*;

    use super::*;
    use crate::ballot::{Ballot, Scale};

    const CLIP: f64 = 6.0;
    const SCALE: Scale = Scale { vocabulary: VocabularyId(1), classes: 3 };

    /// What a swarm that says this has of a certificate.
    fn certificate(votes: &[([f32; 3], Option<f32>)]) -> Certificate {
        let round = RoundId { counter: 1, opener: RobotId(1), life: 0 };
        let mut ballot = Ballot::default();
        for (robot, (evidence, unknown)) in (0..).zip(votes) {
            let (vocabulary, evidence) = (SCALE.vocabulary, evidence.to_vec());
            let vote = Vote { round, vocabulary, evidence, looks: 1.0, unknown: *unknown, named: vec![] };
            ballot.cast(HeldVote { robot: RobotId(robot), stamp: Stamp::default(), vote, signature: None });
        }
        let rule = FusionRule::LogPool;
        let fusion = ballot.fuse(&rule, CLIP, SCALE);
        let mut probabilities = fusion.map_or(Vec::new(), |fusion| fusion.probabilities);
        let unknown = if probabilities.len() > 3 { probabilities.pop() } else { None };
        let votes: Vec<CountedVote> = ballot.counted(&rule, CLIP, SCALE);
        Certificate {
            vocabulary: SCALE.vocabulary,
            rule,
            pool: Some(Pool::PRIOR),
            probabilities,
            unknown,
            votes,
            others: vec![],
            robots: 3,
            quorum: 2,
            elapsed_ms: 5000,
            named: vec![],
            terms: Terms::default(),
        }
    }

    fn doubt(votes: &[([f32; 3], Option<f32>)]) -> Doubt {
        Doubt::of(&certificate(votes), CLIP).unwrap()
    }

    #[test]
    fn who_is_sure_has_no_doubt() {
        let sure = doubt(&[([6.0, -6.0, -6.0], None); 3]);
        assert!(sure.entropy < 1e-6 && sure.disagreement < 1e-6 && sure.unknown == 0.0, "{sure:?}");
        assert_eq!(sure.gestures, [ClassId(0), ClassId(1), ClassId(2)]);
    }

    #[test]
    fn robots_that_see_different_gestures_disagree_and_those_that_cannot_tell_do_not() {
        let split = doubt(&[([6.0, -6.0, -6.0], None), ([-6.0, 6.0, -6.0], None)]);
        assert!((split.disagreement - 2f64.ln()).abs() < 1e-3, "{split:?}");
        assert!((split.entropy - 2f64.ln()).abs() < 1e-3, "{split:?}");
        let alike = doubt(&[([0.5, 0.5, -6.0], None); 2]);
        assert!(alike.entropy > 0.6 && alike.disagreement < 1e-9, "{alike:?}");
    }

    #[test]
    fn gestures_that_nobody_was_taught_and_unknown_are_one_outcome() {
        // Only the first was taught; the two others and "unknown" are as likely, to the bit.
        let one = doubt(&[([2.0, 2.0, 0.0], Some(2.0)); 2]);
        assert_eq!(one.gestures, [ClassId(2)]);
        let rest = 3.0 * 2f64.exp() / (3.0 * 2f64.exp() + 1.0);
        assert!((one.unknown - rest).abs() < 1e-9, "{one:?}");
        let h = -rest * rest.ln() - (1.0 - rest) * (1.0 - rest).ln();
        assert!((one.entropy - h).abs() < 1e-9, "{one:?}");
        assert!(one.disagreement < 1e-9 && one.among_gestures == 0.0, "{one:?}");
    }

    #[test]
    fn where_nobody_saw_anything_there_is_nothing_to_doubt() {
        assert_eq!(Doubt::of(&certificate(&[]), CLIP), None);
    }

    proptest! {
        #[test]
        fn both_are_within_what_the_outcomes_allow(
            rows in prop::collection::vec((prop::array::uniform3(-9f32..9.0), prop::option::of(-9f32..9.0)), 1..9)
        ) {
            let doubt = doubt(&rows);
            let most = (doubt.gestures.len() as f64 + 1.0).ln() + 1e-9;
            prop_assert!((0.0..=most).contains(&doubt.entropy), "{doubt:?}");
            prop_assert!((0.0..=most).contains(&doubt.disagreement), "{doubt:?}");
            prop_assert!((0.0..=most).contains(&doubt.among_gestures), "{doubt:?}");
            prop_assert!((0.0..=1.0).contains(&doubt.unknown), "{doubt:?}");
        }
    }
}
