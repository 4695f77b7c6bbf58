//! Robots that see three gestures on three corners of a triangle, and others that say otherwise.

use std::collections::BTreeMap;

use gestalt_protocol::{RoundId, SampleId};

use super::*;

const ME: RobotId = RobotId(1);
/// Where the gestures lie; the variance of the space is 1.
const CORNERS: [[f32; 2]; 3] = [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]];

#[derive(Default)]
struct Samples(HeldSamples, u64);

impl Samples {
    /// `count` samples of an author, at a corner with a little noise, under the label of a class.
    fn add(&mut self, author: RobotId, count: u32, corner: usize, class: u8) {
        for _ in 0..count {
            let key = self.1;
            self.1 += 1;
            let noise = |step: u64| ((key * step % 17) as f32 / 17.0 - 0.5) * 0.4;
            let [x, y] = CORNERS[corner];
            self.0.insert(HeldSample {
                key,
                part: if author == ME { SetPart::Personal } else { SetPart::External },
                id: (author != ME).then_some(SampleId { author, life: 1, number: key as u32 + 1 }),
                class: ClassId(class),
                round: RoundId { counter: 1, opener: ME, life: 1 },
                vector: [x + noise(5), y + noise(11)].into(),
            });
        }
    }

    /// Robots 1 to `honest`, with `each` samples of each gesture.
    fn of_honest(honest: u32, each: u32) -> Self {
        let mut samples = Self::default();
        for robot in 1..=honest {
            (0..3).for_each(|class| samples.add(RobotId(robot), each, usize::from(class), class));
        }
        samples
    }

    /// How many samples of each other robot are trained on.
    fn heeded(&self, config: PoisonDefence) -> BTreeMap<u32, usize> {
        let scrutiny = Scrutiny::new(config, ME, 1.0, &self.0);
        scrutiny.heeded(&self.0).into_iter().map(|(robot, _, heeded)| (robot.0, heeded)).collect()
    }
}

#[test]
fn what_honest_robots_say_is_all_trained_on() {
    let heeded = Samples::of_honest(10, 4).heeded(PoisonDefence::measured());
    assert_eq!(heeded, (2..=10).map(|robot| (robot, 12)).collect());
}

#[test]
fn three_of_ten_that_say_otherwise_are_not_believed_and_no_honest_one_pays_for_it() {
    let mut samples = Samples::of_honest(7, 4);
    for liar in 8..=10 {
        (0..3).for_each(|corner| samples.add(RobotId(liar), 4, corner, (corner as u8 + 1) % 3));
    }
    let heeded = samples.heeded(PoisonDefence::measured());
    assert_eq!(heeded, (2..=10).map(|robot| (robot, if robot <= 7 { 12 } else { 0 })).collect());
    let all = samples.heeded(PoisonDefence::default());
    assert!(all.values().all(|heeded| *heeded == 12), "without a defence all is believed: {all:?}");
}

#[test]
fn one_that_mixes_lies_with_the_truth_is_believed_where_it_is_true() {
    let mut samples = Samples::of_honest(9, 4);
    samples.add(RobotId(10), 8, 0, 0);
    samples.add(RobotId(10), 4, 1, 2);
    let config = PoisonDefence { influence: 0.0, ..PoisonDefence::measured() };
    assert_eq!(samples.heeded(config)[&10], 8);
}

#[test]
fn whoever_says_the_truth_a_hundred_times_counts_little_more_than_others() {
    let mut samples = Samples::of_honest(9, 8);
    samples.add(RobotId(10), 100, 0, 0);
    let heeded = samples.heeded(PoisonDefence::measured());
    assert_eq!((heeded[&10], heeded[&9]), (10, 24));
}

#[test]
fn what_nobody_else_saw_is_believed() {
    let mut samples = Samples::of_honest(9, 4);
    for class in 0..3 {
        for _ in 0..3 {
            let key = samples.1;
            samples.add(RobotId(10), 1, 0, class);
            let mut alone = samples.0.remove(key).unwrap();
            alone.vector = [100.0 + f32::from(class), 50.0].into();
            samples.0.insert(alone);
        }
    }
    assert_eq!(samples.heeded(PoisonDefence::measured())[&10], 9);
}

#[test]
fn a_sample_that_comes_is_judged_at_once_and_again_when_more_is_known() {
    let mut samples = Samples::default();
    samples.add(RobotId(2), 4, 0, 1);
    let mut scrutiny = Scrutiny::new(PoisonDefence::measured(), ME, 1.0, &samples.0);
    assert_eq!(scrutiny.heeded(&samples.0), [(RobotId(2), 4, 4)], "nobody says otherwise yet");
    let mut more = Samples::of_honest(1, 4);
    for robot in 3..=6 {
        (0..3).for_each(|class| more.add(RobotId(robot), 4, usize::from(class), class));
    }
    for mut sample in more.0.iter().cloned().collect::<Vec<_>>() {
        sample.key += 100;
        samples.0.insert(sample);
    }
    samples.1 = 300;
    let changes = scrutiny.reckon(&samples.0);
    for key in 0..4 {
        assert!(changes.contains(&(key, false)), "{key} is trained on no more: {changes:?}");
    }
    samples.add(RobotId(2), 1, 0, 1);
    assert!(!scrutiny.judge(&samples.0, 300), "another lie");
    samples.add(RobotId(3), 1, 0, 0);
    assert!(scrutiny.judge(&samples.0, 301), "another truth");
    samples.add(ME, 1, 0, 2);
    assert!(scrutiny.judge(&samples.0, 302), "its own samples are never judged");
    assert_eq!(scrutiny.reckon(&samples.0), [], "and nothing changes where nothing is new");
}

#[test]
fn what_is_older_than_the_newest_that_are_judged_stays_what_it_was_taken_for() {
    let mut samples = Samples::default();
    samples.add(RobotId(2), 4, 0, 1);
    let mut scrutiny = Scrutiny::new(PoisonDefence::measured(), ME, 1.0, &samples.0);
    (0..3).for_each(|class| samples.add(ME, JUDGED as u32, usize::from(class), class));
    assert_eq!(scrutiny.reckon(&samples.0), []);
    assert_eq!(scrutiny.heeded(&samples.0), [(RobotId(2), 4, 4)]);
}
