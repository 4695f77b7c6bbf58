use opencv::core::{CV_8UC3, Point, Rect, Scalar, Size, Vec3b};
use opencv::imgproc;
use opencv::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

const RATES: [f64; 3] = [2.0, 10.0, 30.0];

/// A wall with a shelf and a pole, 320×240.
fn room() -> Mat {
    let wall = Scalar::new(150.0, 155.0, 160.0, 0.0);
    let mut room = Mat::new_size_with_default(Size::new(320, 240), CV_8UC3, wall).unwrap();
    let shelf = Rect::new(20, 40, 90, 30);
    imgproc::rectangle(
        &mut room,
        shelf,
        Scalar::new(60.0, 80.0, 100.0, 0.0),
        imgproc::FILLED,
        imgproc::LINE_8,
        0,
    )
    .unwrap();
    let (top, bottom) = (Point::new(250, 0), Point::new(240, 239));
    imgproc::line(&mut room, top, bottom, Scalar::all(220.0), 6, imgproc::LINE_AA, 0).unwrap();
    room
}

/// The room with a hand in it, as far from its place as that.
fn with_hand(away: f64) -> Mat {
    let mut scene = room();
    let at = Point::new((170.0 + away) as i32, 130);
    imgproc::circle(
        &mut scene,
        at,
        22,
        Scalar::new(120.0, 160.0, 220.0, 0.0),
        imgproc::FILLED,
        imgproc::LINE_AA,
        0,
    )
    .unwrap();
    scene
}

/// A camera of that noise, of which each frame takes another part, and that gain of each channel.
struct Camera {
    rng: ChaCha8Rng,
    noise: Vec<f32>,
}

impl Camera {
    fn new(deviation: f32) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        // Three uniform values make a bell of their standard deviation.
        let mut bell = || (0..3).map(|_| rng.random_range(-1.0..1.0_f32)).sum::<f32>();
        let noise = (0..4 * 320 * 240).map(|_| bell() * deviation).collect();
        Self { rng, noise }
    }

    fn take(&mut self, scene: &Mat, gain: [f32; 3]) -> Mat {
        let mut frame = scene.clone();
        let from = self.rng.random_range(0..320_u64 * 240) as usize;
        let pixels = frame.data_typed_mut::<Vec3b>().unwrap().iter_mut();
        for (pixel, noise) in pixels.zip(self.noise[from..].chunks_exact(3)) {
            for channel in 0..3 {
                let value = f32::from(pixel[channel]) * gain[channel] + noise[channel];
                pixel[channel] = value.clamp(0.0, 255.0) as u8;
            }
        }
        frame
    }
}

/// What happened, and the seconds at which it did.
type Timed<T> = Vec<(f64, T)>;

/// What a detector says of a scene that lasts that long at that rate.
fn watch(
    fps: f64,
    seconds: f64,
    noise: f32,
    scene: impl Fn(f64) -> (Mat, [f32; 3]),
) -> (Timed<Change>, Timed<MotionState>, MotionDetector) {
    let mut detector = MotionDetector::new(MotionConfig::watching()).unwrap();
    let mut camera = Camera::new(noise);
    let (mut changes, mut states) = (Vec::new(), Vec::new());
    for frame in 0..(seconds * fps) as u32 {
        let at = f64::from(frame) / fps;
        let (scene, gain) = scene(at);
        let frame = camera.take(&scene, gain);
        let change = detector.watch(&frame, Duration::from_secs_f64(at)).unwrap();
        changes.extend(change.map(|change| (at, change)));
        if states.last().is_none_or(|(_, state)| *state != detector.state()) {
            states.push((at, detector.state()));
        }
    }
    (changes, states, detector)
}

fn order(states: &[(f64, MotionState)]) -> Vec<MotionState> {
    states.iter().map(|(_, state)| *state).collect()
}

use MotionState::{Empty, Moving, Still};

#[test]
fn a_noisy_camera_before_nobody_sees_an_empty_scene_for_ever() {
    for fps in RATES {
        for noise in [0.0, 4.0, 12.0] {
            let (changes, states, detector) = watch(fps, 12.0, noise, |_| (room(), [1.0; 3]));
            assert!(changes.is_empty(), "{fps} {noise} {changes:?}");
            assert_eq!(order(&states), [Still, Empty], "{fps} {noise}");
            assert_eq!(states[1].0, 3.0);
            let background = detector.background().unwrap();
            assert_eq!((background.cols(), background.rows()), (160, 120));
        }
    }
}

#[test]
fn slow_light_and_a_step_of_the_exposure_are_no_movement() {
    for fps in RATES {
        let (changes, states, _) = watch(fps, 24.0, 3.0, |at| {
            // The sun sets, the white balance follows, and at 12 s the exposure is doubled at once.
            let sun = 1.0 - 0.02 * at as f32;
            let step = if at < 12.0 { 0.7 } else { 1.4 };
            (room(), [sun * step, 0.98 * sun * step, step * (1.0 - 0.03 * at as f32)])
        });
        assert!(changes.is_empty() && order(&states) == [Still, Empty], "{fps}: {states:?}");
    }
}

/// Nobody until 4 s; a hand comes in for 1 s, holds for 3 s, and leaves for 1 s.
fn showing(at: f64) -> (Mat, [f32; 3]) {
    let scene = match at {
        4.0..5.0 => with_hand(200.0 * (5.0 - at)),
        // It trembles.
        5.0..8.0 => with_hand((at * 20.0).sin()),
        8.0..9.0 => with_hand(200.0 * (at - 8.0)),
        _ => room(),
    };
    (scene, [1.0; 3])
}

