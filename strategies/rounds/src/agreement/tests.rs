//! How decisions of one round become one.

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

/// That of a robot which holds gesture 1, by the votes of so many, from then on.
fn holding(robots: u32, since: Duration) -> Agreement {
    let mut agreement = Agreement::default();
    agreement.believe(decision(Some(1), robots, 0.96, 5));
    agreement.settle(since, true);
    agreement
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
    let mut agreement = holding(3, at(0));
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
    let agreement = |of: &[Holder]| {
        let mut agreement = holding(3, at(0));
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
        assert_eq!(held_by(&agreement(&[order[0].clone(), order[1].clone(), other.clone()]), &[]), Some(2));
    }
    // In another round of the count, which a cut kept apart, it may have counted as well.
    let following = |earlier: Agreement| {
        let mut agreement = holding(3, at(0));
        agreement.follow(earlier);
        agreement
    };
    let mut heard_of = holding(3, at(0));
    heard_of.note_elsewhere(before.robot, before.stamp, before.holding.class);
    for mut known in [following(agreement(std::slice::from_ref(&before))), heard_of] {
        known.note_holder(after.clone());
        known.note_holder(other.clone());
        assert_eq!(held_by(&known, &[]), Some(2));
    }
    let mut restarted = agreement(&[]);
    restarted.note_restart(before.robot);
    let mut known = following(restarted);
    known.note_holder(after.clone());
    assert_eq!(held_by(&known, &[]), Some(1));
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
    let mut agreement = holding(3, at(100));
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
    let mut agreement = holding(2, at(0));
    for is_final in [false, true, false] {
        agreement.note_announced(at(300), Some(ClassId(1)), is_final);
    }
    assert_eq!(announcement(&agreement), None);
}

#[test]
fn an_announcement_that_contradicts_is_answered() {
    let mut agreement = holding(2, at(0));
    agreement.note_announced(at(900), Some(ClassId(3)), true);
    assert_eq!(announcement(&agreement), Some(at(1100)));
}

#[test]
fn who_goes_on_contradicting_keeps_nobody_from_answering() {
    let mut agreement = holding(2, at(0));
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
