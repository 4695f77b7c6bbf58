use super::*;
use crate::statement;
use crate::testing::{batch, decision, robot, roster, vote};

const NOW: Duration = Duration::from_secs(1000);

fn said(author: u32, sequence: u32, evidence: f32) -> Envelope {
    let unsigned = vote(author, sequence, evidence);
    let signature: Signature = statement::sign(&robot(author), &roster(5).swarm_id(), &unsigned);
    Envelope { signature: Some(signature), ..Envelope::decode(&unsigned).unwrap() }
}

#[test]
fn who_says_two_things_is_told_of_once_and_again_to_those_who_come() {
    let (mut here, mut there) = (Judge::new(roster(5), |_| false), Judge::new(roster(5), |_| false));
    assert_eq!(here.envelope(NOW, &said(1, 1, 1.0)), Ok(()));
    assert_eq!(here.envelope(NOW, &said(1, 1, -1.0)), Err(Distrust::Convicted));
    let told = here.untold(NOW);
    assert_eq!((told.len(), here.untold(NOW).len()), (1, 0));
    assert_eq!(there.evidence(NOW, told[0].1.clone()), Ok(()));
    assert_eq!(there.evidence(NOW, told[0].1.clone()), Ok(()));
    assert_eq!(there.fallen(), [(RobotId(1), Lie::TwoThings)], "no news the second time");
    assert!(there.fallen().is_empty() && !there.is_member(RobotId(1)));
    assert_eq!(there.envelope(NOW, &said(1, 2, 1.0)), Err(Distrust::Convicted));
    assert_eq!(there.envelope(NOW, &said(2, 2, 1.0)), Ok(()));
    assert!(there.untold(NOW).is_empty(), "who found it tells it");
    there.tell_again();
    assert_eq!(there.untold(NOW), told);
}

#[test]
fn evidence_is_handed_out_once_to_be_kept_whoever_found_it() {
    let (mut here, mut there) = (Judge::new(roster(5), |_| false), Judge::new(roster(5), |_| false));
    assert_eq!((here.envelope(NOW, &said(1, 1, 1.0)), here.unkept()), (Ok(()), vec![]));
    assert_eq!(here.envelope(NOW, &said(1, 1, -1.0)), Err(Distrust::Convicted));
    let kept = here.unkept();
    assert_eq!((kept.len(), here.unkept()), (1, vec![]));
    assert_eq!(there.evidence(NOW, kept[0].1.clone()), Ok(()));
    assert_eq!((there.unkept(), there.convicts(RobotId(1))), (kept, true));
}

#[test]
fn who_shares_two_samples_under_one_number_is_out_and_who_shares_one_twice_is_not() {
    let mut judge = Judge::new(roster(5), |_| false);
    let again = |number| batch(2, 6, &[(number, 20)]);
    assert!(!judge.two_samples(batch(2, 5, &[(1, 20)]), again(1)));
    assert!(!judge.two_samples(batch(2, 5, &[(1, 10)]), HeldBatch { signature: None, ..again(1) }));
    assert!(judge.is_member(RobotId(2)) && judge.fallen().is_empty());
    assert!(judge.two_samples(batch(2, 5, &[(1, 10)]), again(1)));
    assert_eq!(judge.fallen(), [(RobotId(2), Lie::TwoSamples)]);
    assert!(judge.convicts(RobotId(2)) && judge.untold(NOW).len() == 1);
}

#[test]
fn whoever_was_proven_to_lie_speaks_and_answers_for_nobody() {
    let mut judge = Judge::new(roster(5), |_| false);
    let (guest, swarm) = ("guest".parse().unwrap(), roster(5).swarm_id());
    let both = |judge: &mut Judge, count| {
        let heading = WordHeading { speaker: Speaker::For(RobotId(1)), count };
        let attachment = crate::word::sign(&robot(1), &swarm, &guest, &heading, b"open");
        let answer = crate::answer::sign(&robot(1), &swarm, RobotId(1), &guest, b"yes");
        let word = judge.word(NOW, &guest, b"open", Some(&attachment)).map(drop);
        (word, judge.answer(NOW, RobotId(1), &guest, b"yes", Some(answer.as_bytes())))
    };
    assert_eq!(both(&mut judge, 1), (Ok(()), Ok(())));
    judge.envelope(NOW, &said(1, 1, 1.0)).unwrap();
    assert_eq!(judge.envelope(NOW, &said(1, 1, -1.0)), Err(Distrust::Convicted));
    assert_eq!(both(&mut judge, 2), (Err(Distrust::Convicted), Err(Distrust::Convicted)));
}

#[test]
fn an_answer_is_its_robots() {
    let mut judge = Judge::new(roster(5), |_| false);
    let ada = "ada".parse().unwrap();
    let signature = crate::answer::sign(&robot(1), &roster(5).swarm_id(), RobotId(1), &ada, b"yes");
    let mut hear =
        |robot, said: &[u8]| judge.answer(NOW, RobotId(robot), &ada, said, Some(signature.as_bytes()));
    assert_eq!(hear(1, b"yes"), Ok(()));
    assert_eq!((hear(1, b"no"), hear(2, b"yes")), (Err(Distrust::Forged), Err(Distrust::Forged)));
}

