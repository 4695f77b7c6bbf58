//! Robots that see three gestures on three corners of a triangle, and others that say otherwise.

use std::collections::BTreeMap;

use super::*;

const ME: RobotId = RobotId(1);
/// Where the gestures lie; the variance of the space is 1.
const CORNERS: [[f32; 2]; 3] = [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]];

#[derive(Clone)]
struct Sample {
    key: u64,
    author: RobotId,
    class: ClassId,
    vector: [f32; 2],
}

#[derive(Default)]
struct Samples(Vec<Sample>);

impl Samples {
    /// `count` samples of an author, at a corner with a little noise, under the label of a class.
    fn add(&mut self, author: RobotId, count: u32, corner: usize, class: u32) {
        for _ in 0..count {
            let key = self.0.last().map_or(0, |last| last.key + 1);
            let noise = |step: u64| ((key * step % 17) as f32 / 17.0 - 0.5) * 0.4;
            let [x, y] = CORNERS[corner];
            let vector = [x + noise(5), y + noise(11)];
            self.0.push(Sample { key, author, class: ClassId(class), vector });
        }
    }

    /// The newest first.
    fn claims(&self) -> Vec<Claim<'_>> {
        fn claim(Sample { key, author, class, vector }: &Sample) -> Claim<'_> {
            Claim { key: *key, author: *author, is_of_others: *author != ME, class: *class, vector }
        }
        self.0.iter().rev().take(JUDGED).map(claim).collect()
    }

    /// Robots 1 to `honest`, with `each` samples of each gesture.
    fn of_honest(honest: u32, each: u32) -> Self {
        let mut samples = Self::default();
        for robot in 1..=honest {
            (0..3).for_each(|class| samples.add(RobotId(robot), each, class as usize, class));
        }
        samples
    }

    /// How many samples of each other robot are trained on, where all are judged.
    fn heeded(&self, config: PoisonDefence) -> BTreeMap<u32, usize> {
        let mut scrutiny = Scrutiny::new(config, ME, 1.0);
        scrutiny.reckon(&self.claims());
        self.heeded_by(&scrutiny)
    }

    fn heeded_by(&self, scrutiny: &Scrutiny) -> BTreeMap<u32, usize> {
        let mut heeded = BTreeMap::new();
        for sample in self.0.iter().filter(|sample| sample.author != ME) {
            *heeded.entry(sample.author.0).or_default() += usize::from(!scrutiny.leaves_out(sample.key));
        }
        heeded
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
        (0..3).for_each(|corner| samples.add(RobotId(liar), 4, corner, (corner as u32 + 1) % 3));
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
        samples.add(RobotId(10), 3, 0, class);
        samples.0.iter_mut().rev().take(3).for_each(|sample| sample.vector = [100.0 + class as f32, 50.0]);
    }
    assert_eq!(samples.heeded(PoisonDefence::measured())[&10], 9);
}

#[test]
fn a_sample_that_comes_is_judged_at_once_and_again_when_more_is_known() {
    let mut samples = Samples::default();
    samples.add(RobotId(2), 4, 0, 1);
    let mut scrutiny = Scrutiny::new(PoisonDefence::measured(), ME, 1.0);
    assert!(scrutiny.is_due(), "what was held before is to be judged");
    scrutiny.reckon(&samples.claims());
    assert!(!scrutiny.is_due());
    assert_eq!(samples.heeded_by(&scrutiny), [(2, 4)].into(), "nobody says otherwise yet");

    for robot in [1, 3, 4, 5, 6] {
        (0..3).for_each(|class| samples.add(RobotId(robot), 4, class as usize, class));
    }
    let changed = scrutiny.reckon(&samples.claims());
    assert_eq!(changed, [0, 1, 2, 3], "they are trained on no more");
    let mut comes = |author, class| {
        samples.add(author, 1, 0, class);
        let key = samples.0.last().unwrap().key;
        scrutiny.judge(&samples.claims(), key);
        !scrutiny.leaves_out(key)
    };
    assert!(!comes(RobotId(2), 1), "another lie");
    assert!(comes(RobotId(3), 0), "another truth");
    assert!(comes(ME, 2), "its own samples are never judged");
    assert!(scrutiny.reckon(&samples.claims()).is_empty(), "and nothing changes where nothing is new");
    scrutiny.forget(0);
    assert!(!scrutiny.leaves_out(0), "what is gone takes no room");
}

#[test]
fn what_is_older_than_the_newest_that_are_judged_stays_what_it_was_taken_for() {
    let mut samples = Samples::default();
    samples.add(RobotId(2), 4, 0, 1);
    let mut scrutiny = Scrutiny::new(PoisonDefence::measured(), ME, 1.0);
    scrutiny.reckon(&samples.claims());
    (0..3).for_each(|class| samples.add(ME, JUDGED as u32, class as usize, class));
    assert!(scrutiny.reckon(&samples.claims()).is_empty());
    assert_eq!(samples.heeded_by(&scrutiny), [(2, 4)].into());
}
