//! What is lost where a fusion centre asks a camera for fewer frames than it takes: reduced ones ten times a second for what moves, and,
//! while a round is open, three within τ for what hand they show.
//!
//! `cargo test -p gestalt-vision --test paced -- --nocapture` prints the figures; `GESTALT_LONG=1` takes 20 seeds.

#![cfg(feature = "opencv")]

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use gestalt_rounds::{Evidence, JudgedFrame};
use gestalt_strategies::{Classify, Judgement};
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::config::{LayerConfig, MotionConfig, Schedule};
use gestalt_vision::human::Human;
use gestalt_vision::model::RobotModel;
use gestalt_vision::motion::Change;
use gestalt_vision::pose::Pose;
use gestalt_vision::sight::{Sight, SightConfig};
use gestalt_vision::source::{
    Frame, Glove, MAX_MEGAPIXELS, RenderedSource, Scene, ScheduledSource, Source, decode_reduced, encode_jpeg,
};
use opencv::core::Mat;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

const SCHEDULE: Schedule =
    Schedule { period: Duration::from_millis(4200), still: Duration::from_millis(2200) };
const TAU: Duration = Duration::from_millis(500);
const CLIP: f64 = 6.0;

/// How long a round lasts.
const ROUND: Duration = Duration::from_secs(1);

/// Robots before the human.
const ROBOTS: usize = 2;

/// The times between two frames, in a round and between rounds.
#[derive(Clone, Copy)]
struct Paces {
    looking: Duration,
    watching: Duration,
}

const PACED: Paces =
    Paces { looking: Duration::from_nanos(166_666_667), watching: Duration::from_millis(100) };
const EVERY_FRAME: Paces = Paces { looking: Duration::ZERO, watching: Duration::ZERO };

/// One robot, as a centre sees for it.
struct Seat {
    sight: Sight,
    frame: Frame,
    due: Duration,
    evidence: Evidence,
}

/// A centre of robots that open rounds by what they see move.
struct Centre<'a> {
    model: &'a RobotModel,
    paces: Paces,
    seats: Vec<Seat>,
    opened: Option<Duration>,
    /// Frames decoded as they are, and reduced.
    taken: (u64, u64),
    /// When each round opened, and what was decided.
    rounds: Vec<(Duration, Option<usize>)>,
}

impl<'a> Centre<'a> {
    fn new(model: &'a RobotModel, paces: Paces) -> Self {
        let seat = |_| {
            let config = SightConfig {
                camera: CameraModel::parrot(),
                layer: LayerConfig::ALL,
                motion: MotionConfig::watching(),
            };
            Seat {
                sight: Sight::new(config, model.features).unwrap(),
                frame: Frame { image: Mat::default(), at: Duration::ZERO },
                due: Duration::ZERO,
                evidence: Evidence::new(6),
            }
        };
        let seats = (0..ROBOTS).map(seat).collect();
        Self { model, paces, seats, opened: None, taken: (0, 0), rounds: Vec::new() }
    }

    fn see(&mut self, robot: usize, jpeg: &[u8], at: Duration) {
        let seat = &mut self.seats[robot];
        // A camera that is asked sends what it took last.
        if at + Duration::from_millis(1) < seat.due {
            return;
        }
        let closely = seat.sight.looks_closely(self.opened.is_some());
        let as_it_is = closely || self.paces.watching.is_zero();
        let enough = |size| if as_it_is { size } else { seat.sight.enough(size) };
        let whole = decode_reduced(jpeg, MAX_MEGAPIXELS, enough, &mut seat.frame.image).unwrap();
        *(if as_it_is { &mut self.taken.0 } else { &mut self.taken.1 }) += 1;
        seat.frame.at = at;
        let taken = seat.sight.take_reduced(&seat.frame, whole, self.opened.is_some());
        seat.due = at + if closely { self.paces.looking } else { self.paces.watching };
        if let Some(Ok(seen)) = taken.observation
            && let Ok(Judgement { probabilities, unknown, view }) =
                self.model.classifier.judge(&seen.features)
        {
            let (quality, view) = (f64::from(seen.quality), view.unwrap_or_default());
            let frame = JudgedFrame { at, probabilities: &probabilities, unknown, quality, view: &view };
            seat.evidence.add(frame, TAU);
        }
        if let Some(Change::Shown { .. }) = taken.change
            && self.opened.is_none()
        {
            self.opened = Some(at);
            for seat in &mut self.seats {
                (seat.due, seat.evidence) = (at, Evidence::new(6));
            }
        }
    }

