use std::num::NonZeroU32;

use super::*;
use crate::membership::Membership;
use crate::testing::{authority, members, robot, roster, vote};
use crate::witness::Witness;

const NOW: Duration = Duration::from_secs(1000);

fn verifier() -> Verifier {
    Verifier::new(roster(5), Budget::default())
}

/// One with next to nothing beside the budgets of the authors.
fn sparing() -> Verifier {
    Verifier::new(roster(5), Budget { spare: NonZeroU32::MIN, ..Budget::default() })
}

fn sign(by: u32, statement: &[u8]) -> Signature {
    statement::sign(&robot(by), &roster(5).swarm_id(), statement)
}

/// What the verifier makes of that vote, truly signed by its author.
fn hear(verifier: &mut Verifier, now: Duration, author: u32, sequence: u32) -> Result<(), Distrust> {
    let said = vote(author, sequence, 1.0);
    verifier.check(now, &said, Some(&sign(author, &said)))
}

fn forge(verifier: &mut Verifier, now: Duration, author: u32, sequence: u32) -> Result<(), Distrust> {
    let said = vote(author, sequence, 1.0);
    verifier.check(now, &said, Some(&sign(99, &said)))
}

#[test]
fn each_cause_is_told_apart() {
    let mut members = members(5);
    let gone = members.robots.remove(&RobotId(3)).unwrap();
    members.expelled.insert(RobotId(3), gone);
    let mut verifier = Verifier::new(members.sign(&authority()).unwrap(), Budget::default());
    assert_eq!(hear(&mut verifier, NOW, 1, 1), Ok(()));
    assert_eq!(forge(&mut verifier, NOW, 1, 2), Err(Distrust::Forged));
    assert_eq!(hear(&mut verifier, NOW, 3, 1), Err(Distrust::Expelled));
    assert_eq!(hear(&mut verifier, NOW, 50, 1), Err(Distrust::Stranger));
    assert_eq!(verifier.check(NOW, &vote(1, 3, 1.0), None), Err(Distrust::Unsigned));
    let junk = Signature::from_bytes([0; 64]);
    assert_eq!(verifier.check(NOW, b"junk", Some(&junk)), Err(Distrust::Malformed));
}

#[test]
fn what_repeats_is_believed_at_no_cost() {
    let mut verifier = verifier();
    for _ in 0..100 {
        assert_eq!(hear(&mut verifier, NOW, 1, 1), Ok(()));
    }
    // The same statement under another signature could not be passed on.
    assert_eq!(forge(&mut verifier, NOW, 1, 1), Err(Distrust::Forged));
}

#[test]
fn a_flood_in_one_name_costs_that_name_alone() {
    let mut verifier = sparing();
    hear(&mut verifier, NOW, 1, 0).unwrap();
    let answers: Vec<_> = (1..1000).map(|sequence| forge(&mut verifier, NOW, 1, sequence)).collect();
    assert_eq!(answers.iter().filter(|answer| **answer == Err(Distrust::Forged)).count(), 15 + 1);
    assert_eq!(hear(&mut verifier, NOW, 1, 2000), Err(Distrust::TooFast));
    assert_eq!(hear(&mut verifier, NOW, 1, 0), Ok(()), "known before the flood");
    assert_eq!(hear(&mut verifier, NOW, 2, 1), Ok(()));
    assert_eq!(hear(&mut verifier, NOW + Duration::from_millis(125), 1, 2000), Ok(()));
}

#[test]
fn who_is_flooded_is_heard_in_the_midst_of_it_and_the_flood_is_bounded() {
    let mut verifier = verifier();
    let (mut heard, mut checked) = (0, 0);
    // As fast as what is spared comes back, and then all at once.
    for ms in 0..1000 {
        let now = NOW + Duration::from_millis(ms.into());
        checked += u32::from(forge(&mut verifier, now, 1, ms) == Err(Distrust::Forged));
        if ms % 250 == 249 {
            heard += u32::from(hear(&mut verifier, now, 1, 20_000 + ms) == Ok(()));
        }
    }
    assert_eq!(heard, 4);
    for ms in 1000..4000 {
        checked +=
            u32::from(forge(&mut verifier, NOW + Duration::from_secs(1), 1, ms) == Err(Distrust::Forged));
    }
    // 16 at once and 8 a second of its own, 1,000 at once and a second beside them.
    let all = checked + heard;
    assert!((2000..=16 + 8 + 1000 + 1000).contains(&all), "{all} were checked");
    assert_eq!(hear(&mut verifier, NOW + Duration::from_secs(1), 2, 1), Ok(()), "others have their own");
}

