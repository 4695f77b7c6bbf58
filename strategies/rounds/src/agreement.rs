//! How the decisions of one round become one: the greatest wins, and one robot says it aloud.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{ClassId, Decision, Fnv1a, Holder, MAX_ROBOTS, Rank, RobotId, Stamp};

/// What a robot knows of the decisions of one round.
///
/// Believing commutes and repeats harmlessly: the greatest decision is kept, whatever the order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Agreement {
    best: Option<Arc<Decision>>,
    /// Its rank, which all its votes are added up for.
    best_rank: Option<Rank>,
    /// What each robot said last that it holds, this one among them. At most [`MAX_ROBOTS`].
    holders: BTreeMap<RobotId, Holder>,
    held: Option<Held>,
    /// The first gesture held. Whoever counts for one gesture of a round counts for no other, or two could be final.
    first: Option<ClassId>,
    /// Who said something in this round in two of its lives: in the first it may have counted for a gesture that it has forgotten.
    restarted: BTreeSet<RobotId>,
    announced: Option<Announced>,
}

#[derive(Clone, Debug, PartialEq)]
struct Held {
    decision: Arc<Decision>,
    rank: Rank,
    since: Duration,
    /// When the class last changed, or was first contradicted by an announcement.
    unsettled: Duration,
}

/// What was last said aloud for the swarm.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Announced {
    class: Option<ClassId>,
    is_final: bool,
}

impl Agreement {
    /// Hears a robot's word of what it holds, its own or passed on: the latest replaces all earlier ones. Says whether it was news.
    pub fn note_holder(&mut self, holder: Holder) -> bool {
        let known = self.holders.get(&holder.robot);
        if known.is_some_and(|known| known.stamp.boot != holder.stamp.boot) {
            self.restarted.insert(holder.robot);
        }
        let is_news = match known {
            Some(known) => known.stamp < holder.stamp,
            None => self.holders.len() < MAX_ROBOTS,
        };
        if is_news {
            self.holders.insert(holder.robot, holder);
        }
        is_news
    }

    /// That robot started again in the midst of the round: from now on it counts for no gesture, or two could be final.
    pub fn note_restart(&mut self, robot: RobotId) {
        if self.restarted.len() < MAX_ROBOTS {
            self.restarted.insert(robot);
        }
    }

    /// Forgets what these robots hold, and every decision that counted one of them, or that one of them drew; whether there was one.
    pub fn expel(&mut self, robots: &BTreeSet<RobotId>) -> bool {
        let counts = |decision: &Decision| {
            let certificate = &decision.certificate;
            let voters = certificate.votes.iter().map(|counted| counted.robot);
            let others = certificate.others.iter().map(|held| held.robot);
            voters.chain(others).chain([decision.author]).any(|robot| robots.contains(&robot))
        };
        self.holders.retain(|robot, _| !robots.contains(robot));
        let forgotten = self.best.take_if(|best| counts(best)).is_some();
        self.best_rank.take_if(|_| forgotten);
        self.held.take_if(|held| counts(&held.decision)).is_some() || forgotten
    }

    /// What robots said that they hold, by robot.
    pub fn holders(&self) -> impl Iterator<Item = &Holder> {
        self.holders.values()
    }

    /// What that robot said last that it holds.
    #[must_use]
    pub fn holder(&self, robot: RobotId) -> Option<&Holder> {
        self.holders.get(&robot)
    }

    /// These words in short, for a neighbour that may lack some: a hint, which somebody may make look like another.
    #[must_use]
    pub fn digest(&self) -> u16 {
        let mut digest = Fnv1a::default();
        for Holder { robot, stamp: Stamp { boot, sequence }, .. } in self.holders.values() {
            digest.add([robot.0, *boot, *sequence].into_iter().flat_map(u32::to_le_bytes));
        }
        // Its lower half alone would be that of the last bytes.
        let hash = if self.holders.is_empty() { 0 } else { digest.hash() };
        (hash ^ hash >> 16 ^ hash >> 32 ^ hash >> 48) as u16
    }

