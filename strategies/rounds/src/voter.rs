//! The least a robot can be whose pictures are looked at elsewhere: it sees and votes; another mind decides.

use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{Envelope, Holding, Message, RobotId, RoundId, Stamp};

use crate::classify::Classify;
use crate::config::{RoundsConfig, RoundsConfigError};
use crate::observation::Observation;
use crate::round::{Round, Speaker};
use crate::sign::Sign;

/// Turns what a robot sees into that robot's votes, as its own mind would. The rounds are those of another mind, which
/// tells when one opens and closes.
///
/// Time is an argument, the duration since any fixed moment, the same for all calls; it never runs back.
#[derive(Debug)]
pub struct Voter {
    me: RobotId,
    config: RoundsConfig,
    classifier: Option<Arc<dyn Classify>>,
    /// The stamp of the last vote said.
    stamp: Stamp,
    round: Option<Round>,
    blind: bool,
    signer: Option<Arc<dyn Sign>>,
    /// What it said last that it holds.
    held: Option<Holding>,
}

impl Voter {
    /// A voter in the name of robot `me`; `boot` must grow with each start, or its votes are taken for old ones.
    ///
    /// # Errors
    /// [`RoundsConfigError`] for a configuration that [`RoundsConfig::validate`] refuses.
    pub fn new(me: RobotId, boot: u32, config: RoundsConfig) -> Result<Self, RoundsConfigError> {
        config.validate()?;
        Ok(Self {
            me,
            config,
            classifier: None,
            stamp: Stamp { boot, sequence: 0 },
            round: None,
            blind: false,
            signer: None,
            held: None,
        })
    }

    /// The same voter, that signs its votes.
    #[must_use]
    pub fn signed_by(mut self, signer: Arc<dyn Sign>) -> Self {
        self.signer = Some(signer);
        self
    }

    /// It votes in that round from now on; an older one is over.
    pub fn opened(&mut self, now: Duration, round: RoundId) {
        let known = self.round.as_ref().is_some_and(|known| known.open && known.id.counter == round.counter);
        if !known {
            self.round = Some(Round::new(round, now, true));
        }
    }

    /// No round is open any more.
    pub fn closed(&mut self) {
        self.round = None;
    }

    /// The round it votes in.
    #[must_use]
    pub fn round(&self) -> Option<RoundId> {
        self.round.as_ref().map(|round| round.id)
    }

    /// A classifier takes the place of the old one; what was judged by another vocabulary is forgotten.
    pub fn learned(&mut self, classifier: Arc<dyn Classify>) {
        let before = self.classifier.as_ref().map(|old| old.vocabulary());
        if let Some(round) = self.round.as_mut().filter(|_| before != Some(classifier.vocabulary())) {
            round.look_afresh();
        }
        self.classifier = Some(classifier);
    }

    /// Whether the robot's camera shows anything at all. One that is blind says that it need not be waited for.
    pub fn blind(&mut self, blind: bool) {
        if self.blind != blind
            && let Some(round) = &mut self.round
        {
            round.outdate();
        }
        self.blind = blind;
    }

    /// A frame showed a hand. `false` when a round is open and the frame could not be judged: there is no classifier, or
    /// it refused, or gave no distribution.
    pub fn observed(&mut self, now: Duration, observation: &Observation) -> bool {
        match (&mut self.round, &self.classifier) {
            (None, _) => true,
            (Some(_), None) => false,
            (Some(round), Some(classifier)) => round.observe(now, observation, &**classifier, &self.config),
        }
    }

    /// The vote to be said now, if one is due.
    pub fn speak(&mut self, now: Duration) -> Option<Envelope> {
        let vocabulary = self.classifier.as_ref().map(|classifier| classifier.vocabulary());
        let signer = self.signer.as_deref();
        let mut speaker =
            Speaker { me: self.me, stamp: &mut self.stamp, vocabulary, blind: self.blind, signer };
        self.round.as_mut()?.speak(now, &mut speaker, &self.config)
    }

    /// It holds what the other mind says that it holds, and leaves to that one what it does not see: also whether that held another gesture of the round
    /// before, for one that starts again with this robot may have forgotten that. What it says of it, if that is news: that word has to be its own, as its votes have.
    pub fn holds(&mut self, holding: Holding) -> Option<Envelope> {
        let alike = |said: &Holding| {
            let of = |holding: &Holding| (holding.round.counter, holding.class, holding.changed);
            of(said) == of(&holding)
        };
        if self.held.as_ref().is_some_and(alike) {
            return None;
        }
        self.held = Some(holding.clone());
        self.stamp.sequence = self.stamp.sequence.saturating_add(1);
        let message = Message::Holding(holding);
        let said = Envelope { author: self.me, stamp: self.stamp, message, signature: None };
        let signature = self.signer.as_deref().map(|signer| signer.sign(&said.statement()));
        Some(Envelope { signature, ..said })
    }

    /// When to ask it to [`speak`](Voter::speak) again, if nothing else comes before.
    #[must_use]
    pub fn next_wake(&self) -> Option<Duration> {
        self.round.as_ref()?.vote_due(&self.config)
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{ClassId, Message, Rank, VocabularyId, Vote};

    use super::*;
    use crate::classify::ClassifyError;
    use crate::life::Life;
    use crate::machine::{Input, Output, Rounds};
    use crate::vocabulary::Vocabulary;

    /// Says what it is shown.
    #[derive(Debug)]
    struct Echo(Vocabulary);

    impl Classify for Echo {
        fn vocabulary(&self) -> &Vocabulary {
            &self.0
        }

        fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
            Ok(features.iter().map(|p| f64::from(*p)).collect())
        }
    }

    fn echo(labels: [&str; 2]) -> Arc<dyn Classify> {
        Arc::new(Echo(Vocabulary::new(labels).unwrap()))
    }

