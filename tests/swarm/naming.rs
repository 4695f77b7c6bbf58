//! Gestures that an instructor names while real robots work.

use std::time::{Duration, Instant};

use gestalt_protocol::{ClassId, Gesture, Instruction, LearningStatus, Outcome};

use crate::learning::School;

const PATIENCE: Duration = Duration::from_secs(30);

/// How many samples that robot trains on of a gesture of that name; `None` where it has not heard of it.
fn samples_of(learning: &LearningStatus, label: &str) -> Option<usize> {
    learning.named.iter().find(|named| named.label == label).map(|named| named.samples)
}

/// Whether all robots come to know as much of the circle as all together shared, and the same.
async fn known(school: &School) -> bool {
    let common = || school.robots[0].robot.status().learning.map(|learning| learning.common);
    school
        .all(|learning| {
            samples_of(learning, "circle") >= Some(25) && common() == Some(learning.common.clone())
        })
        .await
}

pub async fn a_gesture_that_is_named_and_shown_five_times_is_known_to_all_of_a_line() {
    let mut school = School::linked(8, 2, 0.5, false).await;
    for _ in 0..2 {
        for class in 0..6 {
            school.lesson(class).await;
        }
    }
    let new = Instruction::New { label: "circle".to_owned(), round: None };
    let answer = school.client.teach(&school.ada, &new, PATIENCE).await.unwrap().expect("an answer");
    let circle = ClassId::named(&school.ada, "circle");
    assert_eq!((answer.outcome, answer.class), (Outcome::Learned, Some(circle)));
    for _ in 0..5 {
        let round = school.show(6).await;
        let was = Instruction::Was { round, class: Gesture::Label("circle".to_owned()) };
        let answer = school.client.teach(&school.ada, &was, PATIENCE).await.unwrap().expect("an answer");
        assert_eq!((answer.outcome, answer.class), (Outcome::Learned, Some(circle)));
    }
    let said = Instant::now();
    assert!(known(&school).await, "all know all of it");
    let late = said.elapsed();
    assert!(late < Duration::from_secs(2), "known everywhere after {late:?}");
    for class in [6, 3, 6, 0, 6] {
        school.show(class).await;
        let last = school.client.last_decision(Duration::from_secs(2)).await.unwrap().unwrap();
        let (expected, label) = match class {
            6 => (circle, "circle".to_owned()),
            other => (ClassId(other.into()), last.label.clone().unwrap_or_default()),
        };
        assert_eq!(last.decision.class, Some(expected), "{class}");
        assert_eq!(last.label, Some(label));
    }

    // Taken for another gesture of the list, and taken back.
    let same = Instruction::Same { class: Gesture::Class(circle), of: Gesture::Class(ClassId(2)) };
    let answer = school.client.teach(&school.ada, &same, PATIENCE).await.unwrap().expect("an answer");
    assert_eq!(answer.outcome, Outcome::Learned);
    assert!(school.all(|learning| learning.named.is_empty()).await, "it is none of its own any more");
    let restore = Instruction::Restore { class: Gesture::Class(circle) };
    let answer = school.client.teach(&school.ada, &restore, PATIENCE).await.unwrap().expect("an answer");
    assert_eq!(answer.outcome, Outcome::Learned);
    assert!(known(&school).await);
    school.end().await;
}
