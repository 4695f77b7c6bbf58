//! What the swarm asks, and what comes of it.

use gestalt_protocol::{Ask, Question, Stamp};

use super::*;
use crate::asking::QuestionsConfig;

/// Sees the gesture of the first feature as far as the second says: 1 is sure, ½ cannot tell it from the next one.
#[derive(Debug)]
struct Torn;

impl Classify for Torn {
    fn vocabulary(&self) -> &Vocabulary {
        ByFirst.vocabulary()
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        let (shown, next) = (features[0] as usize, features[0] as usize + 1);
        let sure = f64::from(features[1]);
        let p = |class| match class {
            _ if class == shown => 0.96 * sure,
            _ if class == next => 0.96 * (1.0 - sure),
            _ => 0.01,
        };
        Ok((0..CLASSES as usize).map(p).collect())
    }
}

/// Robots that learn with these questions, and judge as [`Torn`].
fn swarm(n: usize, questions: QuestionsConfig) -> Swarm {
    let mut swarm = Swarm::new(n, LearningConfig { questions, ..config(2, 1.0) }, 5);
    for i in 0..n {
        swarm.input(i, Input::Learned(Arc::new(Torn)));
    }
    swarm
}

/// Shows a gesture of which each robot is as sure as said, and waits until all is over and an answer would be too.
fn show(swarm: &mut Swarm, class: u8, sure: &[f32]) -> RoundId {
    swarm.input(sure.len() - 1, Input::Open);
    for _ in 0..3 {
        for (i, sure) in sure.iter().enumerate() {
            let mut features: Vec<f32> = (0..8).map(|_| swarm.rng.random::<f32>() * 0.9).collect();
            (features[0], features[1]) = (f32::from(class), *sure);
            swarm.input(i, Input::Observed(Observation { features, quality: 1.0 }));
        }
        swarm.pass(Duration::from_millis(500));
    }
    swarm.pass(Duration::from_secs(8));
    swarm.minds[0].round().unwrap()
}

const SURE: [f32; 3] = [1.0; 3];
const SPLIT: [f32; 3] = [0.97, 0.03, 0.5];

/// Until a question may be asked.
fn rest(swarm: &mut Swarm) {
    for _ in 0..2 {
        show(swarm, 1, &SURE);
    }
    assert_eq!(swarm.asked, [], "it is too soon");
}

/// Until a question may be asked, and two gestures are known from more than a model.
fn tell_two(swarm: &mut Swarm) {
    for class in [1, 2] {
        let round = show(swarm, class, &SURE);
        swarm.was(round, class.into());
    }
    assert_eq!(swarm.asked, [], "it is too soon");
}

/// The likeliest gesture of each question.
fn asked_about(swarm: &Swarm) -> Vec<ClassId> {
    swarm.asked.iter().map(|(_, question)| question.ask.classes()[0]).collect()
}

fn last(swarm: &Swarm) -> &Question {
    &swarm.asked.last().expect("it asks").1
}

#[test]
fn robots_that_disagree_ask_between_two_once_and_not_again_for_three_rounds() {
    let mut swarm = swarm(3, QuestionsConfig::default());
    tell_two(&mut swarm);
    let round = show(&mut swarm, 2, &SPLIT);
    let question = last(&swarm).clone();
    assert_eq!((question.round, question.robot), (round, RobotId(1)), "the spokesrobot, once");
    assert_eq!(question.ask, Ask::Between { classes: [ClassId(2), ClassId(3)] });
    assert_eq!(question.labels, ["2", "3"]);
    assert!(question.disagreement > 0.1 && question.entropy > 0.35, "{question:?}");
    let mut asked = vec![round];
    for _ in 0..6 {
        let round = show(&mut swarm, 2, &SPLIT);
        if swarm.asked.len() > asked.len() {
            asked.push(round);
        }
    }
    let rounds: Vec<u32> = asked.iter().map(|round| round.counter).collect();
    assert_eq!(rounds, [3, 6, 9], "{:?}", swarm.asked);
    let apart = swarm.asked.windows(2).all(|pair| pair[1].0 - pair[0].0 >= Duration::from_secs(10));
    assert!(apart, "{:?}", swarm.asked);
}

/// Asks all robots, in the name of a stranger.
fn ask(swarm: &mut Swarm, round: RoundId) {
    ask_as(swarm, RobotId(9), round);
}

