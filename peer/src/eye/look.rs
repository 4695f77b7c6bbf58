//! An open eye at work: it follows its robot's rounds, and tells the robot what each frame shows.

use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::{Duration, Instant};

use gestalt_link::{Event, Robot};
use gestalt_protocol::{CameraState, RoundId};
use gestalt_vision::human::Human;
use gestalt_vision::sight::{Sight, Taken};
use gestalt_vision::source::{Frame, Reader, Scene, SourceError};
use gestalt_vision::steady::{Broken, Steady};
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;
use tokio::time::MissedTickBehavior;

use super::window::{Found, Window};
use super::{Eye, Seen};
use crate::camera_report::{self, CameraReport};
use crate::stream::Inlet;
use crate::telling::{tell, tell_camera};

/// Looks until the robot is gone. The camera has a thread of its own and judging is done beside the robot's task, so that
/// neither delays a vote; a frame that comes while one is judged waits, and is replaced by the next.
pub(crate) async fn look(
    eye: Eye,
    robot: Weak<Robot>,
    mut events: Receiver<Event>,
    seen: Arc<Mutex<Option<Seen>>>,
) {
    let last_word = LastWord(robot.clone());
    let Eye { source, open, describe, watches, live, period, sight, human, zero, inlet, window } = eye;
    let reader = match Reader::start(source, open, zero) {
        Ok(reader) => reader,
        Err(error) => return last_word.say(&format!("no thread for the camera: {error}")),
    };
    let mut report = CameraReport::of_camera(live, period);
    if watches {
        reader.want(Some(Scene::default()));
    }
    if watches || live {
        report.expect(zero.elapsed());
    }
    let rounds = Rounds { now: None, reader, human, watches, live, inlet };
    let mut eye = Looking {
        rounds,
        report,
        sight: Some(sight),
        describe,
        period,
        zero,
        seen,
        replaced: 0,
        paused: false,
        window,
    };
    let mut tick = tokio::time::interval(camera_report::INTERVAL);
    tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            event = events.recv() => match event {
                Ok(Event::Opened(round)) => eye.follow(Some(round)),
                Ok(Event::Closed(round)) if eye.round() == Some(round) => eye.follow(None),
                Ok(_) => {}
                // Who missed events asks where the robot stands.
                Err(RecvError::Lagged(_)) => {
                    let Some(robot) = robot.upgrade() else { return };
                    eye.follow(robot.open());
                }
                Err(RecvError::Closed) => return,
            },
            frame = eye.rounds.reader.next() => {
                let Some(robot) = robot.upgrade() else { return };
                match frame {
                    Ok(frame) => eye.on_frame(frame, &robot).await,
                    Err(error) => eye.on_error(&error, &robot),
                }
                eye.keep_status(&robot);
            }
            _ = tick.tick() => {
                let Some(robot) = robot.upgrade() else { return };
                eye.keep_status(&robot);
            }
        }
    }
}

/// Which round it looks for, and the camera that is told so.
struct Rounds {
    /// And when it learned of it.
    now: Option<(RoundId, Duration)>,
    reader: Reader,
    human: Human,
    watches: bool,
    live: bool,
    /// Where its frames come in, if they come from another machine.
    inlet: Option<Arc<Inlet>>,
}

struct Looking {
    rounds: Rounds,
    report: CameraReport,
    /// `None` while a frame is judged.
    sight: Option<Steady<Sight>>,
    describe: String,
    period: Duration,
    zero: Instant,
    seen: Arc<Mutex<Option<Seen>>>,
    /// How many frames were replaced by newer ones, as far as its sight knows.
    replaced: u64,
    /// Whether a round has ended, where motion is not watched, since the last frame that was taken in.
    paused: bool,
    window: Option<Arc<Window>>,
}

impl Looking {
    fn round(&self) -> Option<RoundId> {
        self.rounds.now.map(|(round, _)| round)
    }

    /// Looks for that round from now on, or for none.
    fn follow(&mut self, round: Option<RoundId>) {
        if round == self.round() {
            return;
        }
        let Rounds { now, reader, human, watches, live, inlet } = &mut self.rounds;
        *now = round.map(|round| (round, self.zero.elapsed()));
        match round {
            Some(round) => {
                if let Some(inlet) = inlet.as_ref().filter(|_| !*watches) {
                    // What has waited there while nobody looked shows what was before.
                    inlet.skip_older(self.period);
                }
                reader.want(Some(human.shows(round)));
                self.report.expect(self.zero.elapsed());
            }
            None => {
                reader.want(watches.then(Scene::default));
                self.paused |= !*watches;
                if !(*watches || *live) {
                    self.report.rest();
                }
            }
        }
    }

