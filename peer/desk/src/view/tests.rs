//! One sentence of the view each, and that order and repetition change nothing.

mod names;

use gestalt_protocol::{
    Certificate, ClassId, CountedVote, Decision, FusionRule, Heeded, Instruction, LearningStatus, Outcome,
    Reported, RoundOutcome, Stamp, Terms, Vote,
};
use proptest::prelude::*;

use super::*;

const NOW: Duration = Duration::from_secs(100);

fn labels() -> Vec<String> {
    ["fist", "one", "palm"].map(str::to_owned).to_vec()
}

fn vocabulary() -> Vocabulary {
    Vocabulary::new(labels()).unwrap()
}

fn round(counter: u32) -> RoundId {
    RoundId { counter, opener: RobotId(1), life: 7 }
}

fn status(robot: u32) -> Status {
    let round = Some(round(3));
    Status { vocabulary: labels(), round, ..Status::new(RobotId(robot), format!("robot {robot}"), 1) }
}

/// A decision of robots' votes for classes.
pub(crate) fn decided(counter: u32, class: Option<u32>, votes: &[u32]) -> Announcement {
    let round = round(counter);
    let vote = |(robot, class): (u32, &u32)| {
        let mut evidence = vec![-0.5; 3];
        evidence[*class as usize] = 1.0;
        CountedVote {
            robot: RobotId(robot),
            stamp: Stamp { boot: 1, sequence: 1 },
            class: ClassId(*class),
            weight: 1.0,
            vote: Vote {
                round,
                vocabulary: vocabulary().id(),
                evidence,
                looks: 2.0,
                unknown: None,
                named: vec![],
            },
            signature: None,
        }
    };
    let certificate = Certificate {
        vocabulary: vocabulary().id(),
        rule: FusionRule::LogPool,
        pool: None,
        probabilities: vec![0.1, 0.2, 0.7],
        unknown: None,
        votes: (1..).zip(votes).map(vote).collect(),
        others: Vec::new(),
        robots: 4,
        quorum: 3,
        elapsed_ms: 480,
        named: vec![],
        terms: Terms::default(),
    };
    let class = class.map(ClassId);
    let decision =
        Decision { round, class, confidence: 0.7, author: RobotId(1), is_final: true, certificate };
    let label = class.map(|class| labels()[class.index()].clone());
    let (announcer, stamp) = (RobotId(1), Stamp { boot: 1, sequence: 9 });
    Announcement { decision, label, announcer, stamp, signature: None }
}

fn was(counter: u32, label: &str, at: u64, outcome: Outcome) -> (InstructorId, Answer) {
    let to = Instruction::Was { round: round(counter), class: Gesture::Label(label.to_owned()) };
    let answer = Answer { robot: RobotId(1), at, to, outcome, class: None, samples: 2, looks_like: None };
    ("ada".parse().unwrap(), answer)
}

fn answered((by, answer): (InstructorId, Answer)) -> Input {
    Input::Answered(by, Box::new(answer))
}

fn after(inputs: impl IntoIterator<Item = Input>) -> View {
    let mut view = View::default();
    for input in inputs {
        view.hear(NOW, input);
    }
    view
}

fn decision(announcement: Announcement) -> Input {
    Input::Decided(Box::new(announcement))
}

fn reported(status: Status) -> Input {
    Input::Status(Box::new(status))
}

#[test]
fn a_decision_says_who_voted_for_what_and_who_disagrees() {
    let view =
        after([reported(status(1)), Input::Came(RobotId(1)), decision(decided(1, Some(2), &[2, 2, 1]))]);
    let shown = view.decision().unwrap();
    assert_eq!(shown.label.as_deref(), Some("palm"));
    let votes: Vec<_> =
        shown.votes.iter().map(|vote| (vote.robot.0, vote.label.as_str(), vote.agrees)).collect();
    assert_eq!(votes, [(1, "palm", true), (2, "palm", true), (3, "one", false)]);
    // exp(1) / (exp(1) + 2 exp(-1/2))
    assert!((shown.votes[0].probability - 0.691_438).abs() < 1e-6, "{:?}", shown.votes[0]);
    assert_eq!(
        shown.shares.iter().map(|share| share.label.as_str()).collect::<Vec<_>>(),
        ["fist", "one", "palm"]
    );
}

