//! What rounds were about that instructors have spoken of: from them it follows how alike the robots are.

use std::collections::BTreeMap;
use std::sync::Arc;

use gestalt_protocol::{Pool, RoundId};
use gestalt_rounds::{Testimony, fit};

use super::shelf::Shelf;
use super::weighed::Weighed;
use crate::lessons::Verdict;

/// How many rounds are kept, the newest: classifiers learn, and what they said long ago tells little of them.
const MAX_ROUNDS: usize = 64;

/// The votes of rounds, and what follows from them and from what instructors said. Every robot that lived through the same rounds holds the same
/// decisions of them and has heard the same words, so it finds the same.
#[derive(Clone, Debug, Default)]
pub(super) struct JudgedRounds {
    rounds: BTreeMap<RoundId, Judged>,
    pool: Option<Pool>,
}

#[derive(Clone, Debug)]
struct Judged {
    testimony: Arc<Testimony>,
    weighed: Option<Arc<Weighed>>,
}

impl JudgedRounds {
    /// Notes the votes of a round as the decision held of it has them. `names`: all that the round has. What was held under another one counts no more:
    /// one showing would weigh double.
    pub fn note(&mut self, round: RoundId, names: impl Iterator<Item = RoundId>, testimony: Arc<Testimony>) {
        for other in names.filter(|name| *name != round) {
            if self.rounds.remove(&other).is_some() {
                self.pool = None;
            }
        }
        let known = self.rounds.get(&round).is_some_and(|judged| judged.testimony == testimony);
        if known {
            return;
        }
        self.rounds.insert(round, Judged { testimony, weighed: None });
        while self.rounds.len() > MAX_ROUNDS {
            self.rounds.pop_first();
        }
        self.pool = None;
    }

    /// Something was said of some round.
    pub fn doubt(&mut self) {
        self.pool = None;
    }

    /// How alike the robots are, given what instructors said of each round. What that says is on the shelf where another robot has found it.
    pub fn pool(&mut self, shelf: &Shelf, verdict: impl Fn(RoundId) -> Verdict) -> Pool {
        if let Some(pool) = self.pool {
            return pool;
        }
        for (round, Judged { testimony, weighed }) in &mut self.rounds {
            let verdict = verdict(*round);
            if !weighed.as_ref().is_some_and(|weighed| weighed.is_of(testimony, &verdict)) {
                *weighed = shelf.weighed(*round, testimony, verdict);
            }
        }
        let weighed = self.rounds.values().filter_map(|judged| judged.weighed.as_ref()?.weights());
        *self.pool.insert(fit(weighed))
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{
        Certificate, ClassId, CountedVote, Decision, FusionRule, RobotId, Stamp, Terms, VocabularyId, Vote,
    };

    use super::*;

    /// Five robots that are all sure of that gesture.
    fn testimony(class: usize) -> Arc<Testimony> {
        let round = RoundId { counter: 1, opener: RobotId(0), life: 0 };
        let evidence: Vec<f32> = (0..3).map(|k| if k == class { 4.0 } else { -2.0 }).collect();
        let vocabulary = VocabularyId(1);
        let vote = |robot| CountedVote {
            robot: RobotId(robot),
            stamp: Stamp::default(),
            class: ClassId(class as u32),
            weight: 1.0,
            vote: Vote {
                round,
                vocabulary,
                evidence: evidence.clone(),
                looks: 1.0,
                unknown: None,
                named: vec![],
            },
            signature: None,
        };
        let certificate = Certificate {
            vocabulary,
            rule: FusionRule::CorrelatedPool,
            pool: Some(Pool::PRIOR),
            probabilities: vec![1.0 / 3.0; 3],
            unknown: None,
            votes: (0..5).map(vote).collect(),
            others: Vec::new(),
            robots: 5,
            quorum: 3,
            elapsed_ms: 1,
            named: vec![],
            terms: Terms::default(),
        };
        let author = RobotId(0);
        let decision = Decision { round, class: None, confidence: 0.0, author, is_final: false, certificate };
        Testimony::of(&decision, 6.0).unwrap().into()
    }

    fn round(counter: u32) -> RoundId {
        RoundId { counter, opener: RobotId(0), life: 0 }
    }

    /// A round of one name.
    fn alone() -> std::iter::Empty<RoundId> {
        std::iter::empty()
    }

    #[test]
    fn a_round_counts_once_under_whichever_of_its_names_it_was_decided() {
        let (shelf, mut judged) = (Shelf::default(), JudgedRounds::default());
        let name = |opener| RoundId { opener: RobotId(opener), ..round(1) };
        judged.note(name(3), alone(), testimony(0));
        assert_eq!(judged.pool(&shelf, |_| Verdict::Class(ClassId(0))).rounds, 1);
        judged.note(name(1), [name(1), name(3)].into_iter(), testimony(0));
        assert_eq!(judged.pool(&shelf, |_| Verdict::Class(ClassId(0))).rounds, 1);
        assert_eq!(judged.rounds.keys().collect::<Vec<_>>(), [&name(1)]);
    }

    #[test]
    fn the_same_rounds_and_words_give_the_same_pool_in_any_order_and_words_taken_back_no_longer_count() {
        let was = |class: u32| Verdict::Class(ClassId(class));
        // Of thirty rounds every third was another gesture than all five robots were sure of.
        let verdict = |round: RoundId| if round.counter.is_multiple_of(3) { was(1) } else { was(0) };
        let (shelf, mut heard) = (Shelf::default(), JudgedRounds::default());
        assert_eq!(heard.pool(&shelf, verdict), Pool::PRIOR);
        (0..30).for_each(|n| heard.note(round(n), alone(), testimony(0)));
        assert_eq!(heard.pool(&shelf, |_| Verdict::Unsaid), Pool::PRIOR, "nobody said what they were");
        heard.doubt();
        let pool = heard.pool(&shelf, verdict);
        assert_eq!(pool.rounds, 30);
        assert!(
            pool.likeness > Pool::PRIOR.likeness && pool.temperature > Pool::PRIOR.temperature,
            "{pool:?}"
        );

        let mut turned = JudgedRounds::default();
        (0..30).rev().chain(5..10).for_each(|n| turned.note(round(n), alone(), testimony(0)));
        turned.doubt();
        assert_eq!(turned.pool(&shelf, verdict), pool);
        heard.doubt();
        assert_eq!(heard.pool(&shelf, |_| Verdict::Retracted), Pool::PRIOR);
    }

    #[test]
    fn what_is_kept_is_bounded_and_the_newest() {
        let mut judged = JudgedRounds::default();
        (0..3 * MAX_ROUNDS as u32).for_each(|n| judged.note(round(n), alone(), testimony(0)));
        assert_eq!(judged.rounds.len(), MAX_ROUNDS);
        assert_eq!(judged.rounds.keys().next(), Some(&round(2 * MAX_ROUNDS as u32)));
    }
}
