//! The thin client: it sends what its camera sees, and hears what the swarm decides.

use std::time::{Duration, Instant};

use gestalt_protocol::{Announcement, FrameHeader, FrameTaken, ImageEncoding, MAX_FRAME, RobotId};
use opencv::core::Mat;
use tokio::sync::mpsc;
use tokio::time::MissedTickBehavior;

use super::credit::Credit;
use super::feed::{Content, Feed, Shot};
use crate::camera_report::SamePicture;
use gestalt_link::{
    Client, Complaints, Decisions, FrameSender, LinkConfig, LinkError, TakenError, fresh_nonce,
};
use gestalt_trust::FrameSigner;
use gestalt_vision::human::Human;
use gestalt_vision::source::{Reader, Scene, SourceError, encode_jpeg};

/// How many acknowledgements wait to be read: one is expected, more are somebody's nonsense.
const MAX_WAITING: usize = 16;

/// Looks this often whether it is still attached.
const LOOKOUT: Duration = Duration::from_secs(1);

/// Attached to nobody for so many lookouts in a row, it opens a session anew. (Zenoh dials endpoints that were given again
/// and again by itself, but never a router that it found by scouting.)
const PATIENCE: u32 = 3;

/// Where a thin client sends its frames, and how.
#[derive(Clone, Debug)]
pub struct SenderConfig {
    /// The swarm's name.
    pub swarm: String,
    /// How it reaches a robot or a centre.
    pub link: LinkConfig,
    /// Whose frames they are.
    pub robot: RobotId,
    /// Which camera, in words: `footbot`, `parrot`, `laptop`, or any other.
    pub camera: String,
    /// JPEG quality, `1..=100`.
    pub quality: i32,
    /// What signs the frames, in a sealed swarm.
    pub signer: Option<FrameSigner>,
}

/// What happens to a thin client.
#[derive(Debug)]
pub enum StreamEvent {
    /// It is attached to a robot or a centre.
    Attached,
    /// It is attached to nobody, and tries again. The same cause is told once.
    Detached {
        /// Why, and how to fix it.
        cause: String,
    },
    /// The swarm decided.
    Decided(Box<Announcement>),
    /// A picture could not be taken or sent, is the same for too long, or something arrived that is no acknowledgement. Told at most once a second.
    Failed {
        /// Why, and how to fix it: the latest of those since the last message.
        cause: String,
        /// How many there were since the last message.
        times: u64,
    },
    /// How it goes, once a second: since the start, frames sent, acknowledged, and overwritten by newer ones unsent.
    Count {
        /// Frames sent.
        sent: u64,
        /// Frames acknowledged.
        taken: u64,
        /// Frames overwritten.
        overwritten: u64,
    },
}

/// Sends the frames of one camera.
pub struct Sender {
    config: SenderConfig,
    reader: Reader<Shot>,
    /// The zero of the pictures' time.
    zero: Instant,
    human: Human,
    /// A camera that hangs sends nothing: whoever looks is to take it for silent, not for a hand held still.
    same: SamePicture,
    failures: Complaints,
    nonce: u64,
    sent: u64,
    taken: u64,
}

/// Why a sender stops.
enum End {
    Detached,
    CameraEnded,
}

impl Sender {
    /// Starts to read the camera. One that is missing, or fails later, is opened again and again.
    ///
    /// # Errors
    /// [`LinkError::Thread`] when the machine has no room for one more.
    pub fn start(config: SenderConfig, feed: Feed) -> Result<Self, LinkError> {
        let Feed { open, human, .. } = feed;
        let zero = Instant::now();
        let reader = Reader::start(None, open, zero)?;
        reader.want(Some(Scene::default()));
        let (same, failures) = (SamePicture::default(), Complaints::default());
        Ok(Self { config, reader, zero, human, same, failures, nonce: fresh_nonce(), sent: 0, taken: 0 })
    }

    /// Sends, and tells of what happens, until the camera has come to its end. It stays through whatever becomes of the robot
    /// it is attached to.
    ///
    /// # Errors
    /// What no waiting mends: see [`LinkError`].
    pub async fn run(mut self, mut tell: impl FnMut(StreamEvent)) -> Result<(), LinkError> {
        let mut credit = Credit::new(self.nonce);
        let mut unattached = String::new();
        loop {
            let client = match Client::open(&self.config.swarm, &self.config.link).await {
                Ok(client) => client,
                Err(error @ (LinkError::Open(_) | LinkError::Unreached { .. })) => {
                    let cause = error.to_string();
                    if cause != unattached {
                        unattached.clone_from(&cause);
                        tell(StreamEvent::Detached { cause });
                    }
                    tokio::time::sleep(LOOKOUT).await;
                    continue;
                }
                Err(error) => return Err(error),
            };
            unattached.clear();
            let end = self.serve(&client, &mut credit, &mut tell).await;
            client.close().await;
            match end {
                Ok(End::CameraEnded) => return Ok(()),
                Ok(End::Detached) => {}
                Err(error) => {
                    self.failures.note(error.to_string());
                    self.tell_failures(&mut tell);
                    // The session may open again, and fail again, at once.
                    tokio::time::sleep(LOOKOUT).await;
                }
            }
        }
    }

