//! Gestures that were named since the swarm was made, in the view.

use gestalt_protocol::NamedGesture;

use super::*;

fn circle() -> ClassId {
    ClassId::named(&"ana".parse().unwrap(), "circle")
}

/// Three robots of one list, of which that one alone learns, and so has heard of the circle.
fn robots(learner: u32) -> impl Iterator<Item = Input> {
    (1..=3).flat_map(move |robot| {
        let named = vec![NamedGesture { class: circle(), label: "circle".to_owned(), samples: 0 }];
        let learning = LearningStatus { named, ..LearningStatus::default() };
        let learning = Some(learning).filter(|_| robot == learner);
        [Input::Came(RobotId(robot)), reported(Status { learning, ..status(robot) })]
    })
}

#[test]
fn what_was_named_is_meant_by_its_number_and_what_is_listed_by_its_label() {
    let listed = labels().into_iter().map(Gesture::Label);
    let gestures: Vec<_> = listed.chain([Gesture::Class(circle())]).collect();
    for learner in 1..=3 {
        for decided in [None, Some(decision(decided(1, Some(2), &[2])))] {
            let swarm = after(robots(learner).chain(decided)).swarm(NOW);
            assert_eq!(swarm.vocabulary, ["fist", "one", "palm", "circle"], "of robot {learner}");
            assert_eq!(swarm.gestures, gestures, "of robot {learner}");
        }
    }
}

#[test]
fn a_decision_for_what_was_named_says_so_whoever_of_the_robots_has_heard_of_it() {
    for learner in 1..=3 {
        let mut made = decided(1, None, &[2]);
        (made.decision.class, made.label) = (Some(circle()), None);
        let shown = after(robots(learner).chain([decision(made)])).decision().unwrap();
        assert_eq!(shown.label.as_deref(), Some("circle"), "of robot {learner}");
    }
}
