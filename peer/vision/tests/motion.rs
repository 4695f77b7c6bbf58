//! Motion on real recordings. The data are not part of the project: `GESTALT_DATA`, or `../shared/data` seen from the
//! workspace; skipped where there are none.
//!
//! `cargo test -p gestalt-vision --test motion` prints the figures.

#![cfg(feature = "opencv")]

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use gestalt_protocol::MotionState;
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::config::Schedule;
use gestalt_vision::human::Human;
use gestalt_vision::motion::Change;
use gestalt_vision::motion::{MotionConfig, MotionDetector};
use gestalt_vision::pose::Pose;
use gestalt_vision::source::{Glove, RenderedSource, Scene, ScheduledSource, Source, Video};
use opencv::prelude::*;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

fn main() -> std::process::ExitCode {
    gestalt_trials::run(gestalt_trials::trials![
        [Works] by_the_clock_each_gesture_is_shown_once_and_leaves_once_to_cameras_of_any_rate,
        [Works] a_hand_that_sways_before_a_slow_camera_is_shown_once,
        [Works] a_hand_that_comes_before_the_empty_scene_is_known_is_shown_once,
        [Works, Data] every_visit_opens_rounds_and_the_empty_room_none,
        [Works, Data] at_two_frames_per_second_no_visit_is_missed,
        [Works, Data] signs_are_moving_and_what_is_before_and_after_them_still,
        [Works, Data] signs_are_seen_at_two_frames_per_second,
        [Works, Data] real_recordings_are_read,
    ])
}

fn recording(name: &str) -> PathBuf {
    gestalt_trials::data().join("video").join(name)
}

fn real_recordings_are_read() {
    let ending = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "mkv" || ending == "mp4");
    let files = std::fs::read_dir(gestalt_trials::data().join("video")).expect("there are recordings");
    let recordings: Vec<PathBuf> = files.map(|file| file.unwrap().path()).filter(ending).collect();
    assert!(!recordings.is_empty());
    for path in recordings {
        let mut video = Video::open(&path, false).unwrap();
        for _ in 0..3 {
            let frame = video.next_frame(Duration::ZERO, &Scene::default()).unwrap();
            assert!(frame.image.cols() >= 640, "{}", path.display());
        }
    }
}

/// What the detector made of one frame.
struct Watched {
    frame: usize,
    state: MotionState,
    change: Option<Change>,
}

struct Course {
    watched: Vec<Watched>,
    delay: Duration,
    /// The time of one frame of the recording.
    period: Duration,
    cost: Duration,
}

/// Watches every `step`th frame of a recording.
fn watch(path: &Path, step: usize) -> Course {
    let mut video = Video::open(path, false).unwrap();
    let period = video.period();
    let mut detector = MotionDetector::new(MotionConfig::watching()).unwrap();
    let mut watched: Vec<Watched> = Vec::new();
    let mut cost = Duration::ZERO;
    for frame in 0.. {
        let image = match video.next_frame(Duration::ZERO, &Scene::default()) {
            Ok(frame) => frame.image,
            Err(error) if error.is_the_end() => break,
            Err(error) => panic!("{error}"),
        };
        if frame % step != 0 {
            continue;
        }
        let at = period * u32::try_from(frame).unwrap();
        let began = Instant::now();
        let change = detector.watch(&image, at).unwrap();
        cost += began.elapsed();
        let state = detector.state();
        watched.push(Watched { frame, state, change });
    }
    let cost = cost / u32::try_from(watched.len()).unwrap();
    Course { watched, delay: detector.delay().unwrap(), period, cost }
}

/// The six visits, by eye: first and last frame with somebody in the picture.
const VISITS: [(usize, usize); 6] =
    [(61, 201), (228, 451), (503, 700), (745, 872), (922, 1204), (1236, 1364)];

fn visits(step: usize) {
    let Course { watched, delay, period, cost } = watch(&recording("one-by-one-person-detection.mp4"), step);
    let fps = 1.0 / (period.as_secs_f64() * step as f64);
    eprintln!("six visits at {fps:.0} frames per second: delay {delay:?}, {cost:?} a frame");
    // At one second, and a frame of the camera where that is more.
    let near = (10.0 + step as f64 - 1.0) as usize;
    for (entered, left) in VISITS {
        let of_visit = |w: &&Watched| (entered.saturating_sub(near)..=left + near).contains(&w.frame);
        let moving = || watched.iter().filter(of_visit).filter(|w| w.state == MotionState::Moving);
        let (first, last) = (moving().next().unwrap().frame, moving().next_back().unwrap().frame);
        let shown: Vec<usize> = watched
            .iter()
            .filter(|w| (entered..=left).contains(&w.frame) && matches!(w.change, Some(Change::Shown { .. })))
            .map(|w| w.frame)
            .collect();
        eprintln!("  {entered:4}–{left:4}: moving from {first:4} to {last:4}, shown at {shown:?}");
        assert!(first.abs_diff(entered) <= near && last.abs_diff(left) <= near);
        assert!(!shown.is_empty());
    }
    let elsewhere: Vec<usize> = watched
        .iter()
        .filter(|w| matches!(w.change, Some(Change::Shown { .. })))
        .map(|w| w.frame)
        .filter(|frame| !VISITS.iter().any(|(entered, left)| (entered..=left).contains(&frame)))
        .collect();
    assert!(elsewhere.is_empty(), "rounds in the empty room: {elsewhere:?}");
    let empty = watched.iter().filter(|w| w.state == MotionState::Empty).count();
    let seen_empty = |w: &&Watched| VISITS.iter().all(|(a, b)| w.frame + near < *a || w.frame > *b + near);
    let nobody: Vec<&Watched> = watched.iter().filter(seen_empty).collect();
    let right = nobody.iter().filter(|w| w.state == MotionState::Empty).count();
    eprintln!(
        "  {empty} frames called empty; of those a second and more from any visit {right} of {}",
        nobody.len()
    );
    assert!(delay <= Duration::from_millis(600), "{delay:?}");
}

