//! What a robot says, and whose votes it counts.

use gestalt_protocol::Pool;

use super::*;
use crate::machine::Follow;

#[test]
fn votes_are_said_on_change_at_a_bounded_rate_and_repeated_while_open() {
    let mut mind = mind_with(7, RoundsConfig { alpha: Some(1e-9), ..adding_up() });
    mind.handle(ms(0), Input::Open);
    let mut said = Vec::new();
    for t in (20..2000).step_by(20) {
        let out = mind.handle(ms(t), saw([0.4, 0.3, 0.3]));
        said.extend(broadcast(&out).iter().map(|vote| (t, vote.looks)));
    }
    assert_eq!(said.len(), 7, "one each 250 ms: {said:?}");
    assert!(said.is_sorted_by(|a, b| a.1 <= b.1) && said[0].1 < said[6].1, "the whole sum so far");
    let later: Vec<_> =
        live(&mut mind, ms(4500)).into_iter().filter(|(_, o)| matches!(o, Output::Broadcast(_))).collect();
    assert_eq!(later.iter().map(|(at, _)| *at).collect::<Vec<_>>(), [ms(2070), ms(3070), ms(4070)]);
    assert_eq!(later[1].1, later[2].1, "a repeated vote is the same message");
}

#[test]
fn frames_outside_a_round_count_for_nothing() {
    let mut mind = mind(7);
    mind.handle(ms(0), saw([0.9, 0.05, 0.05]));
    mind.handle(ms(10), Input::Open);
    mind.handle(ms(300), Input::Tick);
    assert_eq!(mind.held(), None);
    assert_eq!(mind.refusals(), &Refusals::default());
}

#[test]
fn a_frame_that_cannot_be_judged_is_counted_and_never_becomes_a_vote() {
    let mut seeing = mind(7);
    seeing.handle(ms(0), Input::Open);
    seeing.handle(ms(300), saw([f32::NAN, 0.0, 1.0]));
    seeing.handle(ms(600), saw([7.0, 0.0, 0.0]));
    let out = seeing.handle(ms(1000), Input::Tick);
    assert!(broadcast(&out)[0].evidence.is_empty());
    assert_eq!(seeing.refusals().count(Refusal::Unclassified), 2);
    let mut blind = blind(8);
    blind.handle(ms(0), Input::Open);
    blind.handle(ms(300), saw([0.9, 0.05, 0.05]));
    assert_eq!(blind.refusals().count(Refusal::NoClassifier), 1);
}

/// Its own judgement says all; asked for a part of it, it would not know.
#[derive(Debug)]
struct AtOnce(Vocabulary);

impl Classify for AtOnce {
    fn vocabulary(&self) -> &Vocabulary {
        &self.0
    }

    fn probabilities(&self, _: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        Err(ClassifyError::NotFinite(0))
    }

    fn judge(&self, _: &[f32]) -> Result<Judgement, ClassifyError> {
        Ok(Judgement { probabilities: vec![0.8, 0.1, 0.1], unknown: Some(0.2), view: Some(vec![0.0]) })
    }
}

#[test]
fn a_frame_is_judged_once_and_for_all_that_is_said_of_it() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Learned(Arc::new(AtOnce(vocabulary()))));
    mind.handle(ms(0), Input::Open);
    let mut said = mind.handle(ms(300), saw([0.0; 3]));
    said.extend(mind.handle(ms(1000), Input::Tick));
    let vote = broadcast(&said).pop().unwrap();
    assert!(vote.evidence[0] > vote.evidence[1] && vote.unknown.is_some(), "{vote:?}");
    assert_eq!(mind.refusals(), &Refusals::default());
}

#[test]
fn a_vote_of_another_vocabulary_or_length_or_with_impossible_values_is_refused_and_counted() {
    let mut mind = mind(7);
    mind.handle(ms(0), votes(1, 1, Vote { vocabulary: VocabularyId(1), ..vote(1, 0, SURE) }));
    mind.handle(ms(1), votes(2, 1, Vote { evidence: vec![1.0, -1.0], ..vote(1, 0, SURE) }));
    assert_eq!(mind.refusals().count(Refusal::Vocabulary), 2);
    mind.handle(ms(2), votes(3, 1, Vote { evidence: vec![f32::NAN, 0.0, 0.0], ..vote(1, 0, SURE) }));
    assert_eq!(mind.refusals().count(Refusal::Impossible), 1);
    assert_eq!(mind.round(), None, "nothing of it is kept");
}

#[test]
fn a_new_vocabulary_makes_the_robot_look_afresh() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Blind(false));
    mind.handle(ms(0), Input::Open);
    mind.handle(ms(100), saw([0.6, 0.2, 0.2]));
    let other = Vocabulary::new(["left", "right", "up"]).unwrap();
    mind.handle(ms(200), Input::Learned(Arc::new(Verbatim(other.clone()))));
    let out = mind.handle(ms(300), Input::Tick);
    assert_eq!((broadcast(&out)[0].looks, broadcast(&out)[0].vocabulary), (0.0, other.id()));
}