#[test]
fn who_holds_a_decision_is_counted_until_the_next_is_heard() {
    let holding = |counter| Box::new(decided(counter, Some(2), &[2]).decision.holding(false));
    let mut view = after([
        Input::Came(RobotId(1)),
        Input::Came(RobotId(8)),
        Input::Held(RobotId(1), holding(3)),
        Input::Held(RobotId(8), holding(3)),
        decision(decided(3, Some(2), &[2])),
    ]);
    assert_eq!(view.decision().unwrap().held, 2, "each by its own word");
    view.hear(NOW, Input::Held(RobotId(1), holding(4)));
    assert_eq!(view.decision().unwrap().held, 2);
    view.hear(NOW, decision(decided(4, Some(2), &[2])));
    assert_eq!(view.decision().unwrap().held, 1);
}

#[test]
fn a_robot_is_there_as_long_as_its_token_and_a_late_answer_does_not_bring_it_back() {
    let mut view = after([Input::Came(RobotId(1)), reported(status(1)), Input::Came(RobotId(2))]);
    assert_eq!(view.swarm(NOW).robots.len(), 2);
    assert_eq!(view.hear(NOW, Input::Left(RobotId(1))), Some(Event::Left(RobotId(1))));
    assert_eq!(view.hear(NOW, Input::Left(RobotId(1))), None);
    view.hear(NOW, reported(status(1)));
    assert_eq!(view.swarm(NOW).robots.iter().map(|robot| robot.id.0).collect::<Vec<_>>(), [2]);
    // What never had a token is forgotten.
    view.hear(NOW + 2 * SILENT, Input::Asked(1));
    assert_eq!(view.robots.len(), 1);
}

#[test]
fn whose_samples_a_robot_doubts_is_shown_and_no_more_of_them_than_fit() {
    let heeded = |robot| Heeded { robot: RobotId(robot), held: 40, trained: 3 };
    let learning = LearningStatus { doubted: (2..1000).map(heeded).collect(), ..LearningStatus::default() };
    let view = after([Input::Came(RobotId(1)), reported(Status { learning: Some(learning), ..status(1) })]);
    let swarm = view.swarm(NOW);
    let doubted = &swarm.robots[0].learning.as_ref().unwrap().doubted;
    assert_eq!((doubted.len(), doubted[0]), (64, heeded(2)));
}

#[test]
fn who_does_not_answer_is_said_to_be_silent_and_a_swarm_without_answers_is_trouble() {
    let mut view = after([Input::Came(RobotId(1)), reported(status(1)), Input::Asked(1)]);
    assert!(view.swarm(NOW + SILENT).robots[0].answers);
    assert!(!view.swarm(NOW + SILENT + Duration::from_millis(1)).robots[0].answers);
    view.hear(NOW, Input::Asked(0));
    assert_eq!(view.swarm(NOW + Duration::from_secs(1)).trouble, None);
    let trouble = view.swarm(NOW + Duration::from_secs(3)).trouble.unwrap();
    assert!(trouble.contains("3 s") && trouble.contains("gestalt peer"), "{trouble}");
    view.hear(NOW, Input::Asked(1));
    assert_eq!(view.swarm(NOW + Duration::from_secs(9)).trouble, None);
}

#[test]
fn the_latest_word_judges_a_round_and_a_word_taken_back_does_not() {
    let known = || [reported(status(1)), Input::Came(RobotId(1)), decision(decided(1, Some(2), &[2, 2, 1]))];
    let verdict = |words: Vec<Input>| {
        let view = after(known().into_iter().chain(words));
        let round = view.rounds().pop().unwrap();
        (round.verdict, round.truth, view.curve())
    };
    assert_eq!(verdict(vec![]), (Verdict::Unknown, None, vec![]));
    let wrong = answered(was(1, "one", 5, Outcome::Learned));
    let third = CurvePoint { round: 1, single: 1.0 / 3.0, swarm: 0.0 };
    assert_eq!(verdict(vec![wrong.clone()]), (Verdict::Wrong, Some("one".to_owned()), vec![third]));
    // Said earlier, heard later.
    let right = answered(was(1, "palm", 4, Outcome::Learned));
    assert_eq!(verdict(vec![wrong.clone(), right.clone()]).0, Verdict::Wrong);
    let right_after_all = answered(was(1, "palm", 6, Outcome::Known));
    assert_eq!(verdict(vec![wrong.clone(), right_after_all]).0, Verdict::Right);
    let (by, answer) = was(1, "", 7, Outcome::Learned);
    let undo = Answer { to: Instruction::Retract { round: round(1) }, ..answer };
    assert_eq!(verdict(vec![wrong, answered((by, undo))]), (Verdict::Unknown, None, vec![]));
    let unknown = answered(was(1, "one", 8, Outcome::UnknownGesture));
    assert_eq!(verdict(vec![unknown]).0, Verdict::Unknown, "the swarm did not take it");
}