fn every_visit_opens_rounds_and_the_empty_room_none() {
    visits(1);
}

fn at_two_frames_per_second_no_visit_is_missed() {
    visits(5);
}

/// Which part of the frames of all clips is right.
fn signs(step: usize) -> f64 {
    let (mut frames, mut right) = (0, 0);
    for line in include_str!("data/signs.csv").lines().skip(1) {
        let mut fields = line.split(',');
        let clip = fields.next().unwrap();
        let [first, last, length]: [usize; 3] =
            fields.map(|field| field.parse().unwrap()).collect::<Vec<_>>().try_into().unwrap();
        let Course { watched, delay, cost, .. } = watch(&recording(&format!("{clip}.mkv")), step);
        assert_eq!(watched.len(), length.div_ceil(step));
        let truth = |frame: usize| match (first..=last).contains(&frame) {
            true => MotionState::Moving,
            false => MotionState::Still,
        };
        let good = watched.iter().filter(|w| w.state == truth(w.frame)).count();
        let mut turns: Vec<(usize, MotionState)> = Vec::new();
        for w in &watched {
            if turns.last().is_none_or(|(_, state)| *state != w.state) {
                turns.push((w.frame, w.state));
            }
        }
        let share = good as f64 / watched.len() as f64;
        eprintln!(
            "  {clip:7} {first:3}–{last:3}: {share:.3} right, delay {delay:?}, {cost:?} a frame, {turns:?}"
        );
        // Every sign is seen to begin within the delay.
        let begins = turns.iter().find(|(_, state)| *state == MotionState::Moving).unwrap().0;
        assert!(begins <= first + (delay.as_secs_f64() * 30.0).round() as usize, "{clip}: {begins}");
        (frames, right) = (frames + watched.len(), right + good);
    }
    right as f64 / frames as f64
}

fn signs_are_moving_and_what_is_before_and_after_them_still() {
    let right = signs(1);
    eprintln!("ten signs at 30 frames per second: {right:.3} right");
    assert!(right >= 0.88, "{right}");
}

fn signs_are_seen_at_two_frames_per_second() {
    let right = signs(15);
    eprintln!("ten signs at 2 frames per second: {right:.3} right");
    assert!(right >= 0.75, "{right}");
}

