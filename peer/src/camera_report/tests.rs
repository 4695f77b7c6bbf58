use gestalt_strategies::{ClassifyError, Vocabulary};
use gestalt_vision::steady::Broken;
use opencv::core::{CV_8UC3, Scalar};

use super::*;

/// Of a camera of 10 frames per second.
const PERIOD: Duration = Duration::from_millis(100);

/// The camera delivers a picture of that grey; says whether it is worth looking at.
fn deliver(report: &mut CameraReport, level: f64, at_ms: u64) -> bool {
    let image = Mat::new_rows_cols_with_default(48, 64, CV_8UC3, Scalar::all(level)).unwrap();
    report.note_frame(&image, Duration::from_millis(at_ms))
}

/// What is news when the status is written.
fn news(report: &mut CameraReport, at_ms: u64) -> (CameraState, News) {
    let (camera, news) = report.write(Duration::from_millis(at_ms), "a test", None, None);
    (camera.state, news)
}

fn state(report: &CameraReport, at_ms: u64) -> CameraState {
    report.state(Duration::from_millis(at_ms)).0
}

#[test]
fn a_camera_that_falls_silent_is_frozen_until_it_delivers_again() {
    let mut report = CameraReport::of_camera(true, PERIOD);
    assert_eq!(state(&report, 0), CameraState::Opening);
    report.expect(Duration::ZERO);
    for at in 0..30 {
        assert!(deliver(&mut report, at as f64, at * 100));
    }
    assert_eq!(state(&report, 3000), CameraState::Live);
    assert!((report.fps().unwrap() - 10.0).abs() < 0.5);
    assert_eq!(state(&report, 6000), CameraState::Frozen);
    assert!(report.state(Duration::from_secs(6)).1.contains("no frame for 3 s"));
    deliver(&mut report, 90.0, 6100);
    assert_eq!(state(&report, 6200), CameraState::Live);
}

#[test]
fn the_same_picture_over_and_over_is_frozen_and_not_worth_looking_at() {
    let mut report = CameraReport::of_camera(true, PERIOD);
    report.expect(Duration::ZERO);
    let worth: Vec<bool> = (0..40).map(|at| deliver(&mut report, 9.0, at * 100)).collect();
    assert!(worth[..20].iter().all(|worth| *worth) && !worth[39]);
    assert_eq!(state(&report, 3900), CameraState::Frozen);
    let trouble = report.state(Duration::from_millis(3900)).1;
    assert!(trouble.contains("identical pictures for 4 s: covered, saturated, or hanging"), "{trouble}");
    assert!(deliver(&mut report, 10.0, 4000));
    assert_eq!(state(&report, 4000), CameraState::Live);
    // A file may show the same picture for as long as it likes.
    let mut report = CameraReport::of_camera(false, PERIOD);
    assert!((0..40).all(|at| deliver(&mut report, 9.0, at * 100)));
}

#[test]
fn what_is_streamed_is_the_same_for_too_long_as_what_is_looked_at_here() {
    let mut same = SamePicture::default();
    let trouble = |same: &SamePicture, at_ms| same.trouble(Duration::from_millis(at_ms), PERIOD);
    for at in 10..40 {
        same.note(7, PERIOD * at);
        assert_eq!(trouble(&same, 100 * u64::from(at)).is_some(), at > 30, "{at}");
    }
    assert!(trouble(&same, 5000).unwrap().contains("identical pictures for 4 s"));
    // One of a picture a second has the time of three.
    assert_eq!(same.trouble(Duration::from_millis(3900), Duration::from_secs(1)), None);
    same.note(8, Duration::from_secs(5));
    assert_eq!(trouble(&same, 5100), None);
}

#[test]
fn a_slow_camera_has_the_time_of_three_of_its_frames_from_the_first_on() {
    let mut report = CameraReport::of_camera(true, Duration::from_secs(10));
    report.expect(Duration::ZERO);
    assert_eq!(state(&report, 9_000), CameraState::Opening);
    deliver(&mut report, 1.0, 10_000);
    assert_eq!(state(&report, 19_000), CameraState::Live);
    deliver(&mut report, 2.0, 20_000);
    assert_eq!(state(&report, 49_000), CameraState::Live);
    assert_eq!(state(&report, 51_000), CameraState::Frozen);
}

#[test]
fn a_streaming_robot_has_never_left_before_it_is_frozen() {
    // A frame every 2.5 s, seven of them, and no more.
    let mut report = CameraReport::of_stream(Duration::from_millis(7500), Duration::ZERO);
    let (soon, late) = (Duration::from_secs(2), Duration::from_secs(10));
    let mut heard = 0;
    for at in (0..30_000).step_by(100) {
        if at % 2500 == 0 && at <= 15_000 {
            deliver(&mut report, 1.0, at);
            heard = at;
        }
        let silent = Duration::from_millis(at - heard);
        assert_eq!(report.is_gone(silent, soon), state(&report, at) == CameraState::Frozen, "{at}");
        assert_eq!(report.is_gone(silent, late), silent >= late, "{at}");
    }
}

#[test]
fn a_camera_that_nobody_looks_through_is_not_frozen() {
    let mut report = CameraReport::of_camera(false, PERIOD);
    report.expect(Duration::ZERO);
    deliver(&mut report, 1.0, 0);
    report.rest();
    assert_eq!(state(&report, 60_000), CameraState::Live);
    report.expect(Duration::from_secs(60));
    assert_eq!(state(&report, 61_000), CameraState::Live);
    assert_eq!(state(&report, 64_000), CameraState::Frozen);
}