    fn close(&mut self, at: Duration) {
        let Some(opened) = self.opened.filter(|opened| at >= *opened + ROUND) else { return };
        self.opened = None;
        let votes = self.seats.iter().map(|seat| seat.evidence.clipped(CLIP));
        let votes: Vec<Vec<f32>> = votes.filter(|vote| !vote.is_empty()).collect();
        let total = |class: usize| votes.iter().map(|vote| vote[class]).sum::<f32>();
        let best = (0..6).max_by(|a, b| total(*a).total_cmp(&total(*b)));
        self.rounds.push((opened, best.filter(|_| !votes.is_empty())));
    }

    /// Showings in which exactly one round opened, and those of them that were right.
    fn score(&self, human: &Human, showings: u64) -> [u64; 2] {
        let mut score = [0, 0];
        for showing in 0..showings {
            let of: Vec<_> = self.rounds.iter().filter(|(at, _)| SCHEDULE.divide(*at).0 == showing).collect();
            if let [(at, decided)] = &of[..] {
                let right = *decided == human.last_shown(*at, &SCHEDULE).map(usize::from);
                score = [score[0] + 1, score[1] + u64::from(right)];
            }
        }
        score
    }
}

/// Shows gestures to both centres: showings with one round, and right ones, of every frame and paced; and what each decoded.
fn show(model: &RobotModel, seed: u64, showings: u64) -> [([u64; 2], (u64, u64)); 2] {
    let (human, mut chance) = (Human::new(seed), ChaCha8Rng::seed_from_u64(seed));
    let mut cameras: Vec<ScheduledSource> = (0..ROBOTS as u64)
        .map(|robot| {
            let pose = Pose {
                bearing_deg: chance.random_range(-50.0..50.0),
                elevation_deg: chance.random_range(-15.0..10.0),
                distance_m: chance.random_range(0.8..1.4),
            };
            let noise = seed << 8 | robot;
            let camera = RenderedSource::new(CameraModel::parrot(), pose, Glove::default(), noise).unwrap();
            ScheduledSource::new(camera, human, SCHEDULE, Duration::ZERO)
        })
        .collect();
    let mut centres = [EVERY_FRAME, PACED].map(|paces| Centre::new(model, paces));
    let frames = (30.0 * SCHEDULE.period.as_secs_f64() * showings as f64) as u32;
    for k in 0..frames {
        let at = Duration::from_secs_f64(f64::from(k) / 30.0);
        for (robot, camera) in cameras.iter_mut().enumerate() {
            let frame = camera.next_frame(at, &Scene::default()).unwrap();
            let jpeg = encode_jpeg(&frame.image, 80).unwrap();
            centres.iter_mut().for_each(|centre| centre.see(robot, &jpeg, at));
        }
        centres.iter_mut().for_each(|centre| centre.close(at));
    }
    centres.map(|centre| (centre.score(&human, showings), centre.taken))
}

#[test]
fn pacing_and_reduced_frames_lose_no_gesture() {
    let long = std::env::var_os("GESTALT_LONG").is_some();
    let (seeds, showings) = if long { (20, 12) } else { (2, 5) };
    let model = RobotModel::rendered().unwrap();
    let (next, found) = (AtomicU64::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed >= seeds {
                        return;
                    }
                    let seen = show(&model, seed, showings);
                    found.lock().unwrap().push(seen);
                }
            });
        }
    });
    let found = found.into_inner().unwrap();
    let sum = |which: usize, what: usize| found.iter().map(|seen| seen[which].0[what]).sum::<u64>();
    let all = seeds * showings;
    let taken = |which: usize| {
        let sum = |of: fn((u64, u64)) -> u64| found.iter().map(|seen| of(seen[which].1)).sum::<u64>();
        (sum(|taken| taken.0), sum(|taken| taken.1))
    };
    for (which, name) in [(0, "every frame"), (1, "paced")] {
        eprintln!(
            "{name}: {} of {all} showings opened one round, {} right; {:?} frames as they are and reduced",
            sum(which, 0),
            sum(which, 1),
            taken(which)
        );
    }
    // A point of a hundred, and of few showings one.
    let slack = (all / 100).max(1);
    assert!(sum(0, 1) * 10 >= all * 7, "the comparison is of gestures that can be read");
    assert!(sum(1, 0) + slack >= sum(0, 0), "rounds are opened as before");
    assert!(sum(1, 1) + slack >= sum(0, 1), "and decided as rightly");
    let (whole, reduced) = taken(1);
    assert!(3 * (whole + reduced) < taken(0).0 + taken(0).1, "for a third of the frames");
}
