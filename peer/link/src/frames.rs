//! Frames on Zenoh: sent by a client without a computer to speak of, received at a robot's session.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use gestalt_protocol::{
    DecodeError, FrameChallenge, FrameHeader, FrameProof, FrameTaken, ImageEncoding, Keys, MAX_FRAME,
    MAX_ROBOTS, RobotId, RoundId, Topic,
};
use gestalt_trust::{Distrust, Ed25519, FrameClaim, FrameGuard, FrameSigner, Scheme};
use thiserror::Error;
use zenoh::bytes::{Encoding, ZBytes};
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::{CongestionControl, Priority};
use zenoh::sample::{Locality, Sample, SampleKind};
use zenoh::{Session, Wait};

use super::account::{Account, Refusal};
use super::identity::fresh_nonce;
use super::inbox::Inbox;
use super::senders::Senders;
use super::{Client, LinkError, Robot};

/// Whose frames answered no challenge is told the present one at once, but no more often than so: whoever makes frames up gets no more for it.
const TOLD_EVERY: Duration = Duration::from_millis(100);

/// A frame as it arrived; the picture is not looked into yet.
#[derive(Debug)]
pub struct FrameArrival {
    /// Whose camera took it.
    pub robot: RobotId,
    /// What belongs to it.
    pub header: FrameHeader,
    /// When it arrived.
    pub at: Instant,
    picture: ZBytes,
}

impl FrameArrival {
    /// The encoded picture, at most [`MAX_FRAME`] bytes.
    #[must_use]
    pub fn picture(&self) -> Cow<'_, [u8]> {
        self.picture.to_bytes()
    }
}

/// Where frames come in, as long as it is kept; and where it is said that they were taken.
pub struct FrameGate {
    _frames: Subscriber<()>,
    desk: Arc<Desk>,
}

/// What a gate goes by.
struct Desk {
    session: Session,
    keys: Keys,
    inbox: Arc<Inbox>,
    account: Arc<Account>,
    cameras: Mutex<Cameras>,
}

/// Of a sealed swarm's cameras: which frames are new, what they were asked, and when one that did not know it was told.
#[derive(Default)]
struct Cameras {
    guard: FrameGuard,
    asked: BTreeMap<RobotId, FrameChallenge>,
    told: BTreeMap<RobotId, Instant>,
    senders: BTreeMap<RobotId, Senders>,
}

impl Cameras {
    /// Takes in a frame whose signature was checked. One that goes on beside a camera that was started later uses up nothing that the other
    /// is asked.
    fn admit(
        &mut self,
        now: Duration,
        key: &<Ed25519 as Scheme>::Key,
        frame: &FrameClaim,
        at: Instant,
    ) -> Result<(), Refusal> {
        let senders = self.senders.get_mut(&frame.robot);
        if senders.is_some_and(|senders| senders.refuses(frame.header.nonce, at)) {
            return Err(Refusal::TwoSenders);
        }
        Ok(self.guard.admit(now, key, frame, fresh_nonce())?)
    }

    /// Whether nothing that was started later streams as that robot.
    fn hears(&mut self, frame: &FrameArrival) -> bool {
        let has_room = self.senders.len() < MAX_ROBOTS || self.senders.contains_key(&frame.robot);
        !has_room || self.senders.entry(frame.robot).or_default().hears(frame.header.nonce, frame.at)
    }
}

