//! How the decisions of one round become one: the greatest wins, and one robot says it aloud.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use gestalt_protocol::{ClassId, Decision, MAX_ROBOTS, Rank, RobotId};

/// What a robot knows of the decisions of one round.
///
/// Hearing commutes and repeats harmlessly: the greatest decision that may be believed is kept, whatever the order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Agreement {
    best: Option<Decision>,
    witnesses: BTreeMap<Option<ClassId>, Witnesses>,
    held: Option<Held>,
    announced: Option<Option<ClassId>>,
}

/// Who was heard holding a class, and the greatest decision for it.
#[derive(Clone, Debug, PartialEq)]
struct Witnesses {
    robots: BTreeSet<RobotId>,
    best: Decision,
}

#[derive(Clone, Debug, PartialEq)]
struct Held {
    decision: Decision,
    since: Duration,
    /// When the class last changed, or was last contradicted by an announcement.
    unsettled: Duration,
}

impl Agreement {
    /// Hears that `holder` holds a decision (`None`: nobody vouches for it by name). With liars among the robots it
    /// is believed once one more than those are heard holding its class. Says whether that is news: whether a
    /// greater decision than before may now be held.
    pub fn hear(&mut self, holder: Option<RobotId>, decision: Decision, liars: u32) -> bool {
        if liars == 0 {
            return self.believe(decision);
        }
        let Some(holder) = holder else { return false };
        // A class is one of at most MAX_CLASSES + 1, so this map is bounded, and so is each set in it.
        let witnesses = self
            .witnesses
            .entry(decision.class)
            .or_insert_with(|| Witnesses { robots: BTreeSet::new(), best: decision.clone() });
        if witnesses.robots.len() < MAX_ROBOTS {
            witnesses.robots.insert(holder);
        }
        if decision.rank() > witnesses.best.rank() {
            witnesses.best = decision;
        }
        if witnesses.robots.len() <= liars as usize {
            return false;
        }
        let best = witnesses.best.clone();
        self.believe(best)
    }

    /// Takes the greater of this decision and the best known one. A robot's own conclusion needs no witnesses.
    pub fn believe(&mut self, decision: Decision) -> bool {
        let greater = self.best.as_ref().is_none_or(|best| decision.rank() > best.rank());
        if greater {
            self.best = Some(decision);
        }
        greater
    }

    /// Holds the best decision known, if it is greater than the one held; one without a class only if `or_none`.
    /// Returns the decision when it is newly held.
    pub fn settle(&mut self, now: Duration, or_none: bool) -> Option<&Decision> {
        let best = self.best.as_ref().filter(|best| best.class.is_some() || or_none)?;
        match &mut self.held {
            Some(held) if best.rank() <= held.decision.rank() => return None,
            Some(held) => {
                if best.class != held.decision.class {
                    held.unsettled = now;
                }
                held.decision = best.clone();
            }
            None => self.held = Some(Held { decision: best.clone(), since: now, unsettled: now }),
        }
        self.held()
    }

    /// The decision held.
    #[must_use]
    pub fn held(&self) -> Option<&Decision> {
        self.held.as_ref().map(|held| &held.decision)
    }

    /// The class of the greatest decision that may be held; `Some(None)` is "no decision".
    #[must_use]
    pub fn best_class(&self) -> Option<Option<ClassId>> {
        self.best.as_ref().map(|best| best.class)
    }

    /// Since when one is held.
    #[must_use]
    pub fn held_since(&self) -> Option<Duration> {
        self.held.as_ref().map(|held| held.since)
    }

    /// The rank of the decision held.
    #[must_use]
    pub fn rank(&self) -> Option<Rank> {
        self.held().map(Decision::rank)
    }

    /// Notes that this class was announced for the swarm, by whomever.
    pub fn note_announced(&mut self, now: Duration, class: Option<ClassId>) {
        self.announced = Some(class);
        if let Some(held) = self.held.as_mut().filter(|held| held.decision.class != class) {
            held.unsettled = now;
        }
    }