    /// Whether so many robots are known to hold the class held here: by their own words, and this one, `me`, and its guests, who hold
    /// what it holds. Those alone count of whom that is said.
    #[must_use]
    pub fn is_final(
        &self,
        quorum: u32,
        me: RobotId,
        guests: &BTreeSet<RobotId>,
        counts: impl Fn(RobotId) -> bool,
    ) -> bool {
        let Some(class) = self.held().and_then(|held| held.class) else { return false };
        let holds = |holder: &&Holder| {
            let Holder { robot, holding, .. } = holder;
            let other = *robot != me && !guests.contains(robot);
            let stays = !holding.changed && !self.restarted.contains(robot);
            holding.class == Some(class) && stays && other && counts(*robot)
        };
        let through_this = guests.iter().chain([&me]).filter(|robot| counts(**robot));
        let own = if self.has_changed(me) {
            0
        } else {
            through_this.filter(|robot| !self.restarted.contains(robot)).count()
        };
        if own + self.holders.len() < quorum as usize {
            return false;
        }
        own + self.holders().filter(holds).count() >= quorum as usize
    }

    /// Whether another gesture was held before this one, or may have been: by `me`, this robot, before it started.
    #[must_use]
    pub fn has_changed(&self, me: RobotId) -> bool {
        let is_another = |held: &Decision| held.class != self.first || self.restarted.contains(&me);
        self.held().is_some_and(|held| held.class.is_some() && is_another(held))
    }

    /// Takes the greater of this decision and the best known one. A robot's own conclusion needs no witnesses.
    pub fn believe(&mut self, decision: Decision) -> bool {
        let rank = decision.rank();
        let greater = self.best_rank.is_none_or(|best| rank > best);
        if greater {
            (self.best, self.best_rank) = (Some(Arc::new(decision)), Some(rank));
        }
        greater
    }

    /// Holds the best decision known, if it is greater than the one held; one without a class only if `or_none`.
    /// Returns the decision when it is newly held.
    pub fn settle(&mut self, now: Duration, or_none: bool) -> Option<&Decision> {
        let best = self.best.as_ref().filter(|best| best.class.is_some() || or_none)?;
        let rank = self.best_rank?;
        match &mut self.held {
            Some(held) if rank <= held.rank => return None,
            Some(held) => {
                if best.class != held.decision.class {
                    held.unsettled = now;
                }
                (held.decision, held.rank) = (best.clone(), rank);
            }
            None => self.held = Some(Held { decision: best.clone(), rank, since: now, unsettled: now }),
        }
        self.first = self.first.or(best.class);
        self.held()
    }

    /// The decision held.
    #[must_use]
    pub fn held(&self) -> Option<&Decision> {
        self.held.as_ref().map(|held| &*held.decision)
    }

    /// The greatest decision that may be held.
    #[must_use]
    pub fn best(&self) -> Option<&Decision> {
        self.best.as_deref()
    }

    /// Since when one is held.
    #[must_use]
    pub fn held_since(&self) -> Option<Duration> {
        self.held.as_ref().map(|held| held.since)
    }

    /// The rank of the decision held.
    #[must_use]
    pub fn rank(&self) -> Option<Rank> {
        self.held.as_ref().map(|held| held.rank)
    }

    /// Notes that this class was announced for the swarm, by whomever.
    pub fn note_announced(&mut self, now: Duration, class: Option<ClassId>, is_final: bool) {
        let answered = self.announced.map(|announced| announced.class);
        // An earlier announcement may come again.
        let is_final = is_final || self.announced == Some(Announced { class, is_final: true });
        self.announced = Some(Announced { class, is_final });
        if let Some(held) = self.held.as_mut().filter(|held| held.decision.class != class)
            // Who goes on contradicting keeps nobody from answering.
            && answered.is_none_or(|answered| answered == held.decision.class)
        {
            held.unsettled = now;
        }
    }