impl Robot {
    /// Hears the frames of that robot, or of every robot, from now on. `on_frame` is called on Zenoh's threads, which must
    /// not wait. What is no frame is counted in the status, and goes no further; nor does, in a sealed swarm, what its robot did not sign
    /// in answer to this one.
    ///
    /// # Errors
    /// [`LinkError::Open`] when the session is closed.
    pub async fn receive_frames(
        &self,
        of: Option<RobotId>,
        on_frame: impl Fn(FrameArrival) + Send + Sync + 'static,
    ) -> Result<FrameGate, LinkError> {
        let key = match of {
            Some(robot) => self.keys.key(&Topic::Frame(robot)),
            None => self.keys.every_robot("frame"),
        };
        let desk = Arc::new(Desk {
            session: self.session.clone(),
            keys: self.keys.clone(),
            inbox: self.inbox.clone(),
            account: self.account.clone(),
            cameras: Mutex::default(),
        });
        let at_desk = desk.clone();
        let frames = self
            .session
            .declare_subscriber(key)
            .allowed_origin(Locality::Remote)
            .callback(move |sample| match at_desk.admit(&sample) {
                Ok(arrival) => {
                    at_desk.account.received("frame", sample.payload().len());
                    on_frame(arrival);
                }
                Err(cause) => {
                    let (key, length) = (sample.key_expr(), sample.payload().len());
                    at_desk.account.refused("frame", key, length, &cause);
                }
            })
            .await
            .map_err(|error| LinkError::open(&*error))?;
        Ok(FrameGate { _frames: frames, desk })
    }
}

impl fmt::Debug for FrameGate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FrameGate").field("keys", &self.desk.keys).finish_non_exhaustive()
    }
}

impl FrameGate {
    /// The round that the robot takes part in now at whose session the frames come in.
    #[must_use]
    pub fn round(&self) -> Option<RoundId> {
        self.desk.round()
    }

    /// Says to a robot's camera that a frame was taken, so that the next one may come.
    pub fn taken(&self, robot: RobotId, taken: &FrameTaken) {
        self.desk.taken(robot, taken);
    }
}

impl Desk {
    fn round(&self) -> Option<RoundId> {
        let status = self.account.lock();
        status.round.filter(|_| status.open)
    }

    fn taken(&self, robot: RobotId, taken: &FrameTaken) {
        let bytes = match self.challenge(robot) {
            Some(challenge) => taken.encode_challenging(&challenge),
            None => taken.encode(),
        };
        self.account.sent("taken", bytes.len());
        let put = self
            .session
            .put(self.keys.key(&Topic::Taken(robot)), bytes)
            .priority(Priority::DataHigh)
            .congestion_control(CongestionControl::Drop)
            .express(true)
            .wait();
        self.account.check(put);
    }

    fn cameras(&self) -> MutexGuard<'_, Cameras> {
        self.cameras.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now(&self) -> Duration {
        self.account.started().elapsed()
    }

    /// What that robot's camera is asked to answer; `None` in an open swarm, and for those whom nobody believes.
    fn challenge(&self, robot: RobotId) -> Option<FrameChallenge> {
        let key = self.inbox.judged(|judge, _| judge.key(robot).copied())?.ok()?;
        let mut cameras = self.cameras();
        let number = cameras.guard.challenge(self.now(), robot, &key, fresh_nonce());
        if let Some(asked) = cameras.asked.get(&robot).filter(|asked| asked.challenge == number) {
            return Some(*asked);
        }
        let asked = self.inbox.sign_challenge(robot, number)?;
        cameras.asked.insert(robot, asked);
        Some(asked)
    }

    /// The frame, if it is to be looked at.
    fn admit(&self, sample: &Sample) -> Result<FrameArrival, Refusal> {
        let arrival = self.believed(sample)?;
        if self.cameras().hears(&arrival) { Ok(arrival) } else { Err(Refusal::TwoSenders) }
    }

    /// The frame, if it is one, and its robot's.
    fn believed(&self, sample: &Sample) -> Result<FrameArrival, Refusal> {
        let (arrival, proof) = read(&self.keys, sample)?;
        let trusted = self
            .inbox
            .judged(|judge, _| judge.key(arrival.robot).map(|key| (*key, judge.roster().swarm_id())));
        let Some(trusted) = trusted else { return Ok(arrival) };
        let (key, swarm) = trusted?;
        let picture = arrival.picture();
        let proof = proof.as_ref().ok_or(Distrust::Unsigned)?;
        let frame = FrameClaim { robot: arrival.robot, header: &arrival.header, proof, picture: &picture };
        let weighed = self.cameras().guard.weigh(self.now(), &key, &frame, fresh_nonce());
        if weighed == Err(Distrust::Unasked) {
            self.ask(arrival.robot, &arrival.header);
            if proof.challenges.is_empty() {
                return Err(Refusal::First);
            }
        }
        weighed?;
        // Not while others wait.
        if !frame.is_signed::<Ed25519>(&key, &swarm) {
            return Err(Distrust::Forged.into());
        }
        self.cameras().admit(self.now(), &key, &frame, arrival.at)?;
        drop(picture);
        Ok(arrival)
    }