#[test]
fn what_a_round_showed_is_what_the_swarm_heeds() {
    let truth = |words: &[(&str, Instruction, Outcome, Option<u32>)]| {
        let known = [reported(status(1)), Input::Came(RobotId(1)), decision(decided(1, Some(2), &[2, 2, 1]))];
        let answers = (5..).zip(words).map(|(at, (by, to, outcome, class))| {
            let class = class.map(ClassId);
            let answer = Answer { to: to.clone(), outcome: *outcome, class, ..was(1, "", at, *outcome).1 };
            answered((by.parse().unwrap(), answer))
        });
        let view = after(known.into_iter().chain(answers));
        let shown = view.rounds().pop().unwrap();
        (shown.truth, shown.verdict, view.curve().len())
    };
    let was = |label: &str| was(1, label, 0, Outcome::Learned).1.to;
    let wrong = |class| Instruction::Wrong { round: round(1), of: Gesture::Class(ClassId(class)) };
    let undo = || Instruction::Retract { round: round(1) };
    let ana = ("ana", was("palm"), Outcome::Learned, Some(2));
    let palm = (Some("palm".to_owned()), Verdict::Right, 1);
    let none = (None, Verdict::Unknown, 0);
    for outcome in [Outcome::NotAllowed, Outcome::NoRoom, Outcome::UnknownGesture] {
        assert_eq!(truth(&[("bob", was("one"), outcome, None)]), none, "{outcome:?}");
        assert_eq!(truth(&[ana.clone(), ("bob", was("one"), outcome, Some(2))]), palm, "{outcome:?}");
    }
    // Bob takes back what bob said.
    for class in [Some(2), None] {
        assert_eq!(truth(&[ana.clone(), ("bob", undo(), Outcome::Known, class)]), palm);
    }
    assert_eq!(truth(&[ana.clone(), ("ana", undo(), Outcome::Learned, None)]), none);
    let denied = ("bob", wrong(1), Outcome::Learned, Some(2));
    assert_eq!(truth(&[ana, denied]), palm, "what is said of another gesture denies nothing");
    // Robots that do not learn refuse all of it.
    assert_eq!(truth(&[("bob", was("palm"), Outcome::NotLearning, None)]), palm);
}

#[test]
fn words_about_names_are_counted_and_shown_though_they_name_no_round() {
    let circle = || Gesture::Label("circle".to_owned());
    let words = [
        (Instruction::New { label: "circle".to_owned(), round: None }, Outcome::Learned),
        (Instruction::Same { class: circle(), of: Gesture::Class(ClassId(1)) }, Outcome::Learned),
        (Instruction::Retire { class: circle() }, Outcome::Known),
        (Instruction::Restore { class: circle() }, Outcome::UnknownGesture),
        (Instruction::Open, Outcome::NotAllowed),
    ];
    let mut view = after([reported(status(1)), Input::Came(RobotId(1))]);
    for (at, (to, outcome)) in (5..).zip(words) {
        let (by, answer) = was(1, "", at, outcome);
        let heard = answered((by, Answer { to, ..answer }));
        assert_eq!(view.hear(NOW, heard.clone()), Some(Event::Answered(None)));
        assert_eq!(view.hear(NOW, heard), None, "answered twice, said once");
    }
    let said = view.said();
    let shown = said.iter().rev().map(|it| (it.word, it.gesture.as_deref(), it.of.as_deref()));
    let circle = Some("circle");
    let expected = [
        ("new", circle, None),
        ("same", circle, Some("one")),
        ("retire", circle, None),
        ("restore", circle, None),
        ("open", None, None),
    ];
    assert_eq!(shown.collect::<Vec<_>>(), expected);
    assert!(said.iter().all(|it| it.round.is_none()));
    assert_eq!(view.tally().answers, [2, 1, 0, 0, 1, 0, 1, 0]);
}

#[test]
fn what_is_said_again_is_another_word() {
    let view = after([5, 6, 6].map(|at| answered(was(1, "one", at, Outcome::Known))));
    let said: Vec<_> = view.said().iter().map(|it| (it.at, it.round)).collect();
    assert_eq!(said, [(6, Some(round(1))), (5, Some(round(1)))]);
}