    /// Whether the class held was announced as final: then nothing is left to be announced.
    #[must_use]
    pub fn is_announced(&self) -> bool {
        let held = self.held.as_ref().map(|held| held.decision.class);
        self.announced.is_some_and(|announced| announced.is_final && Some(announced.class) == held)
    }

    /// When a robot that waits that long after the last change announces the decision held; `None` while there is
    /// none, or its class is announced already. A gesture that no majority is known to hold waits `provisional` longer,
    /// and is announced again when one is.
    #[must_use]
    pub fn announcement(&self, wait: Duration, is_final: bool, provisional: Duration) -> Option<Duration> {
        let held = self.held.as_ref()?;
        let due = held.unsettled + wait;
        match self.announced.filter(|announced| announced.class == held.decision.class) {
            Some(announced) if announced.is_final || !is_final => None,
            None if !is_final && held.decision.class.is_some() => Some(due + provisional),
            Some(_) | None => Some(due),
        }
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{Certificate, CountedVote, FusionRule, RoundId, Stamp, Terms, VocabularyId, Vote};
    use proptest::prelude::*;

    use super::*;

    fn decision(class: Option<u32>, robots: u32, confidence: f64, author: u32) -> Decision {
        let round = RoundId { counter: 1, opener: RobotId(1), life: 0 };
        let vote = |robot| CountedVote {
            robot: RobotId(robot),
            stamp: Stamp::default(),
            class: ClassId(0),
            weight: 1.0,
            vote: Vote {
                round,
                vocabulary: VocabularyId(0),
                evidence: vec![0.0; 4],
                looks: 1.0,
                unknown: None,
                named: vec![],
            },
            signature: None,
        };
        Decision {
            round,
            class: class.map(ClassId),
            confidence,
            author: RobotId(author),
            is_final: false,
            certificate: Certificate {
                vocabulary: VocabularyId(0),
                rule: FusionRule::LogPool,
                pool: None,
                probabilities: vec![0.5; 4],
                unknown: None,
                votes: (0..robots).map(vote).collect(),
                others: Vec::new(),
                robots,
                quorum: 1,
                elapsed_ms: 0,
                named: vec![],
                terms: Terms::default(),
            },
        }
    }

    /// Nobody need be known to hold it, and nothing waits for that.
    fn announcement(agreement: &Agreement) -> Option<Duration> {
        agreement.announcement(at(200), true, at(5000))
    }

    fn at(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn the_greater_decision_replaces_the_held_one_and_the_lesser_does_not() {
        let mut agreement = Agreement::default();
        assert!(agreement.believe(decision(Some(1), 2, 0.96, 5)));
        assert_eq!(agreement.settle(at(0), true).unwrap().class, Some(ClassId(1)));
        assert!(!agreement.believe(decision(Some(2), 1, 0.99, 4)), "fewer robots");
        assert_eq!(agreement.settle(at(1), true), None);
        assert!(agreement.believe(decision(Some(2), 3, 0.95, 6)), "more robots");
        assert_eq!(agreement.settle(at(2), true).unwrap().class, Some(ClassId(2)));
    }

    #[test]
    fn no_decision_is_held_only_when_that_is_allowed_and_yields_to_any_class() {
        let mut agreement = Agreement::default();
        agreement.believe(decision(None, 9, 0.5, 1));
        assert_eq!(agreement.settle(at(0), false), None);
        assert_eq!(agreement.settle(at(1), true).unwrap().class, None);
        agreement.believe(decision(Some(3), 1, 0.95, 2));
        assert_eq!(agreement.settle(at(2), false).unwrap().class, Some(ClassId(3)));
    }

    /// The word of that robot, its n-th, that it holds this.
    fn holds(robot: u32, sequence: u32, decision: &Decision, changed: bool) -> Holder {
        let stamp = Stamp { boot: 1, sequence };
        Holder { robot: RobotId(robot), stamp, holding: decision.holding(changed), signature: None }
    }

    /// The most robots that it is known to be held by, of which robot 1 is this one.
    fn held_by(agreement: &Agreement, guests: &[u32]) -> Option<u32> {
        let guests = guests.iter().copied().map(RobotId).collect();
        (1..99).rfind(|quorum| agreement.is_final(*quorum, RobotId(1), &guests, |_| true))
    }

    #[test]
    fn a_decision_is_final_once_so_many_robots_are_known_to_hold_its_class() {
        let mut agreement = Agreement::default();
        agreement.believe(decision(Some(1), 3, 0.96, 5));
        agreement.settle(at(0), true);
        let of = |class, robots| decision(Some(class), robots, 0.96, 5);
        assert!(agreement.note_holder(holds(2, 7, &of(1, 2), false)));
        assert!(agreement.note_holder(holds(2, 8, &of(1, 3), false)));
        assert!(agreement.note_holder(holds(3, 1, &of(0, 2), false)));
        assert_eq!(held_by(&agreement, &[]), Some(2), "one robot counts once");
        assert!(agreement.note_holder(holds(3, 3, &of(1, 3), false)));
        assert_eq!(held_by(&agreement, &[]), Some(3), "it has changed its mind");
        assert!(!agreement.note_holder(holds(3, 2, &of(0, 2), false)));
        assert_eq!(held_by(&agreement, &[]), Some(3), "an old word comes late");
        assert_eq!(held_by(&agreement, &[3, 4]), Some(4), "what holds through this one counts, once");
        assert!(agreement.note_holder(holds(1, 9, &of(1, 3), false)));
        assert_eq!(held_by(&agreement, &[]), Some(3), "this one counts once, also by its own word");
        assert!(agreement.note_holder(holds(6, 1, &of(1, 3), true)));
        assert_eq!(held_by(&agreement, &[]), Some(3), "who held another gesture before counts for none");
    }

    #[test]
    fn who_started_again_in_the_midst_of_the_round_counts_for_no_gesture() {
        let held = decision(Some(1), 3, 0.96, 5);
        let agreement = |of: &[Holder]| {
            let mut agreement = Agreement::default();
            agreement.believe(held.clone());
            agreement.settle(at(0), true);
            for holder in of {
                agreement.note_holder(holder.clone());
            }
            agreement
        };
        let word = |robot, boot, class| {
            let stamp = Stamp { boot, sequence: 1 };
            Holder { stamp, ..holds(robot, 1, &decision(Some(class), 3, 0.96, 5), false) }
        };
        let (before, after, other) = (word(3, 1, 0), word(3, 2, 1), word(2, 1, 1));
        for order in [[&before, &after], [&after, &before]] {
            assert_eq!(
                held_by(&agreement(&[order[0].clone(), order[1].clone(), other.clone()]), &[]),
                Some(2)
            );
        }
        // By its votes as well, and so does this robot itself.
        let mut known = agreement(&[after, other]);
        assert_eq!((held_by(&known, &[]), known.has_changed(RobotId(1))), (Some(3), false));
        known.note_restart(RobotId(3));
        known.note_restart(RobotId(1));
        assert_eq!((held_by(&known, &[]), known.has_changed(RobotId(1))), (Some(1), true));
    }

    #[test]
    fn who_knows_the_same_words_has_the_same_digest() {
        let words = |order: [u32; 3]| {
            let mut agreement = Agreement::default();
            for robot in order {
                agreement.note_holder(holds(robot, 4, &decision(Some(1), 3, 0.96, 5), false));
            }
            agreement
        };
        let (here, mut there) = (words([1, 2, 3]), words([3, 1, 2]));
        assert_eq!(here.digest(), there.digest());
        there.note_holder(holds(2, 5, &decision(Some(1), 3, 0.96, 5), false));
        assert_ne!(here.digest(), there.digest());
        assert_eq!(Agreement::default().digest(), 0);
    }

    #[test]
    fn what_no_majority_holds_is_announced_late_and_again_when_one_does() {
        let mut agreement = Agreement::default();
        agreement.believe(decision(Some(1), 3, 0.96, 5));
        agreement.settle(at(100), true);
        let due = |agreement: &Agreement| {
            let is_final = agreement.is_final(2, RobotId(1), &BTreeSet::new(), |_| true);
            agreement.announcement(at(200), is_final, at(5000))
        };
        assert_eq!(due(&agreement), Some(at(5300)));
        agreement.note_announced(at(5300), Some(ClassId(1)), false);
        assert_eq!(due(&agreement), None);
        let held = agreement.held().cloned().unwrap();
        agreement.note_holder(holds(2, 1, &held, false));
        assert_eq!(due(&agreement), Some(at(300)), "overdue");
        agreement.note_announced(at(6000), Some(ClassId(1)), true);
        assert_eq!(due(&agreement), None);
    }

    #[test]
    fn what_was_announced_is_not_announced_again_unless_the_class_changes() {
        let mut agreement = Agreement::default();
        assert_eq!(announcement(&agreement), None);
        agreement.believe(decision(Some(1), 2, 0.96, 5));
        agreement.settle(at(100), true);
        assert_eq!(announcement(&agreement), Some(at(300)));
        agreement.note_announced(at(300), Some(ClassId(1)), true);
        assert_eq!(announcement(&agreement), None);
        agreement.believe(decision(Some(1), 3, 0.96, 5));
        agreement.settle(at(400), true);
        assert_eq!(announcement(&agreement), None, "the same class by more robots");
        agreement.believe(decision(Some(2), 4, 0.96, 5));
        agreement.settle(at(500), true);
        assert_eq!(announcement(&agreement), Some(at(700)));
    }

    #[test]
    fn an_earlier_announcement_that_comes_again_is_not_answered() {
        let mut agreement = Agreement::default();
        agreement.believe(decision(Some(1), 2, 0.96, 5));
        agreement.settle(at(0), true);
        for is_final in [false, true, false] {
            agreement.note_announced(at(300), Some(ClassId(1)), is_final);
        }
        assert_eq!(announcement(&agreement), None);
    }

    #[test]
    fn an_announcement_that_contradicts_is_answered() {
        let mut agreement = Agreement::default();
        agreement.believe(decision(Some(1), 2, 0.96, 5));
        agreement.settle(at(0), true);
        agreement.note_announced(at(900), Some(ClassId(3)), true);
        assert_eq!(announcement(&agreement), Some(at(1100)));
    }

    #[test]
    fn who_goes_on_contradicting_keeps_nobody_from_answering() {
        let mut agreement = Agreement::default();
        agreement.believe(decision(Some(1), 2, 0.96, 5));
        agreement.settle(at(0), true);
        for time in [100, 200, 290] {
            agreement.note_announced(at(time), Some(ClassId(3)), false);
        }
        assert_eq!(announcement(&agreement), Some(at(300)));
    }

    proptest! {
        #[test]
        fn order_and_repetition_make_no_difference(
            (heard, shuffled) in prop::collection::vec(
                (prop::option::of(0..3_u32), 1..4u32, 0..3u32, 0..5u32), 1..20
            ).prop_flat_map(|heard| {
                let twice: Vec<_> = heard.iter().chain(&heard).copied().collect();
                (Just(heard), Just(twice).prop_shuffle())
            }),
        ) {
            let held = |heard: &[(Option<u32>, u32, u32, u32)]| {
                let mut agreement = Agreement::default();
                for &(class, robots, confidence, author) in heard {
                    // What has one rank is one decision: a robot makes one of its own per round.
                    let author = author + 5 * class.map_or(3, u32::from);
                    agreement.believe(decision(class, robots, f64::from(confidence) / 4.0, author));
                    agreement.settle(at(0), true);
                }
                agreement.held().cloned()
            };
            prop_assert_eq!(held(&heard), held(&shuffled));
        }
    }
}
