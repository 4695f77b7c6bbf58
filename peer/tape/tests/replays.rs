//! What a recorded run proves, and what would have been.

mod made;

use std::collections::BTreeMap;
use std::io::Cursor;
use std::time::Duration;

use gestalt_protocol::{
    Announcement, Answer, ClassId, FusionRule, Gesture, Instruction, InstructorId, LearningStatus,
    NamedGesture, Outcome, RobotId, RoundId, Status, Topic,
};
use gestalt_rounds::{Quorum, RoundsConfig};
use gestalt_tape::{Passing, Run, Score, TapeWriter, Truth, WhatIf, outcomes, prove, read};
use made::{BEGIN, SECOND, Seer, decisions, json, keys, knowing, named, round, round_of, run, said, status};
use proptest::prelude::*;

/// The rule by which the rounds here were made: what it takes to decide is plain to see.
fn log_pool() -> RoundsConfig {
    RoundsConfig { rule: FusionRule::LogPool, ..RoundsConfig::default() }
}

/// These, recorded and read again.
fn replayed(passed: &[Passing]) -> Run {
    let mut writer = TapeWriter::new(Vec::new(), BTreeMap::new()).unwrap();
    for passing in passed {
        writer.write(&passing.entry(&keys()).unwrap()).unwrap();
    }
    let bytes = writer.finish(BTreeMap::new()).unwrap();
    let mut run = Run::default();
    read(&mut Cursor::new(bytes), |recorded| run.add(&recorded)).unwrap();
    run
}

#[test]
fn every_decision_is_drawn_again_bit_for_bit() {
    let run = replayed(&run());
    assert_eq!((run.showings.len(), run.strange), (3, 0));
    assert_eq!(run.robots().len(), 4);
    let proof = prove(&run.showings, &log_pool());
    assert_eq!((proof.reproduced, proof.differences), (3, vec![]));
    assert!(proof.heard >= 10 && proof.unheard == 0, "{} votes", proof.heard);
    let classes: Vec<_> = run.showings.iter().map(|showing| showing.decision().unwrap().class).collect();
    assert_eq!(classes[0], Some(ClassId(2)));
    assert_eq!(classes[2], None, "one of four has seen something, and is not sure");
}

/// Robots vote by one list, whatever each of them knows beside it.
#[test]
fn what_was_named_since_is_drawn_again_whoever_knows_of_it() {
    let robot = |labels: &[&str], sees: &[f32]| Seer { knows: knowing(labels), sees: Some(sees.to_vec()) };
    let of_the_list = [
        robot(&["circle"], &[0.05, 0.05, 0.8, 0.1]),
        robot(&[], &[0.1, 0.1, 0.8]),
        robot(&["loop", "circle"], &[0.05, 0.05, 0.7, 0.1, 0.1]),
    ];
    let named_since = [
        robot(&["circle"], &[0.05, 0.05, 0.05, 0.85]),
        robot(&["loop", "circle"], &[0.05, 0.05, 0.05, 0.05, 0.8]),
        robot(&[], &[0.3, 0.3, 0.4]),
    ];
    let of_no_gesture = [
        robot(&["circle"], &[0.25, 0.25, 0.25, 0.25, 40.0]),
        robot(&[], &[0.3, 0.3, 0.4, 40.0]),
        robot(&["circle"], &[0.25, 0.25, 0.25, 0.25, 40.0]),
    ];
    for (robots, class) in
        [(of_the_list, Some(ClassId(2))), (named_since, Some(named("circle"))), (of_no_gesture, None)]
    {
        let run = replayed(&round_of(&log_pool(), &robots, BEGIN));
        let decision = run.showings[0].decision().unwrap();
        assert_eq!(decision.class, class);
        assert!(decision.certificate.named.contains(&named("circle")));
        let proof = prove(&run.showings, &log_pool());
        assert_eq!((proof.reproduced, proof.differences), (1, vec![]));
        let would = outcomes(&run, &WhatIf::default(), &log_pool());
        assert_eq!(would[0].would, class, "as it was");
    }
}