#[test]
fn a_round_says_what_it_came_to_also_without_a_gesture() {
    let outcome = |counter, class| after([decision(decided(counter, class, &[2, 2, 1]))]).rounds()[0].outcome;
    assert_eq!([outcome(1, Some(2)), outcome(2, None)], [RoundOutcome::Gesture, RoundOutcome::Undecided]);
    let mut unlike = decided(3, None, &[2, 2, 1]);
    unlike.decision.certificate.unknown = Some(0.99);
    assert_eq!(after([decision(unlike)]).rounds()[0].outcome, RoundOutcome::Unknown);
}

#[test]
fn a_round_in_which_nobody_could_tell_a_gesture_is_judged_by_what_it_was() {
    let mut blind = decided(1, None, &[]);
    blind.decision.certificate.vocabulary = VocabularyId::NONE;
    let word = answered(was(1, "one", 5, Outcome::Learned));
    let view = after([reported(status(1)), Input::Came(RobotId(1)), decision(blind), word]);
    let shown = view.rounds().pop().unwrap();
    assert_eq!((shown.verdict, shown.truth.as_deref()), (Verdict::Wrong, Some("one")));
    assert_eq!(view.curve(), [CurvePoint { round: 1, single: 0.0, swarm: 0.0 }]);
}

#[test]
fn a_round_that_no_robot_comes_near_does_not_stay_the_newest() {
    let mut view = after([reported(status(1)), Input::Came(RobotId(1)), decision(decided(3, Some(2), &[2]))]);
    view.hear(NOW, decision(decided(u32::MAX, Some(0), &[0])));
    assert_eq!(view.latest().unwrap().decision.round.counter, u32::MAX);
    view.hear(NOW, Input::Asked(1));
    view.hear(NOW, decision(decided(4, Some(1), &[1])));
    assert_eq!(view.latest().unwrap().decision.round.counter, 4);
    assert_eq!(view.rounds().iter().map(|it| it.round.counter).collect::<Vec<_>>(), [3, 4]);
}

#[test]
fn a_swarm_that_starts_again_is_followed_though_it_counts_from_one() {
    let again = |counter| {
        let mut decided = decided(counter, Some(1), &[1]);
        decided.decision.round.life = 8;
        decided
    };
    let at = |round| Status { round, boot: 2, ..status(1) };
    let latest = |view: &View| view.latest().map(|latest| latest.decision.round);
    for before in [1, 5, MAX_ROUNDS as u32 + 9] {
        let mut view =
            after([Input::Came(RobotId(1)), reported(Status { round: Some(round(before)), ..status(1) })]);
        for counter in 1..=before {
            view.hear(NOW, decision(decided(counter, Some(2), &[2])));
        }
        assert_eq!(
            view.hear(NOW, decision(decided(before, Some(2), &[2]))),
            None,
            "an old one again is no news"
        );
        let mut late = again(before.saturating_sub(1));
        late.decision.round.life = 6;
        view.hear(NOW, decision(late));
        assert_eq!(latest(&view), Some(round(before)), "nor is one of before");
        view.hear(NOW, Input::Left(RobotId(1)));
        view.hear(NOW, Input::Came(RobotId(1)));
        view.hear(NOW, reported(at(None)));
        view.hear(NOW, reported(at(Some(RoundId { life: 0, ..round(1) }))));
        let mut first = again(1);
        first.decision.round.life = 0;
        assert!(view.hear(NOW, decision(first.clone())).is_some());
        assert_eq!(latest(&view), Some(first.decision.round));
        assert_eq!(view.rounds().last().map(|round| round.round.counter), Some(1), "the strip ends with it");
        // Where nobody is asked what they know.
        let mut view = after((1..=before).map(|counter| decision(decided(counter, Some(2), &[2]))));
        assert!(view.hear(NOW, decision(again(1))).is_some(), "after {before}");
        assert_eq!(latest(&view), Some(again(1).decision.round));
    }
}

