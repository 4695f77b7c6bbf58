//! What a round came to, and why.

use gestalt_protocol::{Certificate, ClassId, Decision, Reason, RoundOutcome};

use crate::columns::Columns;
use crate::config::RoundsConfig;
use crate::fusion::top_of;
use crate::rows::knows;

/// What a round came to, and why: from its decision alone, which may be one for nothing. Says the same to whoever asks.
#[must_use]
pub fn outcome(decision: &Decision, config: &RoundsConfig) -> (RoundOutcome, Reason) {
    if decision.class.is_some() {
        return (RoundOutcome::Gesture, Reason::Sure);
    }
    let certificate = &decision.certificate;
    let Certificate { probabilities, votes, robots, .. } = certificate;
    let needed = certificate.quorum;
    let contributors = votes.iter().map(|counted| counted.robot);
    let reached = contributors.clone().chain(certificate.others.iter().map(|held| held.robot));
    let counted = match config.suffice_of(decision.round.counter, reached, contributors, *robots) {
        true => None,
        false if config.liars > 0 => Some(votes.len()),
        false => Some(certificate.reached()),
    };
    let undecided = |reason| (RoundOutcome::Undecided, reason);
    if let Some(counted) = counted {
        let counted = u32::try_from(counted).unwrap_or(u32::MAX);
        return undecided(Reason::TooFewRobots { counted, needed });
    }
    if votes.is_empty() || probabilities.is_empty() {
        return undecided(Reason::NothingSeen);
    }
    let votes_of = || certificate.votes.iter().map(|counted| &counted.vote);
    let columns = Columns::of_certificate(certificate);
    let taught: Vec<bool> =
        columns.classes().map(|class| votes_of().any(|vote| knows(vote, class))).collect();
    // A gesture of the list that nobody was taught is as unknown as one that is not on it.
    let unknown: f64 = certificate.unknown.unwrap_or(0.0)
        + taught.iter().zip(probabilities).filter(|(taught, _)| !**taught).map(|(_, p)| p).sum::<f64>();
    let likely = |class: usize| if taught[class] { probabilities[class] } else { 0.0 };
    let by_class: Vec<f64> = (0..probabilities.len()).map(likely).collect();
    let place = top_of(&by_class).index();
    let (nearest, probability) = (columns.class(place).unwrap_or(ClassId(0)), by_class[place]);
    if certificate.unknown.is_some() && config.convinces(unknown) {
        let nats = (unknown.max(f64::MIN_POSITIVE) / probability.max(1e-9)).ln();
        return (RoundOutcome::Unknown, Reason::FarFromAll { nearest, nats });
    }
    match rivals(certificate) {
        Some((between, robots)) => undecided(Reason::Disagreement { between, robots }),
        None => undecided(Reason::Unsure { nearest, probability }),
    }
}