    fn seen(p: f32) -> Observation {
        Observation { features: vec![p, 1.0 - p], quality: 1.0 }
    }

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn round(counter: u32) -> RoundId {
        RoundId { counter, opener: RobotId(1), life: 0 }
    }

    fn vote(envelope: &Envelope) -> &Vote {
        match &envelope.message {
            Message::Vote(vote) => vote,
            other => panic!("{other:?}"),
        }
    }

    fn voter() -> Voter {
        let mut voter = Voter::new(RobotId(7), 3, RoundsConfig::default()).unwrap();
        voter.learned(echo(["a", "b"]));
        voter
    }

    #[test]
    fn its_votes_are_those_of_a_mind_that_sees_the_same() {
        let mut mind = Rounds::new(RobotId(7), Life { boot: 3, nonce: 7 }, RoundsConfig::default()).unwrap();
        mind.handle(ms(0), Input::Learned(echo(["a", "b"])));
        // Somebody who sees nothing keeps the round open.
        mind.handle(ms(0), Input::Alive(Arc::new([RobotId(1)].into())));
        let mut voter = voter();
        let mut of_mind = Vec::new();
        let mut of_voter = Vec::new();
        for (at, input) in [
            (100, Input::Open),
            (150, Input::Observed(seen(0.8))),
            (300, Input::Tick),
            (350, Input::Tick),
            (600, Input::Observed(seen(0.7))),
            (900, Input::Tick),
        ] {
            if let Input::Observed(observation) = &input {
                assert!(voter.observed(ms(at), observation));
            }
            for output in mind.handle(ms(at), input) {
                match output {
                    Output::Broadcast(envelope) => of_mind.push(envelope),
                    Output::Opened(round) => voter.opened(ms(at), round),
                    _ => {}
                }
            }
            of_voter.extend(voter.speak(ms(at)));
        }
        assert!(of_mind.len() >= 3, "{of_mind:?}");
        assert_eq!(of_mind, of_voter);
    }

    #[test]
    fn it_votes_while_a_round_is_open_and_not_otherwise() {
        let mut voter = voter();
        assert_eq!((voter.speak(ms(0)), voter.next_wake()), (None, None));
        voter.opened(ms(10), round(1));
        let null = voter.speak(ms(10)).unwrap();
        assert!(vote(&null).evidence.is_empty());
        assert!(voter.observed(ms(20), &seen(0.9)));
        assert_eq!(voter.speak(ms(30)), None, "too soon after the last one");
        let due = voter.next_wake().unwrap();
        let second = voter.speak(due).unwrap();
        assert!(vote(&second).evidence[ClassId(0).index()] > 0.0);
        assert!(second.stamp > null.stamp && second.stamp.boot == 3);
        voter.closed();
        assert_eq!((voter.speak(ms(9_000)), voter.next_wake()), (None, None));
    }

    #[test]
    fn it_says_itself_what_its_host_says_and_says_nothing_twice() {
        let mut voter = voter();
        let words = [
            (1, None, false),
            (1, Some(1), false),
            (1, Some(1), false),
            (1, Some(0), true),
            (1, Some(1), false),
            // The host, as this robot, started again since: it may have counted for another.
            (1, Some(1), true),
            (2, Some(1), true),
            (2, Some(0), false),
            (2, Some(0), false),
        ];
        let mut said = Vec::new();
        for (counter, class, changed) in words {
            let rank = Rank { decided: true, robots: 1, looks: 1.0, confidence: 0.9, author: RobotId(1) };
            let holding = Holding { round: round(counter), class: class.map(ClassId), rank, changed };
            let Some(envelope) = voter.holds(holding) else { continue };
            let Message::Holding(holding) = envelope.message else { panic!("{envelope:?}") };
            assert_eq!((envelope.author, envelope.stamp.boot), (RobotId(7), 3));
            assert_eq!(envelope.stamp.sequence as usize, said.len() + 1);
            said.push((holding.round.counter, holding.class.map(|class| class.0), holding.changed));
        }
        let mut expected = words.to_vec();
        expected.dedup();
        assert_eq!(said, expected);
    }

    #[test]
    fn a_new_round_begins_without_the_evidence_of_the_old() {
        let mut voter = voter();
        voter.opened(ms(0), round(1));
        voter.observed(ms(10), &seen(0.9));
        voter.opened(ms(20), round(2));
        let first = voter.speak(ms(20)).unwrap();
        assert_eq!((vote(&first).round, vote(&first).looks), (round(2), 0.0));
        voter.observed(ms(30), &seen(0.9));
        voter.opened(ms(40), RoundId { counter: 2, opener: RobotId(0), life: 0 });
        assert_eq!(vote(&voter.speak(ms(500)).unwrap()).looks, 1.0, "the same round under another opener");
    }

    #[test]
    fn a_blind_one_says_so_at_once() {
        let mut voter = voter();
        voter.opened(ms(0), round(1));
        let null = voter.speak(ms(0)).unwrap();
        assert_ne!(vote(&null).vocabulary, VocabularyId::NONE);
        voter.blind(true);
        assert_eq!(vote(&voter.speak(ms(300)).unwrap()).vocabulary, VocabularyId::NONE);
    }

    #[test]
    fn what_cannot_be_judged_is_said_and_counts_nothing() {
        let mut voter = voter();
        assert!(voter.observed(ms(0), &seen(7.0)), "no round, nothing to judge");
        voter.opened(ms(0), round(1));
        assert!(!voter.observed(ms(10), &seen(7.0)));
        voter.learned(echo(["c", "d"]));
        assert!(voter.observed(ms(20), &seen(0.6)));
        assert_eq!(vote(&voter.speak(ms(300)).unwrap()).looks, 1.0);
    }
}