/// A Foot-bot at 2 frames per second and a Parrot at 30, before the same human, who goes by the clock.
fn by_the_clock_each_gesture_is_shown_once_and_leaves_once_to_cameras_of_any_rate() {
    const SHOWINGS: u32 = 5;
    let schedule = Schedule { period: Duration::from_secs(6), still: Duration::from_millis(2500) };
    let in_place = schedule.nobody() + Schedule::MOVE;
    for camera in CameraModel::presets() {
        for (seed, bearing_deg) in [(1, -60.0), (2, 0.0), (3, 35.0)] {
            let pose = Pose { bearing_deg, elevation_deg: -10.0, distance_m: 1.0 };
            let period = camera.period();
            let rendered = RenderedSource::new(camera.clone(), pose, Glove::default(), seed).unwrap();
            let zero = schedule.period * 300_000_000;
            let mut source = ScheduledSource::new(rendered, Human::new(seed), schedule, zero);
            let mut detector = MotionDetector::new(MotionConfig::watching()).unwrap();
            let mut changes: Vec<(u32, Duration, Change)> = Vec::new();
            // Frames come a little late or early, as they do.
            let mut frame = 0;
            let mut at = Duration::from_millis(70 * seed);
            while at < SHOWINGS * schedule.period + Duration::from_millis(600) {
                let image = source.next_frame(at, &Scene::default()).unwrap().image;
                if let Some(change) = detector.watch(&image, at).unwrap() {
                    // The frame in which a hand has left may be the first of the next period.
                    let late = if change == Change::Left { period } else { Duration::ZERO };
                    let showing = (at.saturating_sub(late).as_secs_f64() / 6.0) as u32;
                    changes.push((showing, at.saturating_sub(showing * schedule.period), change));
                }
                frame += 1;
                at += period.mul_f64(if frame % 3 == 0 { 1.2 } else { 0.9 });
            }
            let mut delays: Vec<Duration> = Vec::new();
            let mut shown = changes.iter().filter(|(_, _, change)| matches!(change, Change::Shown { .. }));
            for showing in 0..SHOWINGS {
                let Some((of, into, Change::Shown { began })) = shown.next() else { panic!("{changes:?}") };
                assert_eq!(*of, showing, "{} {seed}: {changes:?}", camera.name);
                let began = began.saturating_sub(showing * schedule.period);
                assert!(began <= in_place, "{} {seed}: {began:?}", camera.name);
                delays.push(into.saturating_sub(in_place));
            }
            assert!(shown.next().is_none(), "{} {seed}: {changes:?}", camera.name);
            let left = changes.iter().filter(|(_, _, change)| *change == Change::Left);
            let left: Vec<u32> = left.map(|(showing, _, _)| *showing).collect();
            assert_eq!(left, (0..SHOWINGS).collect::<Vec<_>>(), "{} {seed}: {changes:?}", camera.name);
            let (mean, most) = (delays.iter().sum::<Duration>() / SHOWINGS, *delays.iter().max().unwrap());
            let published = detector.delay().unwrap();
            eprintln!(
                "{} {bearing_deg:3}°: shown {mean:.0?} after the hand is in place, at most {most:.0?}; published {published:.0?}",
                camera.name
            );
            // One frame may pass before the first that shows it in place.
            assert!(most <= published + period.mul_f64(1.3), "{most:?} {published:?}");
        }
    }
}

/// A hand near a camera of 2 frames per second sways over many pixels between two of them.
fn a_hand_that_sways_before_a_slow_camera_is_shown_once() {
    const SHOWINGS: u32 = 100;
    let schedule = Schedule { period: Duration::from_secs(6), still: Duration::from_millis(2500) };
    for (seed, bearing_deg) in [(1, -18.0), (2, 6.0), (3, 30.0), (4, 6.0)] {
        let pose = Pose { bearing_deg, elevation_deg: 0.0, distance_m: 0.9 };
        let rendered = RenderedSource::new(CameraModel::footbot(), pose, Glove::default(), seed).unwrap();
        let mut source = ScheduledSource::new(rendered, Human::new(5), schedule, Duration::ZERO);
        let mut detector = MotionDetector::new(MotionConfig::watching()).unwrap();
        let mut shown = vec![0; SHOWINGS as usize];
        // A little slower than twice a second, so that frames fall on all parts of the showings.
        let frames = (1..).map(|frame| frame * Duration::from_millis(501));
        for at in frames.take_while(|at| *at < SHOWINGS * schedule.period) {
            let image = source.next_frame(at, &Scene::default()).unwrap().image;
            if let Some(Change::Shown { .. }) = detector.watch(&image, at).unwrap() {
                shown[(at.as_secs_f64() / 6.0) as usize] += 1;
            }
        }
        let other: Vec<_> = (0..).zip(&shown).filter(|(_, times)| **times != 1).collect();
        assert!(other.is_empty(), "{seed}: showings and how often they were shown: {other:?}");
    }
}

/// The first that a robot sees of the world may be a hand: it does not know the empty scene yet, and frames come when a busy
/// machine lets them.
fn a_hand_that_comes_before_the_empty_scene_is_known_is_shown_once() {
    const SHOWINGS: u32 = 200;
    let schedule = Schedule { period: Duration::from_secs(6), still: Duration::from_millis(2500) };
    for (seed, bearing_deg) in [(5, -18.0), (3, 30.0)] {
        let pose = Pose { bearing_deg, elevation_deg: 0.0, distance_m: 0.9 };
        let rendered = RenderedSource::new(CameraModel::footbot(), pose, Glove::default(), seed).unwrap();
        let mut source = ScheduledSource::new(rendered, Human::new(5), schedule, Duration::ZERO);
        let mut chance = ChaCha8Rng::seed_from_u64(seed);
        let mut shown = vec![0; SHOWINGS as usize];
        for showing in 0..SHOWINGS {
            let mut detector = MotionDetector::new(MotionConfig::watching()).unwrap();
            let mut at = showing * schedule.period + Duration::from_millis(chance.random_range(0..1500));
            while at < (showing + 1) * schedule.period {
                let image = source.next_frame(at, &Scene::default()).unwrap().image;
                if let Some(Change::Shown { .. }) = detector.watch(&image, at).unwrap() {
                    shown[showing as usize] += 1;
                }
                at += Duration::from_millis(chance.random_range(500..520));
            }
        }
        let other: Vec<_> = (0..).zip(&shown).filter(|(_, times)| **times != 1).collect();
        assert!(other.is_empty(), "{seed}: showings and how often they were shown: {other:?}");
    }
}