#[test]
fn nothing_grows_without_bound_whoever_speaks() {
    let long = "x".repeat(100_000);
    let mut view = View::default();
    for n in 0..MAX_ROBOTS as u32 + 100 {
        view.hear(NOW, Input::Came(RobotId(n)));
    }
    assert_eq!((view.robots.len(), view.tally().refused), (MAX_ROBOTS, 100));
    let mut liar = status(1);
    liar.name.clone_from(&long);
    liar.errors = vec![Reported { at_ms: 1, what: long.clone() }; 500];
    liar.neighbours = (0..100_000).map(RobotId).collect();
    liar.counters = (0..5_000).map(|n| (format!("made_up_{n}"), 1)).chain([("x\n".to_owned(), 1)]).collect();
    liar.camera.fps = f32::NAN;
    view.hear(NOW, reported(liar));
    let shown = view.swarm(NOW).robots.into_iter().find(|robot| robot.id.0 == 1).unwrap();
    assert!(serde_json::to_string(&shown).unwrap().len() < 20_000);
    assert_eq!(shown.camera.fps, 0.0);
    assert!(view.counters().all(|(_, counters)| counters.len() <= 128 && !counters.contains_key("x\n")));
    for n in 0..1000 {
        view.hear(NOW, decision(decided(n, Some(0), &[0])));
        view.hear(NOW, answered(was(n, &long, u64::from(n), Outcome::Learned)));
    }
    assert_eq!((view.rounds().len(), view.said().len()), (MAX_ROUNDS, MAX_SAID));
    assert!(serde_json::to_string(&view.said()).unwrap().len() < 40_000);
    for n in 0..100 {
        let (_, answer) = was(999, "one", n, Outcome::Learned);
        view.hear(NOW, Input::Answered(format!("made-up-{n}").parse().unwrap(), Box::new(answer)));
    }
    assert!(view.rounds.words() <= MAX_ROUNDS * 16);
}

#[test]
fn a_decision_of_a_vocabulary_that_nobody_reports_has_numbers_for_names() {
    let mut made = decided(1, Some(2), &[2, 1]);
    made.label = None;
    made.decision.confidence = f64::NAN;
    let shown = after([decision(made)]).decision().unwrap();
    assert_eq!((shown.label.as_deref(), shown.confidence), (Some("class 2"), 0.0));
    assert_eq!(shown.votes[1].label, "class 1");
}

/// The same with a confidence of its own, for no two decisions of a round are of one rank unless they are one.
fn ranked(counter: u32, class: Option<u32>, votes: &[u32]) -> Announcement {
    let mut made = decided(counter, class, votes);
    let digits = votes.iter().chain(&class).fold(1_u32, |sum, class| sum * 4 + *class);
    made.decision.confidence = 0.5 + f64::from(digits) / 10_000.0;
    made
}

/// Anything that can be heard, of a swarm in which each robot reports itself once.
fn heard() -> impl Strategy<Value = Input> {
    let robot = || (0_u32..5).prop_map(RobotId);
    let outcome = prop_oneof![Just(Outcome::Learned), Just(Outcome::Known), Just(Outcome::UnknownRound)];
    prop_oneof![
        robot().prop_map(Input::Came),
        robot().prop_map(|robot| reported(status(robot.0))),
        (0_u32..6, proptest::option::of(0_u32..3), proptest::collection::vec(0_u32..3, 0..4))
            .prop_map(|(counter, class, votes)| decision(ranked(counter, class, &votes))),
        (robot(), 0_u32..6, 0_u32..3).prop_map(|(robot, counter, class)| {
            let holding = ranked(counter, Some(class), &[class]).decision.holding(false);
            Input::Held(robot, Box::new(holding))
        }),
        (0_u32..6, 0_usize..3, outcome).prop_map(|(counter, class, outcome)| {
            // A word is known by its time, so one time has one word.
            let at = u64::from(counter) * 100 + class as u64 * 10 + outcome as u64;
            answered(was(counter, &labels()[class], at, outcome))
        }),
        (0_usize..3, robot()).prop_map(|(class, robot)| {
            let (by, answer) = was(0, "", 10_000 + class as u64, Outcome::Learned);
            let to = Instruction::Retire { class: Gesture::Label(labels()[class].clone()) };
            answered((by, Answer { to, robot, ..answer }))
        }),
    ]
}

proptest! {
    #[test]
    fn order_and_repetition_change_nothing(
        (inputs, other) in proptest::collection::vec(heard(), 0..40)
            .prop_flat_map(|inputs| (Just(inputs.clone()), Just([inputs.clone(), inputs].concat()).prop_shuffle()))
    ) {
        let (view, other) = (after(inputs), after(other));
        prop_assert_eq!(view.swarm(NOW), other.swarm(NOW));
        prop_assert_eq!(view.decision(), other.decision());
        prop_assert_eq!(view.rounds(), other.rounds());
        prop_assert_eq!(view.curve(), other.curve());
        let said = |view: &View| {
            let mut said: Vec<String> = view.said().iter().map(|said| format!("{said:?}")).collect();
            said.sort();
            said
        };
        prop_assert_eq!(said(&view), said(&other));
    }
}