#[test]
fn a_flood_on_one_way_leaves_the_others_open() {
    let said = |sequence| vote(1, sequence, 1.0);
    let (mine, theirs) = (said(5000), said(5001));
    let (by_me, by_another) = (sign(1, &mine), sign(99, &theirs));
    let check = |verifier: &mut Verifier, passed_on, sequence| {
        let (said, signature) = if sequence == 5000 {
            (mine.clone(), by_me)
        } else {
            (said(sequence), sign(99, &said(sequence)))
        };
        if passed_on {
            verifier.check_passed_on(RobotId(2), NOW, &said, Some(&signature))
        } else {
            verifier.check(NOW, &said, Some(&signature))
        }
    };
    for flooded in [false, true] {
        let mut verifier = sparing();
        let answers: Vec<_> = (0..1000).map(|sequence| check(&mut verifier, flooded, sequence)).collect();
        assert_eq!(answers.iter().filter(|answer| **answer == Err(Distrust::Forged)).count(), 16 + 1);
        assert_eq!(check(&mut verifier, flooded, 5000), Err(Distrust::TooFast));
        assert_eq!(check(&mut verifier, !flooded, 5000), Ok(()));
        assert_eq!(check(&mut verifier, flooded, 5000), Ok(()), "known by whichever way");
        // Each way is bounded, and what is checked on one is not checked again on the other.
        let answers: Vec<_> = (0..1000).map(|sequence| check(&mut verifier, !flooded, sequence)).collect();
        assert_eq!(answers.iter().filter(|answer| **answer == Err(Distrust::Forged)).count(), 15 + 1);
        let convicted = || {
            let mut witness = Witness::new(&roster(5));
            let both = [vote(1, 1, 1.0), vote(1, 1, -1.0)];
            let found = both.each_ref().map(|said| witness.observe(said, &sign(1, said)));
            found.into_iter().flatten().next().expect("two things")
        };
        assert!(verifier.convict(NOW, &convicted(), |_| false).is_ok(), "evidence comes by a third way");
    }
    assert_eq!(
        verifier().check_passed_on(RobotId(2), NOW, &theirs, Some(&by_another)),
        Err(Distrust::Forged)
    );
}

#[test]
fn who_passes_on_what_was_never_said_keeps_nobody_else_from_being_heard() {
    let said = |sequence| vote(1, sequence, 1.0);
    let pass_on = |verifier: &mut Verifier, by, sequence, key| {
        verifier.check_passed_on(RobotId(by), NOW, &said(sequence), Some(&sign(key, &said(sequence))))
    };
    let mut verifier = verifier();
    let answers: Vec<_> = (0..2000).map(|sequence| pass_on(&mut verifier, 3, sequence, 99)).collect();
    // What there is for robot 1 by this way, and a quarter of what is spared.
    assert_eq!(answers.iter().filter(|answer| **answer == Err(Distrust::Forged)).count(), 16 + 250);
    assert_eq!(pass_on(&mut verifier, 3, 5000, 1), Err(Distrust::TooFast));
    assert_eq!(pass_on(&mut verifier, 2, 5000, 1), Ok(()));
    // Nobody passes on anything beside what there is for its author in a name that is nobody's.
    assert_eq!(pass_on(&mut verifier, 9, 5001, 1), Err(Distrust::TooFast));
    // A new key begins anew.
    let mut renewed = crate::testing::members(6);
    renewed.robots.insert(RobotId(3), crate::testing::robot(91).public_key());
    assert!(verifier.adopt(renewed.sign(&authority()).unwrap()).unwrap());
    assert_eq!(pass_on(&mut verifier, 3, 5001, 1), Ok(()));
}

#[test]
fn a_flood_is_bounded_whatever_the_clock_says() {
    let day = Duration::from_secs(86_400);
    // Standing still; from 1970 to today; back by a day and forth again.
    for (clock, most) in [
        ([NOW, NOW, NOW], 17),
        ([Duration::ZERO, 20_000 * day, 20_000 * day], 34),
        ([2 * day, day, 2 * day], 34),
        ([Duration::MAX, Duration::ZERO, Duration::MAX], 34),
    ] {
        let mut verifier = sparing();
        let mut sequence = 0;
        let mut checked = 0;
        for now in clock {
            for _ in 0..100 {
                sequence += 1;
                checked += u32::from(forge(&mut verifier, now, 1, sequence) == Err(Distrust::Forged));
            }
        }
        assert_eq!(checked, most, "{clock:?}");
    }
}

#[test]
fn memory_is_bounded_by_the_roster() {
    let mut verifier = verifier();
    for sequence in 0..500 {
        let now = NOW + Duration::from_secs(sequence.into());
        assert_eq!(hear(&mut verifier, now, sequence % 4, sequence), Ok(()));
        assert_eq!(hear(&mut verifier, now, 4 + sequence, sequence), Err(Distrust::Stranger));
    }
    assert_eq!(verifier.authors.len(), 4);
    assert!(verifier.authors.values().all(|author| author.verified.len() == REMEMBERED));
}