fn ask_as(swarm: &mut Swarm, robot: RobotId, round: RoundId) {
    let question = Question {
        round,
        ask: Ask::Name { nearest: None },
        labels: vec![],
        entropy: 1.0,
        disagreement: 1.0,
        robot,
        stamp: Stamp { boot: 9, sequence: 9 },
        signature: None,
    };
    for i in 0..swarm.minds.len() {
        swarm.input(i, Input::Asked(question.clone()));
    }
}

#[test]
fn what_no_robot_would_ask_now_is_refused_and_keeps_nobody_from_asking() {
    let mut swarm = swarm(3, QuestionsConfig::default());
    let (mut asked, mut rounds): (Vec<(RoundId, Question)>, Vec<RoundId>) = (Vec::new(), Vec::new());
    for n in 0..9 {
        let round = show(&mut swarm, 2, if n < 2 { &SURE } else { &SPLIT });
        if swarm.asked.len() > asked.len() {
            asked.push((round, last(&swarm).clone()));
            // One that was asked already, by whoever; and one that was answered.
            ask(&mut swarm, round);
        }
        let unknown = RoundId { counter: round.counter + 5, ..round };
        for old in rounds.iter().chain([&unknown]).copied() {
            (0..20).for_each(|_| ask(&mut swarm, old));
        }
        // What honest robots asked long ago, said again.
        for (_, question) in &asked[..asked.len().saturating_sub(1)] {
            for i in 1..3 {
                swarm.input(i, Input::Asked(question.clone()));
            }
        }
        if let Some((_, open)) = asked.last() {
            assert!(swarm.minds.iter().all(|mind| mind.question().is_none_or(|it| it == open)));
        }
        swarm.input(0, Input::Open);
        assert!(swarm.minds[0].is_open());
        let open = swarm.minds[0].round().unwrap();
        ask(&mut swarm, open);
        swarm.pass(Duration::from_secs(8));
        swarm.was(open, 1);
        ask(&mut swarm, open);
        swarm.pass(Duration::from_secs(1));
        rounds.extend([round, open]);
    }
    let apart: Vec<u32> = asked.windows(2).map(|pair| pair[1].0.counter - pair[0].0.counter).collect();
    assert!(asked.len() >= 3 && apart.iter().all(|apart| (3..=6).contains(apart)), "{asked:?}");
    let refused = swarm.minds[1].refusals().count(Refusal::Untimely);
    assert!(refused > 1000, "{refused}");
}

/// Two liars together, or one alone, and each from the first moment on.
#[test]
fn whoever_asks_as_soon_as_a_round_is_over_has_every_other_turn_at_most() {
    for liars in [&[RobotId(3)][..], &[RobotId(2), RobotId(3)]] {
        let mut swarm = swarm(3, QuestionsConfig::default());
        let mut turns: Vec<RobotId> = Vec::new();
        for _ in 0..40 {
            swarm.input(2, Input::Open);
            for _ in 0..3 {
                for (i, sure) in SPLIT.into_iter().enumerate() {
                    let features = vec![2.0, sure, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6];
                    swarm.input(i, Input::Observed(Observation { features, quality: 1.0 }));
                }
                swarm.pass(Duration::from_millis(500));
            }
            let round = swarm.minds[0].round().unwrap();
            let mut turn = None;
            for _ in 0..160 {
                swarm.pass(Duration::from_millis(50));
                liars.iter().for_each(|liar| ask_as(&mut swarm, *liar, round));
                turn = turn.or(swarm.minds[0].question().filter(|it| it.round == round).map(|it| it.robot));
            }
            turns.extend(turn);
        }
        let are_lies: Vec<bool> = turns.iter().map(|robot| liars.contains(robot)).collect();
        assert!(turns.len() >= 12, "{turns:?}");
        assert!(are_lies.contains(&true) && are_lies.windows(2).all(|two| two != [true, true]), "{turns:?}");
    }
}

#[test]
fn a_question_is_of_the_newest_round_by_whichever_of_its_names() {
    let mut swarm = swarm(3, QuestionsConfig { ask: false, ..QuestionsConfig::default() });
    rest(&mut swarm);
    // All open at once, before they hear of each other.
    swarm.loss = 1.0;
    (0..3).for_each(|i| swarm.input(i, Input::Open));
    swarm.loss = 0.0;
    let alias = swarm.minds[2].round().unwrap();
    let round = show(&mut swarm, 2, &SPLIT);
    assert_eq!((round.counter, alias.opener, round.opener), (alias.counter, RobotId(3), RobotId(1)));
    ask_as(&mut swarm, RobotId(1), alias);
    assert_eq!(swarm.minds[2].question().map(|question| question.round), Some(alias));
}

