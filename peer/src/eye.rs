//! A robot's eye: frames in, observations out, while a round is open; all the time where motion is watched.

use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::{Duration, Instant};

use gestalt_link::{Event, Robot};
use gestalt_protocol::{CameraState, RobotId, RoundId};
use gestalt_strategies::Classify;
use gestalt_vision::human::Human;
use gestalt_vision::model::RobotModel;
use gestalt_vision::sight::{Sight, SightError, Taken};
use gestalt_vision::source::{Frame, Opener, Reader, Scene, Source, SourceError};
use opencv::core::Mat;
use thiserror::Error;
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;
use tokio::time::MissedTickBehavior;

use crate::camera_report::{self, CameraReport};
use crate::camera_source::{human_before, open_source};
use crate::config::{CameraSection, SourceSection};
use crate::stream::{Inlet, StreamSource};
use crate::telling::tell;

/// Why an eye cannot open.
#[derive(Debug, Error)]
pub enum EyeError {
    /// Its source of frames.
    #[error("camera: {0}")]
    Source(#[from] SourceError),
    /// What it sees with.
    #[error(transparent)]
    Sight(#[from] SightError),
}

/// An open eye.
pub struct Eye {
    /// `None`: a device that is not there yet.
    source: Option<Box<dyn Source>>,
    open: Opener,
    describe: String,
    /// Whether it looks also while no round is open.
    watches: bool,
    live: bool,
    sight: Sight,
    human: Human,
    /// Where its frames come in, if they come from another machine.
    inlet: Option<Arc<Inlet>>,
    /// The zero of its time.
    zero: Instant,
}

/// A frame, and what perception made of it.
#[derive(Clone, Debug)]
pub struct Seen {
    /// In which round.
    pub round: RoundId,
    /// The frame, BGR.
    pub image: Mat,
    /// The raw features of the hand; `None` when no hand was found.
    pub features: Option<Vec<f32>>,
}

impl Seen {
    /// What a classifier thinks of it: the probability of each class; empty when no hand was found.
    #[must_use]
    pub fn probabilities(&self, classifier: &dyn Classify) -> Vec<f64> {
        let judged = self.features.as_ref().and_then(|features| classifier.probabilities(features).ok());
        judged.unwrap_or_default()
    }
}

impl Eye {
    /// Opens the eye a configuration describes; `None` for a robot without one. A device that is not there is no error: it is
    /// tried again and again. `clock` is the time since 1970 now, for a human who goes by it.
    ///
    /// # Errors
    /// See [`EyeError`].
    pub fn open(
        camera: &CameraSection,
        model: &RobotModel,
        robot: RobotId,
        clock: Duration,
    ) -> Result<Option<Self>, EyeError> {
        if matches!(camera.source, SourceSection::None) {
            return Ok(None);
        }
        let inlet = match &camera.source {
            SourceSection::Stream(stream) => Some(Inlet::new(stream.robot.unwrap_or(robot))),
            _ => None,
        };
        let (section, frames_from) = (camera.clone(), inlet.clone());
        let zero = Instant::now();
        let mut open: Opener = Box::new(move || match &frames_from {
            Some(inlet) => {
                let period = section.model.properties().period();
                Ok(Box::new(StreamSource::new(inlet.clone(), period)) as Box<dyn Source>)
            }
            None => open_source(&section, robot, clock),
        });
        let (source, describe, live) = match &camera.source {
            // A driver may hang: it is opened where it keeps nobody.
            SourceSection::Device(device) => (None, format!("device {}", device.path.display()), true),
            _ => {
                let source = open()?;
                let (describe, live) = (source.describe(), source.is_live());
                (Some(source), describe, live)
            }
        };
        let sight = Sight::new(camera.sight(), model.features)?;
        let (watches, human) = (camera.motion.enabled, human_before(camera));
        Ok(Some(Self { source, open, describe, watches, live, sight, human, inlet, zero }))
    }

    /// Where its frames come in, if they come from another machine: to be opened at the robot's session.
    #[must_use]
    pub fn inlet(&self) -> Option<Arc<Inlet>> {
        self.inlet.clone()
    }

    /// What it looks through, in words.
    #[must_use]
    pub fn describe(&self) -> String {
        self.describe.clone()
    }
}

/// Looks until the robot is gone. The camera has a thread of its own and judging is done beside the robot's task, so that
/// neither delays a vote; a frame that comes while one is judged waits, and is replaced by the next.
pub(crate) async fn look(
    eye: Eye,
    robot: Weak<Robot>,
    mut events: Receiver<Event>,
    seen: Arc<Mutex<Option<Seen>>>,
) {
    let Eye { source, open, describe, watches, live, mut sight, human, zero, inlet: _inlet } = eye;
    let reader = match Reader::start(source, open, zero) {
        Ok(reader) => reader,
        Err(error) => {
            if let Some(robot) = robot.upgrade() {
                robot.report_error(&format!("no thread for the camera: {error}"));
            }
            return;
        }
    };
    let mut report = CameraReport::new(live);
    let mut state = CameraState::None;
    let mut round = None;
    if watches {
        reader.want(Some(Scene::default()));
    }
    if watches || live {
        report.expect(zero.elapsed());
    }
    let mut tick = tokio::time::interval(camera_report::INTERVAL);
    tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            event = events.recv() => match event {
                Ok(Event::Opened(opened)) => {
                    round = Some(opened);
                    reader.want(Some(human.shows(opened)));
                    report.expect(zero.elapsed());
                }
                Ok(Event::Closed(closed)) if round == Some(closed) => {
                    round = None;
                    reader.want(watches.then(Scene::default));
                    if !(watches || live) {
                        report.rest();
                    }
                }
                Ok(_) | Err(RecvError::Lagged(_)) => {}
                Err(RecvError::Closed) => return,
            },
            frame = reader.next() => {
                let Some(robot) = robot.upgrade() else { return };
                match frame {
                    Ok(frame) => {
                        let worth = report.note_frame(&frame);
                        if !worth || (round.is_none() && !watches) {
                            continue;
                        }
                        let (current, shared) = (round, seen.clone());
                        let judged = tokio::task::spawn_blocking(move || {
                            let taken = judge(&mut sight, frame, current, &shared);
                            (sight, taken)
                        });
                        let Ok((returned, taken)) = judged.await else { return };
                        sight = returned;
                        let hand = taken.observation.as_ref().and_then(|seen| seen.as_ref().ok());
                        let features = hand.map(|observation| observation.features.clone());
                        report.note_judged(taken.at, zero.elapsed(), features);
                        tell(taken, &robot, zero);
                    }
                    Err(error) => {
                        report.note_error(&error);
                        robot.count("frames_failed");
                        robot.report_error(&error.to_string());
                    }
                }
                keep_status(&mut report, &mut state, &robot, &sight, &describe, zero);
            }
            _ = tick.tick() => {
                let Some(robot) = robot.upgrade() else { return };
                keep_status(&mut report, &mut state, &robot, &sight, &describe, zero);
            }
        }
    }
}