    /// Tells a camera what it is asked, so that its next frame answers it.
    fn ask(&self, robot: RobotId, of: &FrameHeader) {
        let now = Instant::now();
        let mut cameras = self.cameras();
        if cameras.told.get(&robot).is_some_and(|told| now.duration_since(*told) < TOLD_EVERY) {
            return;
        }
        cameras.told.insert(robot, now);
        drop(cameras);
        self.taken(robot, &FrameTaken { nonce: of.nonce, sequence: of.sequence, round: self.round() });
    }
}

fn read(keys: &Keys, sample: &Sample) -> Result<(FrameArrival, Option<FrameProof>), Refusal> {
    if sample.kind() != SampleKind::Put {
        return Err(Refusal::Kind);
    }
    let Some(Topic::Frame(robot)) = keys.parse(sample.key_expr()) else { return Err(Refusal::Key) };
    let length = sample.payload().len();
    if length > MAX_FRAME {
        return Err(DecodeError::TooLong { length, limit: MAX_FRAME }.into());
    }
    if length == 0 {
        return Err(DecodeError::Empty.into());
    }
    let header = sample.attachment().ok_or(DecodeError::Empty)?;
    let (header, proof) = FrameHeader::decode_proven(&header.to_bytes())?;
    Ok((FrameArrival { robot, header, at: Instant::now(), picture: sample.payload().clone() }, proof))
}

/// What came in place of an acknowledgement.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TakenError {
    /// No acknowledgement.
    #[error("malformed acknowledgement: {0}")]
    Bytes(#[from] DecodeError),
    /// One that asks what must not be answered.
    #[error("robot {by} asks for this camera's frames, and is not answered: {cause}")]
    Challenge {
        /// Who asks, by its own words.
        by: RobotId,
        /// Why it is not believed.
        cause: Distrust,
    },
}

/// Sends the frames of one robot.
#[derive(Debug)]
pub struct FrameSender {
    publisher: Publisher<'static>,
    signer: Option<Arc<Mutex<FrameSigner>>>,
    _taken: Subscriber<()>,
}

impl Client {
    /// Sends frames in the name of that robot from now on, signed in a sealed swarm, where nobody looks at others. `on_taken` is told of every
    /// acknowledgement, and of what arrives in place of one, on Zenoh's threads.
    ///
    /// # Errors
    /// [`LinkError::Open`] when the session is closed.
    pub async fn stream(
        &self,
        robot: RobotId,
        signer: Option<FrameSigner>,
        on_taken: impl Fn(Result<FrameTaken, TakenError>) + Send + Sync + 'static,
    ) -> Result<FrameSender, LinkError> {
        let signer = signer.map(|signer| Arc::new(Mutex::new(signer)));
        let (of_taken, began) = (signer.clone(), Instant::now());
        let declared = async {
            let taken = self
                .session
                .declare_subscriber(self.keys.key(&Topic::Taken(robot)))
                .callback(move |sample| on_taken(heed(of_taken.as_deref(), began.elapsed(), &sample)))
                .await?;
            let publisher = self
                .session
                .declare_publisher(self.keys.key(&Topic::Frame(robot)))
                .encoding(Encoding::IMAGE_JPEG)
                .priority(Priority::Data)
                .congestion_control(CongestionControl::Drop)
                .express(true)
                .await?;
            zenoh::Result::Ok(FrameSender { publisher, signer, _taken: taken })
        };
        declared.await.map_err(|error| LinkError::open(&*error))
    }