#[test]
fn a_second_robot_with_my_id_is_counted_and_reported_but_my_echo_is_not() {
    let mut mind = mind(7);
    mind.handle(ms(0), Input::Open);
    mind.handle(ms(1), says(7, 1, Message::Vote(null(1))));
    assert_eq!(mind.duplicate(), None, "the own null vote came back");
    mind.handle(ms(2), says(7, 40, Message::Vote(vote(1, 1, SURE))));
    assert_eq!(mind.refusals().count(Refusal::DuplicateId), 1);
    let held = HeldVote {
        robot: RobotId(7),
        stamp: Stamp { boot: 2, sequence: 1 },
        vote: vote(1, 1, SURE),
        signature: None,
    };
    mind.handle(
        ms(3),
        says(3, 1, Message::Give(Give { decision: None, votes: vec![held.clone()], holders: vec![] })),
    );
    assert_eq!(mind.duplicate(), Some(held.stamp));
    let earlier = HeldVote { stamp: Stamp { boot: 0, sequence: 9 }, ..held };
    mind.handle(
        ms(4),
        says(3, 2, Message::Give(Give { decision: None, votes: vec![earlier], holders: vec![] })),
    );
    assert_eq!(mind.refusals().count(Refusal::DuplicateId), 2, "a vote of an earlier life is merely old");
    assert_eq!(mind.held(), None, "none of it counts as this robot's evidence");
}

/// Learns how alike robots are, as far as it is told.
struct Found(Option<Pool>);

impl Follow for Found {
    fn pool(&mut self) -> Option<Pool> {
        self.0
    }
}

/// What 64 rounds of robots that are wrong together say.
const FOUND: Pool = Pool { likeness: 0.75, temperature: 1.56, rounds: 64 };

/// What ten robots come to whose evidence says that by so much each, in a mind of that kind.
fn comes_to(mind: &mut Rounds, found: &mut Found, (counter, at): (u32, u64), lead: f32) -> Decision {
    for robot in 10..20 {
        let said = Vote { evidence: vec![lead, 0.0, -2.0 * lead], ..vote(counter, 0, 0.0) };
        mind.handle_with(ms(at), votes(robot, counter, said), found);
    }
    (1..=6).for_each(|second| drop(mind.handle_with(ms(at + 1000 * second), Input::Tick, found)));
    mind.held().cloned().expect("the round is over")
}

#[test]
fn who_found_less_than_others_of_how_alike_robots_are_goes_by_what_they_found() {
    let start = |me: u32, liars: u32| {
        let config = RoundsConfig { liars, ..RoundsConfig::default() };
        let mut mind = mind_with(me, config);
        mind.handle(ms(0), Input::Alive(Arc::new(robots(10..20))));
        mind
    };
    let (clear, faint) = (6.0, 2.0);
    let mut fitted = start(1, 0);
    let clearly = comes_to(&mut fitted, &mut Found(Some(FOUND)), (1, 0), clear);
    assert_eq!((clearly.class, clearly.certificate.pool), (Some(ClassId(0)), Some(FOUND)));
    assert_eq!(comes_to(&mut fitted, &mut Found(Some(FOUND)), (2, 10_000), faint).class, None);

    // One that starts again, or does not learn, and knows nothing of it.
    let alone = comes_to(&mut start(7, 0), &mut Found(None), (2, 10_000), faint);
    assert_eq!((alone.class, alone.certificate.pool), (Some(ClassId(0)), Some(Pool::PRIOR)));
    let told = |liars: u32, own: Option<Pool>, given: Decision| {
        let mut mind = start(7, liars);
        let config = mind.config().clone();
        mind.handle_with(ms(9000), gives(1, by(&config, given)), &mut Found(own));
        assert_eq!(mind.held().and_then(|held| held.class).is_some(), liars == 0);
        let said = comes_to(&mut mind, &mut Found(own), (2, 10_000), faint);
        (said.class, said.certificate.pool)
    };
    for own in [None, Some(Pool::PRIOR), Some(Pool { rounds: 5, ..Pool::PRIOR })] {
        let repeated = Pool { rounds: own.map_or(0, |own| own.rounds), ..FOUND };
        assert_eq!(told(0, own, clearly.clone()), (None, Some(repeated)), "{own:?}");
    }
    // Of its own it has as much as they; and where some may lie it hears nobody.
    let own = Pool { rounds: 64, ..Pool::PRIOR };
    assert_eq!(told(0, Some(own), clearly.clone()), (Some(ClassId(0)), Some(own)));
    assert_eq!(told(1, None, clearly.clone()).1, Some(Pool::PRIOR));
    // Nor does it go by what one said that is expelled.
    let mut mind = start(7, 0);
    let config = mind.config().clone();
    mind.handle_with(ms(9000), gives(1, by(&config, clearly.clone())), &mut Found(None));
    mind.handle_with(ms(9500), Input::Expelled(robots([clearly.author.0])), &mut Found(None));
    assert_eq!(comes_to(&mut mind, &mut Found(None), (2, 10_000), faint).certificate.pool, Some(Pool::PRIOR));
    // Nor by what others repeat of that.
    let mut mind = start(8, 0);
    mind.handle_with(ms(9000), gives(1, by(&config, clearly.clone())), &mut Found(None));
    let repeated = comes_to(&mut mind, &mut Found(None), (2, 10_000), clear);
    assert_eq!((repeated.author, repeated.certificate.pool.unwrap().temperature), (RobotId(8), 1.56));
    let mut mind = start(7, 0);
    mind.handle_with(ms(19_000), gives(2, by(&config, repeated)), &mut Found(None));
    assert_eq!(comes_to(&mut mind, &mut Found(None), (3, 20_000), faint).certificate.pool, Some(Pool::PRIOR));
    // What another believed beforehand is nothing that it found.
    let unfounded = comes_to(&mut start(1, 0), &mut Found(None), (1, 0), clear);
    assert_eq!(told(0, None, unfounded).1, Some(Pool::PRIOR));
}