/// Takes one look. `seen` receives the frame of a round.
fn judge(sight: &mut Sight, frame: Frame, round: Option<RoundId>, seen: &Mutex<Option<Seen>>) -> Taken {
    let taken = sight.take(&frame, round.is_some());
    if let (Some(round), Some(observation)) = (round, &taken.observation) {
        let features = observation.as_ref().ok().map(|observation| observation.features.clone());
        *seen.lock().unwrap_or_else(PoisonError::into_inner) =
            Some(Seen { round, image: frame.image, features });
    }
    taken
}

/// Writes to the robot's status what there is to say of its camera, when it is time to.
fn keep_status(
    report: &mut CameraReport,
    state: &mut CameraState,
    robot: &Robot,
    sight: &Sight,
    source: &str,
    zero: Instant,
) {
    let now = zero.elapsed();
    if !report.is_due(now) {
        return;
    }
    let classifier = robot.classifier();
    let mut camera = report.write(now, source, sight.motion(), classifier.as_deref());
    if let Some(opinion) = &mut camera.opinion {
        // The eye was open before the robot started.
        let before = robot.started().saturating_duration_since(zero).as_millis();
        opinion.at_ms = opinion.at_ms.saturating_sub(u64::try_from(before).unwrap_or(u64::MAX));
    }
    let blind = |state| matches!(state, CameraState::Frozen | CameraState::Failing | CameraState::Ended);
    if blind(camera.state) != blind(*state) {
        robot.blind(blind(camera.state));
    }
    // What came over a camera is told once, and stays among the errors when it is over.
    if camera.state != *state && camera.state == CameraState::Frozen {
        robot.report_error(&camera.trouble);
    }
    *state = camera.state;
    robot.update_camera(|before| *before = camera);
}