#[test]
fn a_hand_that_comes_holds_and_leaves_is_shown_once_and_leaves_once_at_any_rate() {
    for fps in RATES {
        let (changes, states, detector) = watch(fps, 14.0, 3.0, showing);
        assert_eq!(order(&states), [Still, Empty, Moving, Still, Moving, Empty], "{fps} {states:?}");
        let [(shown, Change::Shown { began }), (left, Change::Left)] = changes[..] else {
            panic!("{fps}: {changes:?}")
        };
        let delay = detector.delay().unwrap().as_secs_f64();
        // From the first frame that shows it still.
        assert!(shown - 5.0 <= delay + 1.0 / fps + 1e-6, "{fps}: {shown} {delay}");
        assert!((8.0..8.0 + delay + 1.0 / fps).contains(&left), "{fps}: {left}");
        let began = began.as_secs_f64();
        // Nothing of the hand is in the picture for the first quarter second.
        assert!((3.4..=4.4).contains(&began), "{fps}: {began}");
        let expected = if fps < 3.0 { 1.0 / fps } else { 0.5 };
        assert!((delay - expected).abs() <= 0.11, "{fps}: {delay}");
    }
}

#[test]
fn a_slow_camera_sees_the_movement_begin_no_later_than_a_fast_one_sees_it_end() {
    let shown = |fps| match watch(fps, 8.0, 3.0, showing).0[..] {
        [(at, Change::Shown { began })] => (at, began.as_secs_f64()),
        ref other => panic!("{other:?}"),
    };
    let ((slow_at, slow_began), (fast_at, fast_began)) = (shown(2.0), shown(30.0));
    // Whichever opens a round first, the other takes it for the round of its own showing.
    assert!(slow_began < fast_at && fast_began < slow_at);
}

#[test]
fn an_empty_room_that_comes_back_is_known_though_somebody_was_there_first() {
    for fps in RATES {
        // At the start a hand is there, for long enough to be taken for a part of the room.
        let (changes, states, _) = watch(fps, 24.0, 3.0, |at| match at {
            0.0..4.0 => (with_hand(-60.0), [1.0; 3]),
            4.0..5.0 => (with_hand(260.0 * (at - 4.0) - 60.0), [1.0; 3]),
            at => {
                // Never twice in the same pose.
                let pose = 20.0 * ((at - 5.0) / 9.0).floor();
                match (at - 5.0) % 9.0 {
                    into @ 4.0..5.0 => (with_hand(200.0 * (5.0 - into) + pose), [1.0; 3]),
                    5.0..8.0 => (with_hand(pose), [1.0; 3]),
                    into @ 8.0..9.0 => (with_hand(200.0 * (into - 8.0) + pose), [1.0; 3]),
                    _ => (room(), [1.0; 3]),
                }
            }
        });
        let last_empty = states.iter().rev().find(|(_, state)| *state == Empty).unwrap();
        assert!((13.0..16.0).contains(&last_empty.0) || last_empty.0 > 22.0, "{fps}: {states:?}");
        let late: Vec<_> = changes.iter().filter(|(at, _)| *at > 14.0).collect();
        assert!(matches!(late[..], [(_, Change::Shown { .. }), (_, Change::Left)]), "{fps}: {changes:?}");
    }
}

#[test]
fn a_flicker_of_one_frame_at_full_rate_is_no_movement() {
    let (changes, states, _) = watch(30.0, 8.0, 3.0, |at| {
        let torn = (6.0..6.03).contains(&at);
        (if torn { with_hand(20.0) } else { room() }, [1.0; 3])
    });
    assert!(changes.is_empty() && order(&states) == [Still, Empty], "{states:?}");
}

#[test]
fn furniture_belongs_to_the_room_after_a_while() {
    let (changes, states, _) = watch(2.0, 80.0, 3.0, |at| {
        let scene = if at < 5.0 { room() } else { with_hand(0.0) };
        (scene, [1.0; 3])
    });
    assert_eq!(order(&states), [Still, Empty, Moving, Still, Empty], "{states:?}");
    assert!(matches!(changes[..], [(_, Change::Shown { .. }), (_, Change::Left)]), "{changes:?}");
    assert!((64.0..68.0).contains(&states[4].0), "{states:?}");
}

#[test]
fn frames_that_are_no_pictures_are_refused_and_the_next_one_is_watched() {
    let mut detector = MotionDetector::new(MotionConfig::watching()).unwrap();
    let grey =
        Mat::new_size_with_default(Size::new(64, 48), opencv::core::CV_8UC1, Scalar::all(9.0)).unwrap();
    assert!(matches!(detector.watch(&grey, Duration::ZERO), Err(MotionError::Frame { channels: 1, .. })));
    assert!(matches!(detector.watch(&Mat::default(), Duration::ZERO), Err(MotionError::Frame { .. })));
    for frame in 0..9 {
        detector.watch(&room(), Duration::from_millis(frame * 500)).unwrap();
    }
    assert_eq!(detector.state(), Empty);
    // Time that stands still or runs back tells nothing.
    assert_eq!(detector.watch(&with_hand(0.0), Duration::from_secs(1)).unwrap(), None);
    assert_eq!(detector.state(), Empty);
    // Another format is another scene.
    let mut wide = Mat::default();
    imgproc::resize(&room(), &mut wide, Size::new(320, 180), 0.0, 0.0, imgproc::INTER_AREA).unwrap();
    detector.watch(&wide, Duration::from_secs(6)).unwrap();
    assert!(detector.state() == Still && detector.background().is_none());
}