#[test]
fn errors_in_a_row_are_a_failing_camera_and_the_end_is_the_end() {
    let mut report = CameraReport::of_camera(false, PERIOD);
    let error = SourceError::NoFrame("/dev/video9".into());
    report.note_error(&error);
    assert_eq!(state(&report, 0), CameraState::Opening);
    report.note_error(&error);
    report.note_error(&error);
    assert_eq!(state(&report, 0), CameraState::Failing);
    assert!(report.state(Duration::ZERO).1.contains("/dev/video9"));
    deliver(&mut report, 1.0, 100);
    assert_eq!(state(&report, 100), CameraState::Live);
    report.note_error(&SourceError::Ended("video".to_owned()));
    assert_eq!(state(&report, 200), CameraState::Ended);
}

#[test]
fn one_bad_picture_of_a_live_camera_costs_itself_alone() {
    let mut report = CameraReport::of_camera(true, PERIOD);
    let bad = || SourceError::Own("rubbish".to_owned()).of_one_file();
    for at in [100, 200, 300, 400, 500] {
        deliver(&mut report, at as f64 / 4.0, at);
        report.note_error(&bad());
        assert_eq!(news(&mut report, at).1.blind, None, "{at}");
    }
    // Where all are bad, or the camera itself is, nothing is to be seen.
    for _ in 0..2 {
        report.note_error(&bad());
    }
    assert_eq!(news(&mut report, 600), (CameraState::Failing, News { blind: Some(true), state: true }));
    deliver(&mut report, 1.0, 700);
    assert_eq!(news(&mut report, 700).1.blind, Some(false));
    report.note_error(&SourceError::NoFrame("/dev/video9".into()));
    assert_eq!(news(&mut report, 800).1.blind, Some(true));
}

#[test]
fn a_stream_is_blind_until_its_first_frame_and_from_its_first_bad_one_on() {
    let mut report = CameraReport::of_stream(Duration::from_secs(2), Duration::from_secs(60));
    assert_eq!(news(&mut report, 60_000), (CameraState::Opening, News { blind: None, state: true }));
    deliver(&mut report, 1.0, 60_100);
    assert_eq!(news(&mut report, 60_100).1.blind, Some(false));
    assert!(!report.is_due(Duration::from_millis(60_200)));
    report.note_error(&SourceError::Own("rubbish".to_owned()));
    assert!(report.is_due(Duration::from_millis(60_200)), "at once");
    assert_eq!(news(&mut report, 60_200), (CameraState::Failing, News { blind: Some(true), state: true }));
    assert_eq!(news(&mut report, 60_500).1, News::default(), "it was said");
    deliver(&mut report, 1.0, 60_600);
    assert_eq!(news(&mut report, 60_600), (CameraState::Live, News { blind: Some(false), state: true }));
    assert_eq!(news(&mut report, 62_700).0, CameraState::Frozen);
    assert!(report.state(Duration::from_millis(62_700)).1.contains("gestalt stream"));
}

#[test]
fn a_source_that_panics_and_frames_that_cannot_be_judged_blind_at_once() {
    let mut report = CameraReport::of_camera(false, PERIOD);
    deliver(&mut report, 1.0, 0);
    assert_eq!(news(&mut report, 0).1.blind, None);
    report.note_error(&SourceError::Panicked(Broken::Again("no pixels".to_owned())));
    assert_eq!(news(&mut report, 10).1.blind, Some(true));
    deliver(&mut report, 1.0, 100);
    assert_eq!(news(&mut report, 100).1.blind, Some(false));
    report.note_broken("perception fell over".to_owned());
    assert_eq!(news(&mut report, 110).1, News { blind: Some(true), state: true });
    // The next frame comes, and is not judged either.
    deliver(&mut report, 1.0, 200);
    assert_eq!(news(&mut report, 200).0, CameraState::Failing);
    report.note_judged(Duration::from_millis(300), Duration::from_millis(301), None);
    assert_eq!(news(&mut report, 301).1.blind, Some(false));
}

/// Panics at every hand of a first feature below zero.
#[derive(Debug)]
struct Fragile(Vocabulary);

impl Classify for Fragile {
    fn vocabulary(&self) -> &Vocabulary {
        &self.0
    }
    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        assert!(features[0] >= 0.0, "a root of nothing");
        Ok(vec![0.25, 0.75])
    }
}

#[test]
fn a_classifier_that_panics_is_named_and_blinds_until_it_judges_again() {
    let classifier = Fragile(Vocabulary::new(["fist", "palm"]).unwrap());
    let mut report = CameraReport::of_camera(false, PERIOD);
    deliver(&mut report, 1.0, 0);
    let mut write = |at_ms, feature: Option<f32>| {
        let at = Duration::from_millis(at_ms);
        report.note_judged(at, at, feature.map(|feature| vec![feature]));
        report.write(at, "a test", None, Some(&classifier))
    };
    assert_eq!(write(0, Some(1.0)).0.opinion.unwrap().gesture, "palm");
    for at in [10, 20] {
        let (camera, _) = write(at, (at == 10).then_some(-1.0));
        assert_eq!(camera.state, CameraState::Failing, "{camera:?}");
        assert!(camera.trouble.contains("a root of nothing") && camera.opinion.is_none(), "{camera:?}");
    }
    let (camera, news) = write(30, Some(1.0));
    assert_eq!((camera.state, news.blind), (CameraState::Live, Some(false)), "{camera:?}");
}