/// The two gestures that most robots find likeliest, where at least two gestures have a robot for them, with how many; of equals the likelier.
fn rivals(certificate: &Certificate) -> Option<([ClassId; 2], [u32; 2])> {
    let mut robots = vec![0_u32; certificate.probabilities.len()];
    for counted in &certificate.votes {
        if counted.vote.unknown.is_none_or(|unknown| counted.vote.evidence.iter().any(|e| *e > unknown))
            && let Some(count) = certificate.place(counted.class).and_then(|place| robots.get_mut(place))
        {
            *count += 1;
        }
    }
    let mut order: Vec<usize> = (0..robots.len()).filter(|class| robots[*class] > 0).collect();
    let probabilities = &certificate.probabilities;
    order.sort_by(|a, b| robots[*b].cmp(&robots[*a]).then(probabilities[*b].total_cmp(&probabilities[*a])));
    let [first, second, ..] = order[..] else { return None };
    let columns = Columns::of_certificate(certificate);
    Some(([columns.class(first)?, columns.class(second)?], [robots[first], robots[second]]))
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{
        CountedVote, FusionRule, HeldVote, Pool, RobotId, RoundId, Stamp, Terms, VocabularyId, Vote,
    };

    use super::*;
    use crate::ballot::{Ballot, Scale};

    const SCALE: Scale = Scale { vocabulary: VocabularyId(1), classes: 3 };

    /// What comes of these votes, if nothing was decided.
    fn of(votes: &[([f32; 3], Option<f32>)], robots: u32, blind: u32) -> (RoundOutcome, Reason) {
        let round = RoundId { counter: 1, opener: RobotId(1), life: 0 };
        let config = RoundsConfig::default();
        let mut ballot = Ballot::default();
        for (robot, (evidence, unknown)) in (0..).zip(votes) {
            let (vocabulary, evidence) = (SCALE.vocabulary, evidence.to_vec());
            let vote = Vote { round, vocabulary, evidence, looks: 1.0, unknown: *unknown, named: vec![] };
            ballot.cast(HeldVote { robot: RobotId(robot), stamp: Stamp::default(), vote, signature: None });
        }
        let fusion = ballot.fuse(&config.rule, config.clip, SCALE);
        let mut probabilities = fusion.map_or(Vec::new(), |fusion| fusion.probabilities);
        let unknown = if probabilities.len() > 3 { probabilities.pop() } else { None };
        let nothing = |robot| HeldVote {
            robot: RobotId(100 + robot),
            stamp: Stamp::default(),
            vote: Vote {
                round,
                vocabulary: VocabularyId::NONE,
                evidence: vec![],
                looks: 0.0,
                unknown: None,
                named: vec![],
            },
            signature: None,
        };
        let votes: Vec<CountedVote> = ballot.counted(&config.rule, config.clip, SCALE);
        let certificate = Certificate {
            vocabulary: SCALE.vocabulary,
            rule: FusionRule::CorrelatedPool,
            pool: Some(Pool::PRIOR),
            probabilities,
            unknown,
            votes,
            others: (0..blind).map(nothing).collect(),
            robots,
            quorum: config.needs(robots),
            elapsed_ms: 5000,
            named: vec![],
            terms: Terms::default(),
        };
        let author = RobotId(1);
        let none = Decision { round, class: None, confidence: 0.5, author, is_final: true, certificate };
        outcome(&none, &config)
    }

    #[test]
    fn what_was_decided_is_a_gesture() {
        let round = RoundId { counter: 1, opener: RobotId(1), life: 0 };
        let certificate = Certificate {
            vocabulary: SCALE.vocabulary,
            rule: FusionRule::Majority,
            pool: None,
            probabilities: vec![1.0, 0.0],
            unknown: None,
            votes: vec![],
            others: vec![],
            robots: 1,
            quorum: 1,
            elapsed_ms: 9,
            named: vec![],
            terms: Terms::default(),
        };
        let class = Some(ClassId(0));
        let made =
            Decision { round, class, confidence: 1.0, author: RobotId(1), is_final: true, certificate };
        assert_eq!(outcome(&made, &RoundsConfig::default()), (RoundOutcome::Gesture, Reason::Sure));
    }

    #[test]
    fn far_from_all_gestures_is_unknown_and_says_how_far() {
        let far = ([1.0, -0.5, -0.5], Some(6.0));
        let (outcome, reason) = of(&[far; 3], 3, 0);
        let Reason::FarFromAll { nearest, nats } = reason else { panic!("{reason:?}") };
        assert_eq!((outcome, nearest), (RoundOutcome::Unknown, ClassId(0)));
        assert!(nats > 3.0, "{nats}");
    }

    #[test]
    fn a_gesture_of_the_list_that_nobody_was_taught_is_unknown() {
        // As likely as unknown, to the bit, at every robot.
        let untaught = ([-2.0, 4.0, -2.0], Some(4.0));
        let (outcome, reason) = of(&[untaught; 4], 4, 0);
        assert_eq!(outcome, RoundOutcome::Unknown);
        assert!(matches!(reason, Reason::FarFromAll { nearest: ClassId(0), .. }), "{reason:?}");
    }

    #[test]
    fn robots_that_disagree_are_counted() {
        let (a, b) = (([3.0, -1.5, -1.5], None), ([-1.5, 3.0, -1.5], None));
        let expected = Reason::Disagreement { between: [ClassId(0), ClassId(1)], robots: [2, 1] };
        assert_eq!(of(&[a, b, a], 3, 0), (RoundOutcome::Undecided, expected));
    }

    #[test]
    fn too_few_too_blind_and_too_unsure_are_told_apart() {
        let weak = ([0.4, -0.2, -0.2], None);
        let few = Reason::TooFewRobots { counted: 2, needed: 6 };
        assert_eq!(of(&[weak; 2], 10, 0), (RoundOutcome::Undecided, few));
        assert_eq!(of(&[], 3, 3), (RoundOutcome::Undecided, Reason::NothingSeen));
        let (outcome, reason) = of(&[weak; 2], 2, 0);
        assert_eq!(outcome, RoundOutcome::Undecided);
        assert!(matches!(reason, Reason::Unsure { nearest: ClassId(0), .. }), "{reason:?}");
    }
}