#[test]
fn robots_that_are_as_unsure_as_each_other_ask_to_be_shown_again_what_they_were_told_often() {
    let mut swarm = swarm(3, QuestionsConfig { familiar: 1.0, ..QuestionsConfig::default() });
    for class in [2, 3, 1] {
        let round = show(&mut swarm, class, &SURE);
        swarm.was(round, class.into());
    }
    swarm.asked.clear();
    rest(&mut swarm);
    rest(&mut swarm);
    show(&mut swarm, 2, &[0.5; 3]);
    assert_eq!(last(&swarm).ask, Ask::Again { nearest: ClassId(2) });
}

#[test]
fn what_is_known_from_a_model_alone_is_asked_about_until_it_was_said_once() {
    let mut swarm = swarm(3, QuestionsConfig::default());
    rest(&mut swarm);
    for (class, asked) in [(1, 1), (2, 2)] {
        for _ in 0..3 {
            show(&mut swarm, class, &SURE);
        }
        assert_eq!(swarm.asked.len(), asked, "{:?}", swarm.asked);
        let Ask::Between { classes: [first, _] } = last(&swarm).ask else { panic!("{:?}", last(&swarm)) };
        assert_eq!(first, ClassId(class.into()));
        let round = last(&swarm).round;
        swarm.was(round, class.into());
    }
    for class in [1, 2].repeat(6) {
        show(&mut swarm, class, &SURE);
    }
    assert_eq!(swarm.asked.len(), 2, "{:?}", swarm.asked);
}

#[test]
fn where_nobody_answers_a_sure_swarm_asks_about_each_gesture_once() {
    let mut swarm = swarm(3, QuestionsConfig::default());
    for class in [1, 2].repeat(12) {
        show(&mut swarm, class, &SURE);
    }
    let asked = asked_about(&swarm);
    assert_eq!(asked.len(), 2, "{:?}", swarm.asked);
    assert_ne!(asked[0], asked[1]);
    // Somebody speaks of a third: whoever that is may know of those two.
    for _ in 0..2 {
        show(&mut swarm, 3, &SURE);
    }
    let round = last(&swarm).round;
    swarm.was(round, 3);
    for class in [1, 2].repeat(12) {
        show(&mut swarm, class, &SURE);
    }
    assert_eq!(asked_about(&swarm).len(), 5, "{:?}", swarm.asked);
}

#[test]
fn robots_that_are_as_unsure_as_each_other_ask_which_it_is_of_what_they_were_hardly_told() {
    let mut swarm = swarm(3, QuestionsConfig::default());
    tell_two(&mut swarm);
    show(&mut swarm, 2, &[0.5; 3]);
    assert_eq!(last(&swarm).ask, Ask::Between { classes: [ClassId(2), ClassId(3)] });
}

#[test]
fn a_word_settles_it_and_can_be_taken_back_and_silence_is_no_label() {
    let mut swarm = swarm(3, QuestionsConfig::default());
    rest(&mut swarm);
    let round = show(&mut swarm, 2, &SPLIT);
    assert!(swarm.minds.iter().all(|mind| mind.question().is_some_and(|it| it.round == round)));
    let at = swarm.was(round, 3);
    assert_eq!(swarm.outcome(at), Outcome::Learned);
    assert!(swarm.minds.iter().all(|mind| mind.question().is_none()));
    assert_eq!(swarm.sizes(1)[1..], [2, 4], "it labels what was seen");
    let at = swarm.say("ada", Instruction::Retract { round });
    assert_eq!((swarm.outcome(at), swarm.sizes(1)), (Outcome::Learned, [0, 0, 0]));
    // Nobody answers the next.
    show(&mut swarm, 2, &SPLIT);
    show(&mut swarm, 2, &SPLIT);
    let before = swarm.asked.len();
    show(&mut swarm, 2, &SPLIT);
    assert_eq!(swarm.asked.len(), before + 1);
    swarm.pass(Duration::from_secs(20));
    assert!(swarm.minds.iter().all(|mind| mind.question().is_none()), "gone");
    assert_eq!(swarm.sizes(1), [0, 0, 0]);
}