/// What is changed in the first decision is found, and named.
#[test]
fn the_first_difference_is_named() {
    type Change = fn(&mut Announcement);
    let changes: [(&str, Change); 8] = [
        ("the probability of class 1", |it| it.decision.certificate.probabilities[1] += 1e-16),
        ("the confidence", |it| it.decision.confidence -= 1e-12),
        ("the class", |it| it.decision.class = Some(ClassId(0))),
        ("the class", |it| it.decision.class = None),
        ("the quorum", |it| it.decision.certificate.quorum = 2),
        ("the probability of class 0", |it| drop(it.decision.certificate.votes.pop())),
        ("the weight of robot 1", |it| it.decision.certificate.votes[0].weight = 0.5),
        ("vote 1.", |it| it.decision.certificate.others[0].vote.looks = 3.0),
    ];
    let passed = run();
    let at = passed.iter().position(|passing| passing.topic == Topic::Decision).unwrap();
    for (named, change) in changes {
        let mut announced: Announcement = serde_json::from_slice(&passed[at].payload).unwrap();
        change(&mut announced);
        let mut passed = passed.clone();
        passed[at].payload = json(&announced);
        let proof = prove(&replayed(&passed).showings, &log_pool());
        assert_eq!((proof.reproduced, proof.differences.len()), (2, 1), "{named}: {:?}", proof.differences);
        let words = proof.differences[0].to_string();
        assert!(words.contains(named) && words.contains("round 1@"), "{words}");
    }
}

#[test]
fn votes_that_passed_the_recorder_by_are_counted_and_take_nothing_from_the_proof() {
    let only: Vec<Passing> = run().into_iter().filter(|passing| passing.topic == Topic::Decision).collect();
    let proof = prove(&replayed(&only).showings, &log_pool());
    assert_eq!((proof.reproduced, proof.heard), (3, 0));
    assert!(proof.unheard >= 10);
}

#[test]
fn another_configuration_than_the_swarms_is_suspected_by_name() {
    let run = replayed(&run());
    let config = RoundsConfig { quorum: Quorum::Evidence(2), ..log_pool() };
    let words = prove(&run.showings, &config).differences[0].to_string();
    assert!(words.contains("the quorum is 3") && words.contains("--config"), "{words}");
    assert_eq!(run.quorum(), Some(Quorum::Majority), "the certificates say it");
}

#[test]
fn as_it_was_it_ends_as_it_did() {
    let run = replayed(&run());
    let config = log_pool();
    let outcomes = outcomes(&run, &WhatIf::default(), &config);
    assert!(outcomes.iter().all(|outcome| outcome.would == outcome.happened), "{outcomes:?}");
    let score = Score::of(&outcomes);
    assert_eq!(
        (score.rounds, score.known, score.right, score.wrong, score.undecided),
        (3, 3, 1, 1, 1),
        "{score:?}"
    );
}

#[test]
fn each_question_changes_what_it_asks_about_and_nothing_else() {
    let run = replayed(&run());
    let was = log_pool();
    let would = |what: WhatIf| -> Vec<Option<u32>> {
        let config = what.config(&was).unwrap();
        outcomes(&run, &what, &config).iter().map(|it| it.would.map(|class| class.0)).collect()
    };
    let nobody = WhatIf { quorum: Some(Quorum::Evidence(5)), ..WhatIf::default() };
    assert_eq!(would(nobody), [None; 3], "five of four");
    let bold = WhatIf {
        quorum: Some(Quorum::Evidence(1)),
        alpha: Some(0.49),
        rule: Some(FusionRule::Majority),
        ..WhatIf::default()
    };
    assert_eq!(would(bold)[2], Some(0), "one robot that leans that way");
    let early = WhatIf { until: Some(Duration::ZERO), ..WhatIf::default() };
    assert_eq!(would(early), [None; 3], "nothing was said yet");
    let late = WhatIf { until: Some(Duration::from_secs(60)), ..WhatIf::default() };
    assert_eq!(would(late)[0], Some(2));
    let without = WhatIf { without: (1..=3).map(RobotId).collect(), ..WhatIf::default() };
    assert_eq!(would(without)[0], None, "who is left saw nothing");
    assert!(WhatIf { alpha: Some(0.9), ..WhatIf::default() }.config(&was).is_err());
    let named =
        WhatIf { quorum: Some(Quorum::Evidence(4)), rule: Some(FusionRule::Majority), ..WhatIf::default() };
    assert_eq!(named.to_string(), "majority, quorum 4");
}