    /// Whether it is attached to a robot now.
    pub async fn is_attached(&self) -> bool {
        // Also to one in a cell, which is a client itself.
        self.session.info().transports().await.next().is_some()
    }
}

/// The acknowledgement; what it asks is answered from now on.
fn heed(
    signer: Option<&Mutex<FrameSigner>>,
    now: Duration,
    sample: &Sample,
) -> Result<FrameTaken, TakenError> {
    let (taken, asked) = FrameTaken::decode_challenging(&sample.payload().to_bytes())?;
    if let (Some(signer), Some(asked)) = (signer, asked) {
        let heard = signer.lock().unwrap_or_else(PoisonError::into_inner).hear(now, &asked);
        heard.map_err(|cause| TakenError::Challenge { by: asked.by, cause })?;
    }
    Ok(taken)
}

impl FrameSender {
    /// Sends a picture, with what belongs to it. It gives way where the network has no room for it.
    ///
    /// # Errors
    /// [`LinkError::Open`] when the session is closed.
    pub async fn send(&self, header: &FrameHeader, picture: Vec<u8>) -> Result<(), LinkError> {
        let encoding = match header.encoding {
            ImageEncoding::Jpeg => Encoding::IMAGE_JPEG,
            ImageEncoding::Png => Encoding::IMAGE_PNG,
        };
        let attachment = match &self.signer {
            Some(signer) => {
                let signer = signer.lock().unwrap_or_else(PoisonError::into_inner);
                header.encode_proven(&signer.sign(header, &picture))
            }
            None => header.encode(),
        };
        let put = self.publisher.put(picture).encoding(encoding).attachment(attachment);
        put.await.map_err(|error| LinkError::open(&*error))
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::Signature;
    use gestalt_trust::{Identity, Membership};

    use super::*;

    const CAMERA: RobotId = RobotId(1);

    #[test]
    fn a_camera_that_goes_on_beside_a_later_one_uses_up_nothing_that_the_other_is_asked() {
        let identity = Identity::from_bytes(&[1; 32]);
        let robots = [(CAMERA, identity.public_key())].into();
        let members = Membership { swarm: "demo".to_owned(), epoch: 1, robots, ..Membership::default() };
        let roster = members.sign(&identity).unwrap();
        let key = roster.key(CAMERA).unwrap();
        let (mut cameras, at) = (Cameras::default(), Instant::now());
        let asked = |cameras: &mut Cameras| cameras.guard.challenge(Duration::ZERO, CAMERA, key, 1);
        let see = |cameras: &mut Cameras, nonce, sequence, challenge| -> Result<(), Refusal> {
            let (age_us, encoding, fps, camera) = (0, ImageEncoding::Jpeg, 30.0, "parrot".to_owned());
            let header = FrameHeader { nonce, sequence, age_us, encoding, fps, camera };
            let proof = FrameProof { challenges: vec![challenge], signature: Signature::from_bytes([0; 64]) };
            let claim = FrameClaim { robot: CAMERA, header: &header, proof: &proof, picture: &[1] };
            cameras.admit(Duration::ZERO, key, &claim, at)?;
            let arrival = FrameArrival { robot: CAMERA, header, at, picture: ZBytes::new() };
            if cameras.hears(&arrival) { Ok(()) } else { Err(Refusal::TwoSenders) }
        };
        let first = asked(&mut cameras);
        assert!(see(&mut cameras, 1, 1, first).is_ok());
        let second = asked(&mut cameras);
        assert!(see(&mut cameras, 2, 1, second).is_ok());
        // The earlier one has heard what is asked now, and the later one has not yet.
        let third = asked(&mut cameras);
        assert!(matches!(see(&mut cameras, 1, 2, third), Err(Refusal::TwoSenders)));
        assert_eq!(asked(&mut cameras), third);
        assert!(see(&mut cameras, 2, 2, second).is_ok());
    }
}