    /// Sends over one session, as long as that is attached.
    async fn serve(
        &mut self,
        client: &Client,
        credit: &mut Credit,
        tell: &mut impl FnMut(StreamEvent),
    ) -> Result<End, LinkError> {
        let (acknowledge, mut acknowledged) = mpsc::channel(MAX_WAITING);
        let sender = client
            .stream(self.config.robot, self.config.signer.clone(), move |taken| {
                // More than were sent cannot all be meant.
                let _ = acknowledge.try_send(taken);
            })
            .await?;
        let mut decisions = client.decisions().await?;
        let mut lookout = tokio::time::interval(LOOKOUT);
        lookout.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let (mut attached, mut missed) = (false, 0);
        loop {
            let picture = async {
                if let Some(waits) = credit.waits_until() {
                    tokio::time::sleep_until(waits.into()).await;
                }
                self.reader.next().await
            };
            tokio::select! {
                shot = picture => {
                    if shot.as_ref().is_err_and(SourceError::is_the_end) {
                        return Ok(End::CameraEnded);
                    }
                    if let Err(cause) = self.send(&sender, credit, shot).await {
                        self.failures.note(cause);
                    }
                }
                Some(taken) = acknowledged.recv() => self.on_taken(taken, credit),
                decision = next(&mut decisions) => match decision {
                    Some(decision) => tell(StreamEvent::Decided(Box::new(decision))),
                    None => return Ok(End::Detached),
                },
                _ = lookout.tick() => {
                    let now = client.is_attached().await;
                    if now != attached {
                        attached = now;
                        tell(if now {
                            StreamEvent::Attached
                        } else {
                            let cause = "the robot or centre it was attached to is gone; it is tried again".to_owned();
                            StreamEvent::Detached { cause }
                        });
                    }
                    missed = if now { 0 } else { missed + 1 };
                    if missed > PATIENCE {
                        return Ok(End::Detached);
                    }
                    let (sent, taken, overwritten) = (self.sent, self.taken, self.reader.dropped());
                    tell(StreamEvent::Count { sent, taken, overwritten });
                }
            }
            self.tell_failures(tell);
        }
    }

    fn tell_failures(&mut self, tell: &mut impl FnMut(StreamEvent)) {
        if let Some((cause, times)) = self.failures.due(Instant::now()) {
            tell(StreamEvent::Failed { cause, times });
        }
    }

    fn on_taken(&mut self, taken: Result<FrameTaken, TakenError>, credit: &mut Credit) {
        match taken {
            Ok(taken) if credit.taken(&taken) => {
                self.taken += 1;
                let scene = taken.round.map_or(Scene::default(), |round| self.human.shows(round));
                self.reader.want(Some(scene));
            }
            Ok(_) => {}
            Err(error) => self.failures.note(error.to_string()),
        }
    }

    async fn send(
        &mut self,
        sender: &FrameSender,
        credit: &mut Credit,
        shot: Result<Shot, SourceError>,
    ) -> Result<(), String> {
        let Shot { content, at, period, checksum } = shot.map_err(|error| error.to_string())?;
        if let Some(checksum) = checksum {
            self.same.note(checksum, at);
            if let Some(trouble) = self.same.trouble(at, period) {
                return Err(trouble);
            }
        }
        let jpeg = match content {
            Content::Encoded(jpeg) => jpeg,
            Content::Picture(picture) => tokio::task::block_in_place(|| self.encode(&picture))?,
        };
        let age = self.zero.elapsed().saturating_sub(at);
        let header = FrameHeader {
            nonce: self.nonce,
            sequence: credit.sent(Instant::now()),
            age_us: u32::try_from(age.as_micros()).unwrap_or(u32::MAX),
            encoding: ImageEncoding::Jpeg,
            fps: 1.0 / period.as_secs_f32().max(0.001),
            camera: self.config.camera.clone(),
        };
        self.sent += 1;
        sender.send(&header, jpeg).await.map_err(|error| error.to_string())
    }

    fn encode(&self, picture: &Mat) -> Result<Vec<u8>, String> {
        let jpeg = encode_jpeg(picture, self.config.quality).map_err(|error| format!("OpenCV: {error}"))?;
        match jpeg.len() {
            length if length > MAX_FRAME => {
                Err(format!("a picture of {length} bytes, at most {MAX_FRAME} may be sent: lower --quality"))
            }
            _ => Ok(jpeg),
        }
    }
}

/// The next decision; what is none is passed over.
async fn next(decisions: &mut Decisions) -> Option<Announcement> {
    loop {
        match decisions.next().await? {
            Ok(decision) => return Some(decision),
            Err(error) => tracing::warn!("on the key of decisions: {error}"),
        }
    }
}