#[test]
fn the_last_word_of_each_person_counts_and_contradiction_is_no_truth() {
    let name = decisions(&run())[0].round;
    let truth = |words: &[(&str, Instruction)]| {
        let mut passed = run();
        passed.retain(|passing| !matches!(passing.topic, Topic::Feedback(_)));
        for (i, (by, word)) in (0..).zip(words) {
            passed.push(said(Topic::Feedback(by.parse().unwrap()), json(word), BEGIN + 2 * SECOND + i));
        }
        let run = replayed(&passed);
        run.truth(&run.showings[0])
    };
    let class = |class| Gesture::Class(ClassId(class));
    let was = |label: &str| Instruction::Was { round: name, class: Gesture::Label(label.to_owned()) };
    assert_eq!(truth(&[]), None);
    assert_eq!(truth(&[("ada", was("one")), ("ada", was("palm"))]), Some(Truth::Is(ClassId(2))));
    assert_eq!(truth(&[("ada", was("one")), ("ada", Instruction::Retract { round: name })]), None);
    assert_eq!(truth(&[("ada", was("one")), ("bob", was("palm"))]), None);
    assert_eq!(truth(&[("ada", was("unheard of"))]), None);
    let (right, wrong) =
        (Instruction::Right { round: name, of: class(2) }, Instruction::Wrong { round: name, of: class(2) });
    assert_eq!(truth(&[("ada", right.clone())]), Some(Truth::Is(ClassId(2))));
    assert_eq!(truth(&[("ada", wrong.clone())]), Some(Truth::IsNot(ClassId(2))));
    assert_eq!(truth(&[("ada", right), ("bob", wrong.clone())]), None);
    assert_eq!(truth(&[("ada", wrong), ("bob", was("fist"))]), Some(Truth::Is(ClassId(0))));
}

#[test]
fn words_that_robots_refused_are_no_truth_and_one_unheard_of_gesture_silences_nobody() {
    let name = decisions(&run())[0].round;
    let was = |label: &str| Instruction::Was { round: name, class: Gesture::Label(label.to_owned()) };
    let truth = |words: &[(&str, &str, Option<Outcome>)]| {
        let mut passed = run();
        passed.retain(|passing| !matches!(passing.topic, Topic::Feedback(_)));
        for (i, (by, label, answered)) in (0..).zip(words) {
            let (by, at, word): (InstructorId, _, _) =
                (by.parse().unwrap(), BEGIN + 2 * SECOND + i, was(label));
            passed.push(said(Topic::Feedback(by.clone()), json(&word), at));
            if let Some(outcome) = *answered {
                let (robot, class, samples) = (RobotId(1), None, 0);
                let answer = Answer { robot, at, to: word, outcome, class, samples, looks_like: None };
                passed.push(said(Topic::Answer(by), json(&answer), at));
            }
        }
        let run = replayed(&passed);
        run.truth(&run.showings[0])
    };
    let palm = Some(Truth::Is(ClassId(2)));
    let (learned, slip) = (Some(Outcome::Learned), Some(Outcome::UnknownGesture));
    assert_eq!(truth(&[("ada", "palm", learned), ("ada", "plam", slip)]), palm);
    let forged = Some(Outcome::NotAllowed);
    assert_eq!(
        truth(&[("ada", "palm", learned), ("ada", "fist", forged)]),
        palm,
        "in her name, without her key"
    );
    assert_eq!(truth(&[("ada", "palm", Some(Outcome::NotLearning))]), palm, "nobody learns there");
    for answered in [None, slip] {
        assert_eq!(truth(&[("ada", "plam", answered), ("bob", "palm", learned)]), palm);
    }
}