    /// When a robot that waits that long after the last change announces the decision held; `None` while there is
    /// none, or its class is announced already.
    #[must_use]
    pub fn announcement(&self, wait: Duration) -> Option<Duration> {
        let held = self.held.as_ref()?;
        (self.announced != Some(held.decision.class)).then_some(held.unsettled + wait)
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{Certificate, CountedVote, FusionRule, RoundId, Stamp, VocabularyId};
    use proptest::prelude::*;

    use super::*;

    fn decision(class: Option<u8>, robots: u32, confidence: f64, author: u32) -> Decision {
        let vote = |robot| CountedVote {
            robot: RobotId(robot),
            stamp: Stamp::default(),
            class: ClassId(0),
            weight: 1.0,
        };
        Decision {
            round: RoundId { counter: 1, opener: RobotId(1), life: 0 },
            class: class.map(ClassId),
            confidence,
            author: RobotId(author),
            certificate: Certificate {
                vocabulary: VocabularyId(0),
                rule: FusionRule::LogPool,
                probabilities: vec![0.5; 4],
                votes: (0..robots).map(vote).collect(),
                elapsed_ms: 0,
            },
        }
    }

    fn at(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn the_greater_decision_replaces_the_held_one_and_the_lesser_does_not() {
        let mut agreement = Agreement::default();
        assert!(agreement.hear(None, decision(Some(1), 2, 0.96, 5), 0));
        assert_eq!(agreement.settle(at(0), true).unwrap().class, Some(ClassId(1)));
        assert!(!agreement.hear(None, decision(Some(2), 1, 0.99, 4), 0), "fewer robots");
        assert_eq!(agreement.settle(at(1), true), None);
        assert!(agreement.hear(None, decision(Some(2), 3, 0.95, 6), 0), "more robots");
        assert_eq!(agreement.settle(at(2), true).unwrap().class, Some(ClassId(2)));
    }

    #[test]
    fn no_decision_is_held_only_when_that_is_allowed_and_yields_to_any_class() {
        let mut agreement = Agreement::default();
        agreement.hear(None, decision(None, 9, 0.5, 1), 0);
        assert_eq!(agreement.settle(at(0), false), None);
        assert_eq!(agreement.settle(at(1), true).unwrap().class, None);
        agreement.hear(None, decision(Some(3), 1, 0.95, 2), 0);
        assert_eq!(agreement.settle(at(2), false).unwrap().class, Some(ClassId(3)));
    }

    #[test]
    fn with_f_liars_f_plus_1_distinct_robots_must_hold_the_class() {
        let mut agreement = Agreement::default();
        let lie = decision(Some(1), 4000, 1.0, 66);
        for _ in 0..3 {
            assert!(!agreement.hear(Some(RobotId(66)), lie.clone(), 1), "the same robot again");
        }
        assert!(!agreement.hear(None, lie.clone(), 1), "nobody's word");
        assert!(!agreement.hear(Some(RobotId(1)), decision(Some(2), 3, 0.97, 1), 1));
        assert!(agreement.hear(Some(RobotId(2)), decision(Some(2), 4, 0.97, 2), 1));
        assert_eq!(
            agreement.settle(at(0), true).unwrap().certificate.votes.len(),
            4,
            "the greatest of the class"
        );
        assert!(agreement.hear(Some(RobotId(3)), lie, 1), "one more than the liars vouch for it");
    }

    #[test]
    fn what_was_announced_is_not_announced_again_unless_the_class_changes() {
        let mut agreement = Agreement::default();
        assert_eq!(agreement.announcement(at(200)), None);
        agreement.hear(None, decision(Some(1), 2, 0.96, 5), 0);
        agreement.settle(at(100), true);
        assert_eq!(agreement.announcement(at(200)), Some(at(300)));
        agreement.note_announced(at(300), Some(ClassId(1)));
        assert_eq!(agreement.announcement(at(200)), None);
        agreement.hear(None, decision(Some(1), 3, 0.96, 5), 0);
        agreement.settle(at(400), true);
        assert_eq!(agreement.announcement(at(200)), None, "the same class by more robots");
        agreement.hear(None, decision(Some(2), 4, 0.96, 5), 0);
        agreement.settle(at(500), true);
        assert_eq!(agreement.announcement(at(200)), Some(at(700)));
    }

    #[test]
    fn an_announcement_that_contradicts_is_answered() {
        let mut agreement = Agreement::default();
        agreement.hear(None, decision(Some(1), 2, 0.96, 5), 0);
        agreement.settle(at(0), true);
        agreement.note_announced(at(900), Some(ClassId(3)));
        assert_eq!(agreement.announcement(at(200)), Some(at(1100)));
    }

    proptest! {
        #[test]
        fn order_and_repetition_make_no_difference(
            (heard, shuffled) in prop::collection::vec(
                (0..5u32, prop::option::of(0..3u8), 1..4u32, 0..3u32, 0..5u32), 1..20
            ).prop_flat_map(|heard| {
                let twice: Vec<_> = heard.iter().chain(&heard).copied().collect();
                (Just(heard), Just(twice).prop_shuffle())
            }),
            liars in 0..3u32,
        ) {
            let held = |heard: &[(u32, Option<u8>, u32, u32, u32)]| {
                let mut agreement = Agreement::default();
                for &(holder, class, robots, confidence, author) in heard {
                    // What has one rank is one decision: a robot makes one of its own per round.
                    let author = author + 5 * class.map_or(3, u32::from);
                    let decision = decision(class, robots, f64::from(confidence) / 4.0, author);
                    agreement.hear(Some(RobotId(holder)), decision, liars);
                    agreement.settle(at(0), true);
                }
                agreement.held().cloned()
            };
            prop_assert_eq!(held(&heard), held(&shuffled));
        }
    }
}