/// That robot's word that it holds something, signed by that one.
fn word(author: u32, by: u32) -> Envelope {
    let round = gestalt_protocol::RoundId { counter: 1, opener: RobotId(0), life: 7 };
    let rank =
        gestalt_protocol::Rank { decided: true, robots: 1, looks: 1.0, confidence: 1.0, author: RobotId(0) };
    let message = Message::Holding(gestalt_protocol::Holding { round, class: None, rank, changed: false });
    signed(author, 9, message, by)
}

fn signed(author: u32, sequence: u32, message: Message, by: u32) -> Envelope {
    let stamp = gestalt_protocol::Stamp { boot: 1, sequence };
    let said = Envelope { author: RobotId(author), stamp, message, signature: None };
    let signature = statement::sign(&robot(by), &roster(5).swarm_id(), &said.statement());
    Envelope { signature: Some(signature), ..said }
}

/// What a robot passes on and does not sign.
fn hint(give: Give) -> Envelope {
    let stamp = gestalt_protocol::Stamp { boot: 1, sequence: 12 };
    Envelope { author: RobotId(4), stamp, message: Message::Give(give), signature: None }
}

#[test]
fn what_a_robot_holds_is_its_own_word() {
    let mut judge = Judge::new(roster(5), |_| false);
    assert_eq!(judge.envelope(NOW, &word(1, 1)), Ok(()));
    assert_eq!(judge.envelope(NOW, &word(2, 1)), Err(Distrust::Forged));
    let holder = |said: Envelope| {
        let Envelope { author: robot, stamp, message: Message::Holding(holding), signature } = said else {
            unreachable!()
        };
        gestalt_protocol::Holder { robot, stamp, holding, signature }
    };
    let (mine, forged) = (holder(word(1, 1)), holder(word(2, 1)));
    let mut given = hint(Give { decision: None, votes: vec![], holders: vec![forged, mine.clone()] });
    assert_eq!(judge.passed_on(NOW, &mut given), Some(Distrust::Forged));
    assert_eq!(given, hint(Give { decision: None, votes: vec![], holders: vec![mine] }));
}

#[test]
fn an_announcement_is_its_announcers_to_the_last_word() {
    let round = gestalt_protocol::RoundId { counter: 1, opener: RobotId(0), life: 7 };
    let decision = decision(1);
    let message = |decision| {
        Message::Announced(gestalt_protocol::Announced { decision, label: Some("palm".to_owned()) })
    };
    let said = |by| Announcement::of(signed(1, 5, message(decision.clone()), by)).unwrap();
    let heard =
        |announcement: &Announcement| Judge::new(roster(5), |_| false).announcement(NOW, announcement);
    assert_eq!(heard(&said(1)), Ok(()));
    assert_eq!(heard(&said(2)), Err(Distrust::Forged));
    assert_eq!(heard(&Announcement { signature: None, ..said(1) }), Err(Distrust::Unsigned));
    assert_eq!(heard(&Announcement { announcer: RobotId(9), ..said(1) }), Err(Distrust::Stranger));
    type Change = fn(&mut Announcement);
    let changes: [Change; 8] = [
        |it| it.decision.is_final = false,
        |it| it.label = None,
        |it| it.decision.round.life = 8,
        |it| it.decision.author = RobotId(1),
        |it| it.decision.certificate.robots = 2,
        |it| it.decision.certificate.elapsed_ms = 2,
        |it| it.stamp.sequence = 6,
        |it| it.announcer = RobotId(2),
    ];
    for change in changes {
        let mut changed = said(1);
        change(&mut changed);
        assert_eq!(heard(&changed), Err(Distrust::Forged), "{changed:?}");
    }
    let unsigned = gestalt_protocol::HeldVote {
        robot: RobotId(2),
        stamp: gestalt_protocol::Stamp { boot: 1, sequence: 1 },
        vote: gestalt_protocol::Vote {
            round,
            vocabulary: gestalt_protocol::VocabularyId(9),
            evidence: vec![],
            looks: 0.0,
            unknown: None,
            named: vec![],
        },
        signature: None,
    };
    let mut of_no_vote = decision.clone();
    of_no_vote.certificate.others = vec![unsigned];
    let announcement = Announcement::of(signed(1, 5, message(of_no_vote), 1)).unwrap();
    assert_eq!(heard(&announcement), Err(Distrust::Unsigned), "its votes have to be true, too");
}

