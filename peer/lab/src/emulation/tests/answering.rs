//! Instructors who err.

use std::sync::Arc;

use super::*;

/// The words of an instructor who says right or wrong to robots that know all gestures.
fn said(wrong: f64) -> [usize; 2] {
    let mut scenario = learning(3, 1.0, NetworkShape::Ring);
    let mut observers = statistical_observers(&scenario).unwrap();
    let school = school_of_scores(&scenario, &mut observers).unwrap().unwrap();
    let mut run = emulation(&scenario, 1);
    while run.show_next() {}
    let taught = run.classifier(0);
    drop(run);
    let (space, vocabulary) = (school.space().clone(), school.vocabulary().clone());
    let teaching = scenario.learning.as_mut().unwrap();
    let school = School::new(space, vocabulary, taught, teaching.robots.learner.clone()).unwrap();

    teaching.feedback = Feedback::Partial;
    teaching.answering.wrong = wrong;
    let mut bytes = Vec::new();
    let trace = Trace::to(&mut bytes);
    Emulation::new(&scenario, 2, observers, Some(Arc::new(school)), trace).unwrap().finish().1.unwrap();
    let trace = String::from_utf8(bytes).unwrap();
    let words = trace.lines().filter(|line| line.contains("\"instruct\""));
    ["right", "wrong"].map(|word| words.clone().filter(|line| line.contains(&format!("\"{word}\""))).count())
}

#[test]
fn who_errs_says_wrong_of_what_is_right() {
    let [right, wrong] = said(0.0);
    assert!(right >= 3 && wrong == 0, "{right} of six are said to be right, {wrong} wrong");
    // Robots believe it, and decide for less from then on.
    let [right, wrong] = said(1.0);
    assert!(right == 0 && wrong >= 1, "{right} of six are said to be right, {wrong} wrong");
}

/// Of how many showings of robots that begin with nothing the gesture counts as taught, and of how many as untaught; each is shown twice.
fn taught(feedback: Feedback, wrong: f64) -> [u64; 2] {
    let mut scenario = Scenario { rounds: 12, ..learning(3, 1.0, NetworkShape::Ring) };
    let teaching = scenario.learning.as_mut().unwrap();
    (teaching.feedback, teaching.answering.wrong) = (feedback, wrong);
    let calibration = compare(&scenario, 1, || ()).unwrap().remove(0).calibration;
    [calibration.taught_and_decided.trials, calibration.untaught_and_sure.trials]
}

#[test]
fn only_what_somebody_named_and_named_rightly_counts_as_taught() {
    assert_eq!(taught(Feedback::Full, 0.0), [6, 6]);
    assert_eq!(taught(Feedback::Full, 1.0), [0, 12], "what was named is another gesture");
    assert_eq!(taught(Feedback::None, 0.0), [0, 12]);
    // Robots that know nothing decide nothing that could be said to be right.
    assert_eq!(taught(Feedback::Partial, 0.0), [0, 12]);
}