/// Of a swarm in which not all learn: only those that do have heard of what was named.
#[test]
fn a_gesture_that_was_named_is_called_so_whoever_reports_last() {
    let circle = NamedGesture { class: named("circle"), label: "circle".to_owned(), samples: 3 };
    let learner = || {
        let learning = LearningStatus { named: vec![circle.clone()], ..LearningStatus::default() };
        Status { learning: Some(learning), ..status() }
    };
    let other = || Status { robot: RobotId(2), ..status() };
    for statuses in [[learner(), other()], [other(), learner()]] {
        let told = |status: &Status| said(Topic::Status(status.robot), json(status), BEGIN);
        let run = replayed(&statuses.iter().map(told).collect::<Vec<_>>());
        let id = knowing(&[]).id();
        assert_eq!(run.label(id, named("circle")), Some("circle"));
        assert_eq!(run.label(id, ClassId(2)), Some("palm"));
    }
}

/// After an hour, and also where all robots started again within seconds.
#[test]
fn a_count_that_begins_anew_is_another_showing() {
    let config = log_pool();
    let sees = [Some([0.1, 0.2, 0.7]); 3];
    for later in [3600 * SECOND, 20 * SECOND] {
        let mut passed = round(&config, &sees, BEGIN);
        let again: Vec<Passing> = round(&config, &sees, BEGIN + later + 1);
        passed.extend(again);
        let run = replayed(&passed);
        assert_eq!(run.showings.len(), 2);
        let counters: Vec<u32> = run.showings.iter().map(|showing| showing.name().unwrap().counter).collect();
        assert_eq!(counters, [1, 1]);
        assert!(run.showings[0].rounds.iter().all(|RoundId { counter, .. }| *counter == 1));
    }
}

/// What a robot knows beside the list, and sees of all that: shares, of which those of the gestures that it knows are taken, and what it finds unknown.
fn seer(knows: [bool; 2], sees: Option<[f32; 5]>, unknown: Option<f32>) -> Seer {
    let labels: Vec<&str> =
        ["circle", "loop"].into_iter().zip(knows).filter(|it| it.1).map(|it| it.0).collect();
    let knows = knowing(&labels);
    let sees = sees.map(|shares| {
        let shares = &shares[..knows.classes()];
        let sum: f32 = shares.iter().sum();
        shares.iter().map(|share| share / sum).chain(unknown).collect()
    });
    Seer { knows, sees }
}

/// One that may be blind, and may tell what is unknown.
fn seers() -> impl Strategy<Value = Vec<Seer>> {
    let share = || 0.01f32..1.0;
    let sees = prop::option::weighted(0.8, [share(), share(), share(), share(), share()]);
    let one = (any::<[bool; 2]>(), sees, prop::option::of(0.01f32..4.0));
    prop::collection::vec(one.prop_map(|(knows, sees, unknown)| seer(knows, sees, unknown)), 1..7)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn whatever_robots_know_and_see_and_however_they_count_their_decisions_are_drawn_again(
        robots in seers(),
        rule in 0..4usize, liars in 0..2u32, alpha in prop::option::of(0.01f64..0.49),
    ) {
        let config = RoundsConfig { rule: FusionRule::ALL[rule], liars, alpha, ..log_pool() };
        let run = replayed(&round_of(&config, &robots, BEGIN));
        let proof = prove(&run.showings, &config);
        prop_assert_eq!((proof.reproduced, proof.differences), (1, vec![]));
        let same = outcomes(&run, &WhatIf::default(), &config);
        prop_assert!(same.iter().all(|outcome| outcome.would == outcome.happened));
    }
}