#[test]
fn a_swarm_never_goes_back() {
    let mut verifier = verifier();
    assert!(matches!(verifier.adopt(roster(4)), Err(RosterError::Older { held: 5, offered: 4 })));
    assert!(matches!(verifier.adopt(roster(5)), Ok(false)));
    let mut fewer = members(5);
    fewer.robots.remove(&RobotId(0));
    let contradiction = verifier.adopt(fewer.sign(&authority()).unwrap());
    assert!(matches!(contradiction, Err(RosterError::Contradiction { epoch: 5 })));
    let usurper = members(6).sign(&robot(1)).unwrap();
    assert!(matches!(verifier.adopt(usurper), Err(RosterError::OtherSwarm)));
    let renamed = Membership { swarm: "other".to_owned(), ..members(6) }.sign(&authority()).unwrap();
    assert!(matches!(verifier.adopt(renamed), Err(RosterError::OtherSwarm)));
    assert_eq!(verifier.roster(), &roster(5));
    assert!(matches!(verifier.adopt(roster(6)), Ok(true)));
}

#[test]
fn who_is_expelled_is_not_believed_any_more_and_comes_back_with_a_new_key() {
    let mut verifier = verifier();
    assert_eq!(hear(&mut verifier, NOW, 1, 1), Ok(()));
    let mut expels = members(6);
    let key = expels.robots.remove(&RobotId(1)).unwrap();
    expels.expelled.insert(RobotId(1), key);
    verifier.adopt(expels.clone().sign(&authority()).unwrap()).unwrap();
    assert_eq!(hear(&mut verifier, NOW, 1, 1), Err(Distrust::Expelled), "not even what was verified");
    let again = Membership { epoch: 7, ..expels.clone() };
    let with_old_key = Membership { robots: [(RobotId(1), key)].into(), ..again.clone() };
    assert!(with_old_key.sign(&authority()).is_err());
    let with_new_key = Membership { robots: [(RobotId(1), robot(11).public_key())].into(), ..again };
    verifier.adopt(with_new_key.sign(&authority()).unwrap()).unwrap();
    assert_eq!(hear(&mut verifier, NOW, 1, 1), Err(Distrust::Forged), "signed by the old key");
    let said = vote(1, 1, 1.0);
    assert_eq!(verifier.check(NOW, &said, Some(&sign(11, &said))), Ok(()));
}

#[test]
fn who_was_caught_in_a_lie_is_not_believed_until_it_has_a_new_key() {
    let mut verifier = verifier();
    let mut witness = Witness::new(&roster(5));
    let both = [vote(1, 1, 1.0), vote(1, 1, -1.0)];
    let found = both.each_ref().map(|said| witness.observe(said, &sign(1, said)));
    let evidence = found[1].clone().unwrap();
    assert_eq!(verifier.convict(NOW, &evidence, |_| false).unwrap().robot, RobotId(1));
    assert_eq!(hear(&mut verifier, NOW, 1, 2), Err(Distrust::Convicted));
    assert_eq!(hear(&mut verifier, NOW, 2, 2), Ok(()));
    verifier.adopt(roster(6)).unwrap();
    assert_eq!(verifier.convicted().collect::<Vec<_>>(), [RobotId(1)]);
    let mut renewed = members(7);
    renewed.robots.insert(RobotId(1), robot(11).public_key());
    verifier.adopt(renewed.sign(&authority()).unwrap()).unwrap();
    assert_eq!(verifier.convicted().count(), 0);
    assert_eq!(verifier.convict(NOW, &evidence, |_| false), Err(EvidenceError::Forged(RobotId(1))));
    let said = vote(1, 3, 1.0);
    assert_eq!(verifier.check(NOW, &said, Some(&sign(11, &said))), Ok(()));
}

#[test]
fn false_evidence_has_a_budget_of_its_own() {
    let mut verifier = sparing();
    let mut witness = Witness::new(&roster(5));
    let both = [vote(1, 1, 1.0), vote(1, 1, -1.0)];
    let forged = both.each_ref().map(|said| witness.observe(said, &sign(99, said)))[1].clone().unwrap();
    let answers: Vec<_> = (0..100).map(|_| verifier.convict(NOW, &forged, |_| false)).collect();
    let checked = answers.iter().filter(|answer| **answer == Err(EvidenceError::Forged(RobotId(1)))).count();
    assert_eq!(checked, 16 + 1);
    assert_eq!(answers[99], Err(EvidenceError::TooFast(RobotId(1))));
    assert_eq!(hear(&mut verifier, NOW, 1, 2), Ok(()));
}