#[test]
fn nothing_is_asked_about_what_was_said_in_time() {
    let mut swarm =
        swarm(3, QuestionsConfig { after: Duration::from_secs(12), ..QuestionsConfig::default() });
    rest(&mut swarm);
    let round = show(&mut swarm, 2, &SPLIT);
    swarm.was(round, 2);
    swarm.pass(Duration::from_secs(20));
    assert_eq!(swarm.asked, []);
    // Nor of one whose word was taken back: its instructor knows of it.
    let round = show(&mut swarm, 2, &SPLIT);
    swarm.was(round, 2);
    swarm.say("ada", Instruction::Retract { round });
    swarm.pass(Duration::from_secs(20));
    assert_eq!(swarm.asked, []);
}

#[test]
fn who_speaks_for_the_swarm_after_another_counts_what_that_asked() {
    let mut swarm = swarm(3, QuestionsConfig::default());
    rest(&mut swarm);
    show(&mut swarm, 2, &SPLIT);
    assert_eq!(last(&swarm).robot, RobotId(1));
    // The first is not there to the others, leaves it to them to speak and asks nothing; the second speaks.
    swarm.config.questions.ask = false;
    swarm.restart(0);
    swarm.input(0, Input::Alive(Arc::new([RobotId(0), RobotId(2), RobotId(3)].into())));
    let left: BTreeSet<RobotId> = [RobotId(2), RobotId(3)].into();
    for i in 1..3 {
        swarm.input(i, Input::Alive(Arc::new(left.clone())));
    }
    let asked = |swarm: &Swarm| swarm.asked.iter().filter(|(_, it)| it.robot == RobotId(2)).count();
    for _ in 0..2 {
        show(&mut swarm, 2, &SPLIT);
        assert_eq!(asked(&swarm), 0);
    }
    show(&mut swarm, 2, &SPLIT);
    assert_eq!(asked(&swarm), 1);
}

#[test]
fn who_was_never_taught_anything_asks_for_a_name_when_it_is_shown_twice() {
    let mut swarm = Swarm::new(2, config(2, 1.0), 5);
    // Minds without a classifier: that of `introduce` is not theirs.
    for i in 0..2 {
        swarm.minds[i] = swarm.waken(i);
        let both: BTreeSet<RobotId> = [RobotId(1), RobotId(2)].into();
        swarm.input(i, Input::Alive(Arc::new(both.clone())));
        swarm.input(i, Input::Neighbours(both));
    }
    let rounds: Vec<RoundId> = (0..3).map(|_| show(&mut swarm, 4, &[1.0, 1.0])).collect();
    assert_eq!(swarm.asked.len(), 1, "{:?}", swarm.asked);
    let question = last(&swarm);
    assert_eq!((question.round, question.ask), (rounds[2], Ask::Name { nearest: None }));
    assert_eq!((question.entropy, question.disagreement), (0.0, 0.0));
}

#[test]
fn who_is_not_to_ask_does_not() {
    let mut swarm = swarm(3, QuestionsConfig { ask: false, ..QuestionsConfig::default() });
    for _ in 0..8 {
        show(&mut swarm, 2, &SPLIT);
    }
    assert_eq!(swarm.asked, []);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn whatever_is_shown_and_said_it_asks_seldom_and_never_in_an_open_round(
        steps in prop::collection::vec((0u8..5, 0u8..4, 0u64..9, prop::bool::ANY), 1..25),
        seed in 0u64..1000,
    ) {
        let mut swarm = swarm(3, QuestionsConfig::default());
        swarm.rng = ChaCha8Rng::seed_from_u64(seed);
        for (class, sure, seconds, answers) in steps {
            // Some showings follow each other so soon that the round before is cut short; `input` asserts that no round is open.
            swarm.input(usize::from(class) % 3, Input::Open);
            for i in 0..3 {
                let mut features: Vec<f32> = (0..8).map(|_| swarm.rng.random::<f32>() * 0.9).collect();
                (features[0], features[1]) = (f32::from(class), if sure == 0 { swarm.rng.random() } else { 1.0 });
                swarm.input(i, Input::Observed(Observation { features, quality: 1.0 }));
            }
            swarm.pass(Duration::from_secs(seconds));
            if answers && let Some(round) = swarm.minds[0].round() {
                swarm.was(round, class.into());
            }
        }
        for pair in swarm.asked.windows(2) {
            let [(at, first), (then, second)] = pair else { unreachable!() };
            prop_assert!(second.round.counter >= first.round.counter + 3, "{first:?} {second:?}");
            prop_assert!(*then - *at >= Duration::from_secs(10), "{first:?} {second:?}");
        }
        for (_, question) in &swarm.asked {
            prop_assert!(question.check().is_ok(), "{question:?}");
        }
    }
}