    async fn on_frame(&mut self, frame: Frame, robot: &Robot) {
        if !self.report.note_frame(&frame.image, frame.at) {
            return;
        }
        if !(self.rounds.watches || self.round().is_some()) {
            if let Some(window) = &self.window {
                window.offer(&frame.image, frame.at, || Found::NotLooked);
            }
            return;
        }
        let Some(mut sight) = self.sight.take() else { unreachable!("frames are judged one by one") };
        // What was taken before the round opened may show the gesture of the round before. A camera may have been about to
        // take its next picture.
        let fresh = |(_, since): &(RoundId, Duration)| frame.at.saturating_add(self.period) >= *since;
        let round = self.rounds.now.filter(fresh).map(|(round, _)| round);
        let (seen, window) = (self.seen.clone(), self.window.clone());
        let replaced = self.rounds.reader.dropped();
        let passed_over = replaced - std::mem::replace(&mut self.replaced, replaced);
        let resumes = std::mem::take(&mut self.paused);
        let stated = self.rounds.inlet.as_ref().and_then(|inlet| inlet.fps());
        let judged = tokio::task::spawn_blocking(move || {
            let rate = |sight: &mut Sight| match stated {
                Some(fps) => sight.rate_is(fps),
                None if resumes => sight.resume(),
                None => sight.passed_over(passed_over),
            };
            let taken = judge(&mut sight, frame, round, rate, &seen, window.as_deref());
            (sight, taken)
        });
        // What panics there is caught there; it is cancelled only when the program ends.
        let Ok((sight, taken)) = judged.await else { return };
        self.sight = Some(sight);
        match taken {
            Ok(taken) => {
                let hand = taken.observation.as_ref().and_then(|seen| seen.as_ref().ok());
                let features = hand.map(|observation| observation.features.clone());
                self.report.note_judged(taken.at, self.zero.elapsed(), features);
                tell(taken, robot, self.zero);
            }
            Err(broken) => self.report.note_broken(format!("perception {broken}")),
        }
    }

    fn on_error(&mut self, error: &SourceError, robot: &Robot) {
        self.report.note_error(error);
        robot.count("frames_failed");
        robot.report_error(&error.to_string());
    }

    fn keep_status(&mut self, robot: &Robot) {
        let now = self.zero.elapsed();
        if self.report.is_due(now) {
            let motion = self.sight.as_ref().and_then(Steady::get).and_then(Sight::motion);
            tell_camera(&mut self.report, robot, &self.describe, motion, self.zero);
        }
    }
}

/// Takes one look, after `rate` told the sight of the camera's. `seen` receives the frame of a round, `window` any.
fn judge(
    sight: &mut Steady<Sight>,
    frame: Frame,
    round: Option<RoundId>,
    rate: impl FnOnce(&mut Sight),
    seen: &Mutex<Option<Seen>>,
    window: Option<&Window>,
) -> Result<Taken, Broken> {
    let taken = sight.run(frame.at, |sight| {
        rate(sight);
        sight.take(&frame, round.is_some())
    })?;
    if let (Some(window), Some(sight)) = (window, sight.get()) {
        window.offer(&frame.image, frame.at, || Found::of(&taken, sight));
    }
    if let (Some(round), Some(observation)) = (round, &taken.observation) {
        let features = observation.as_ref().ok().map(|observation| observation.features.clone());
        *seen.lock().unwrap_or_else(PoisonError::into_inner) =
            Some(Seen { round, image: frame.image, features });
    }
    Ok(taken)
}

/// Speaks for an eye that can do so no more: should its own task panic, the swarm is not to wait for it.
struct LastWord(Weak<Robot>);

impl LastWord {
    fn say(&self, trouble: &str) {
        let Some(robot) = self.0.upgrade() else { return };
        robot.blind(true);
        robot.report_error(trouble);
        robot.update_camera(|camera| {
            camera.state = CameraState::Failing;
            trouble.clone_into(&mut camera.trouble);
        });
    }
}

impl Drop for LastWord {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.say("the eye's task panicked and sees nothing any more: restart the robot; RUST_BACKTRACE=1 shows where");
        }
    }
}
