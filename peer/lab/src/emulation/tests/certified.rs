//! What robots that learn from groups of authors apart say is certain, while others of their swarm lie.

use std::sync::Arc;

use gestalt_strategies::{Classifier, Learner, LearnerOptions, TrainingChange};

use super::*;

const GROUPS: usize = 9;
const HONEST: usize = 7;
const LIARS: usize = 3;

fn scenario(poison: Poison) -> Scenario {
    let text = format!(
        "{{
            robots: [{{ name: 'robot', count: {HONEST}, view: {{ fps: 4, signal: 2, persistence: 0.5 }} }}],
            classes: 4, topology: 'random', rounds: 10,
            link: {{ latency: '2ms', jitter: '5ms' }},
            learning: {{ robots: {{ keep: 3, share_bytes: null, capacity: 120, learner: {{ groups: {GROUPS} }} }} }},
        }}"
    );
    let mut scenario = Scenario::parse(&text, "certified").unwrap();
    let honest = scenario.robots[0].clone();
    scenario.robots.push(Group { name: "liar".to_owned(), count: LIARS, poison: Some(poison), ..honest });
    scenario
}

/// What a robot's mind trains on without what these robots shared.
fn without_liars(classifier: &Classifier, training: &[TrainingChange], lying: &[usize]) -> Arc<Classifier> {
    let options = LearnerOptions { groups: GROUPS, ..LearnerOptions::default() };
    let vocabulary = Vocabulary::new((0..4).map(|class| class.to_string())).unwrap();
    let mut learner = Learner::new(classifier.space().clone(), vocabulary, options).unwrap();
    for change in training {
        if !matches!(change, TrainingChange::Insert { group: Some(group), .. } if lying.contains(group)) {
            change.apply_to(&mut learner).unwrap();
        }
    }
    learner.learn().unwrap()
}

#[test]
fn what_is_certified_against_so_many_is_the_same_without_a_word_of_them_whatever_they_shared() {
    // Robots 8 to 10 lie; what is left of 10 by 9 is 1, as of robot 1 itself, which is nobody's but its own.
    let lying: Vec<usize> = (HONEST + 1..=HONEST + LIARS).map(|id| id % GROUPS).collect();
    let (mut certain, mut asked) = (0, 0);
    for poison in Poison::ALL {
        let scenario = scenario(poison);
        let mut observers = statistical_observers(&scenario).unwrap();
        let school = school_of_scores(&scenario, &mut observers).unwrap();
        let mut emulation = Emulation::new(&scenario, 1, observers, school, Trace::none()).unwrap();
        while emulation.show_next() {}
        let views: Vec<Arc<[f32]>> = (0..HONEST)
            .flat_map(|robot| emulation.training_set(robot).unwrap().iter())
            .filter(|sample| sample.part != SetPart::External)
            .map(|sample| sample.vector.clone())
            .collect();
        for robot in 0..HONEST {
            let set = emulation.training_set(robot).unwrap();
            let most = set.authors().map(|(_, held)| held).max().unwrap();
            assert!(most <= 2 * (120 / (GROUPS + 1)), "{poison:?}: one holds {most}");
            let classifier = emulation.classifier(robot).unwrap();
            let training = emulation.swarm.mind(robot).unwrap().training();
            let honestly = without_liars(&classifier, &training, &lying);
            for view in &views {
                let said = classifier.certified(view).unwrap();
                asked += 1;
                if said.tolerates >= LIARS {
                    certain += 1;
                    assert_eq!(
                        honestly.certified(view).unwrap().class,
                        said.class,
                        "{poison:?}, robot {}",
                        robot + 1
                    );
                }
            }
        }
    }
    assert!(3 * certain > asked, "{certain} of {asked} are certain: else this says nothing");
}