#[test]
fn who_gives_what_does_not_follow_is_convicted_whatever_is_said_against_it_before() {
    let refutes: Refutes = |decision| decision.certificate.elapsed_ms == 13;
    let judge = || Judge::new(roster(5), refutes);
    let give =
        |decision| Message::Give(Give { decision: Some(decision), votes: Vec::new(), holders: Vec::new() });
    let (mut here, mut there) = (judge(), judge());
    let mut honest = signed(1, 3, give(decision(12)), 1);
    assert_eq!(here.passed_on(NOW, &mut honest), None);
    let mut unsigned = Envelope { signature: None, ..honest.clone() };
    assert_eq!(here.passed_on(NOW, &mut unsigned), Some(Distrust::Unsigned));
    assert_eq!(unsigned.message, Message::Give(Give { decision: None, votes: vec![], holders: vec![] }));
    let mut forged = signed(1, 4, give(decision(13)), 2);
    assert_eq!(here.passed_on(NOW, &mut forged), Some(Distrust::Forged));
    // Its budget for evidence is used up by others.
    let false_evidence = Evidence::of_decision(honest.statement(), honest.signature.unwrap());
    let made_up = (0..3000).map(|_| here.evidence(NOW, false_evidence.clone()));
    let answers: Vec<_> = made_up.collect();
    assert_eq!(answers[0], Err(EvidenceError::Founded));
    assert_eq!(answers[2999], Err(EvidenceError::TooFast(RobotId(1))));
    assert!(here.fallen().is_empty() && here.untold(NOW).is_empty() && !here.convicts(RobotId(1)));
    let mut lie = signed(1, 5, give(decision(13)), 1);
    // A signature that was believed before costs nothing, and one more is spared a second later.
    let later = NOW + Duration::from_secs(2);
    assert_eq!(here.passed_on(later, &mut lie), Some(Distrust::Convicted));
    assert_eq!(here.fallen(), [(RobotId(1), Lie::Unfounded)]);
    let told = here.untold(later);
    assert_eq!((told.len(), here.untold(later).len()), (1, 0));
    assert_eq!(there.evidence(NOW, told[0].1.clone()), Ok(()));
    assert!(there.convicts(RobotId(1)) && !there.is_member(RobotId(1)));
    assert_eq!(there.envelope(NOW, &said(1, 6, 1.0)), Err(Distrust::Convicted));
    // Whoever comes hears of it, and whoever comes and goes makes nobody repeat it all the time.
    here.tell_again();
    assert_eq!(here.untold(later).len(), 1);
    here.tell_again();
    assert_eq!(here.untold(later + Duration::from_secs(4)).len(), 0);
    assert_eq!(here.untold(later + Duration::from_secs(5)).len(), 1);
}

#[test]
fn of_a_gift_stays_what_was_said() {
    let mut judge = Judge::new(roster(5), |_| false);
    let held = |envelope: Envelope| {
        let Envelope { author: robot, stamp, message: Message::Vote(vote), signature } = envelope else {
            unreachable!()
        };
        gestalt_protocol::HeldVote { robot, stamp, vote, signature }
    };
    let forged = Envelope { signature: said(2, 1, 1.0).signature, ..said(1, 1, 1.0) };
    let votes = vec![held(forged), held(said(2, 1, 1.0))];
    let mut given = hint(Give { decision: None, votes, holders: Vec::new() });
    assert_eq!(judge.passed_on(NOW, &mut given), Some(Distrust::Forged));
    let left = Give { decision: None, votes: vec![held(said(2, 1, 1.0))], holders: Vec::new() };
    assert_eq!(given, hint(left));
    assert_eq!(judge.passed_on(NOW, &mut given), None);
}

#[test]
fn what_others_pass_on_is_heard_in_the_midst_of_a_flood_in_its_authors_name() {
    let mut judge = Judge::new(roster(5), |_| false);
    let forged = |sequence| Envelope { signature: said(2, 1, 1.0).signature, ..said(1, sequence, 1.0) };
    let answers: Vec<_> = (100..2100).map(|sequence| judge.envelope(NOW, &forged(sequence))).collect();
    assert_eq!(answers[1999], Err(Distrust::TooFast));
    let own = said(1, 1, 1.0);
    assert_eq!(judge.envelope(NOW, &own), Err(Distrust::TooFast), "nothing tells it from the others");
    let Envelope { author: robot, stamp, message: Message::Vote(vote), signature } = own.clone() else {
        unreachable!()
    };
    let held = gestalt_protocol::HeldVote { robot, stamp, vote, signature };
    // Whoever heard it gives it,
    let mut given = hint(Give { decision: None, votes: vec![held.clone()], holders: Vec::new() });
    assert_eq!(judge.clone().passed_on(NOW, &mut given), None);
    // decisions rest on it,
    let mut decision = decision(1);
    decision.certificate.others = vec![held];
    assert_eq!(judge.clone().decision(RobotId(1), NOW, &decision), Ok(()));
    // and once it was checked it is believed by whichever way it comes.
    assert_eq!(judge.passed_on(NOW, &mut given), None);
    assert_eq!(judge.envelope(NOW, &own), Ok(()));
}
