//! Frames on Zenoh: sent by a client without a computer to speak of, received at a robot's session.

use std::borrow::Cow;
use std::sync::Arc;
use std::time::Instant;

use gestalt_protocol::{
    DecodeError, FrameHeader, FrameTaken, ImageEncoding, Keys, MAX_FRAME, RobotId, RoundId, Topic,
};
use zenoh::bytes::{Encoding, ZBytes};
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::{CongestionControl, Priority};
use zenoh::sample::{Locality, Sample, SampleKind};
use zenoh::{Session, Wait};

use super::account::{Account, Refusal};
use super::{Client, LinkError, Robot};

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
#[derive(Debug)]
pub struct FrameGate {
    _frames: Subscriber<()>,
    session: Session,
    keys: Keys,
    account: Arc<Account>,
}

impl Robot {
    /// Hears the frames of that robot, or of every robot, from now on. `on_frame` is called on Zenoh's threads, which must
    /// not wait. What is no frame is counted in the status, and goes no further.
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
        let (keys, account) = (self.keys.clone(), self.account.clone());
        let frames = self
            .session
            .declare_subscriber(key)
            .allowed_origin(Locality::Remote)
            .callback(move |sample| match read(&keys, &sample) {
                Ok(arrival) => {
                    account.received("frame", sample.payload().len());
                    on_frame(arrival);
                }
                Err(cause) => {
                    account.refused("frame", sample.key_expr(), sample.payload().len(), &cause);
                }
            })
            .await
            .map_err(|error| LinkError::open(&*error))?;
        Ok(FrameGate {
            _frames: frames,
            session: self.session.clone(),
            keys: self.keys.clone(),
            account: self.account.clone(),
        })
    }
}

impl FrameGate {
    /// The round that the robot takes part in now at whose session the frames come in.
    #[must_use]
    pub fn round(&self) -> Option<RoundId> {
        let status = self.account.lock();
        status.round.filter(|_| status.open)
    }

    /// Says to a robot's camera that a frame was taken, so that the next one may come.
    pub fn taken(&self, robot: RobotId, taken: &FrameTaken) {
        let bytes = taken.encode();
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
}

fn read(keys: &Keys, sample: &Sample) -> Result<FrameArrival, Refusal> {
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
    let header = FrameHeader::decode(&header.to_bytes())?;
    Ok(FrameArrival { robot, header, at: Instant::now(), picture: sample.payload().clone() })
}

/// Sends the frames of one robot.
#[derive(Debug)]
pub struct FrameSender {
    publisher: Publisher<'static>,
    _taken: Subscriber<()>,
}

impl Client {
    /// Sends frames in the name of that robot from now on. `on_taken` is told of every acknowledgement, and of what arrives
    /// in place of one, on Zenoh's threads.
    ///
    /// # Errors
    /// [`LinkError::Open`] when the session is closed.
    pub async fn stream(
        &self,
        robot: RobotId,
        on_taken: impl Fn(Result<FrameTaken, DecodeError>) + Send + Sync + 'static,
    ) -> Result<FrameSender, LinkError> {
        let declared = async {
            let taken = self
                .session
                .declare_subscriber(self.keys.key(&Topic::Taken(robot)))
                .callback(move |sample| on_taken(FrameTaken::decode(&sample.payload().to_bytes())))
                .await?;
            let publisher = self
                .session
                .declare_publisher(self.keys.key(&Topic::Frame(robot)))
                .encoding(Encoding::IMAGE_JPEG)
                .priority(Priority::Data)
                .congestion_control(CongestionControl::Drop)
                .express(true)
                .await?;
            zenoh::Result::Ok(FrameSender { publisher, _taken: taken })
        };
        declared.await.map_err(|error| LinkError::open(&*error))
    }

    /// Whether it is attached to a robot now.
    pub async fn is_attached(&self) -> bool {
        // Also to one in a cell, which is a client itself.
        self.session.info().transports().await.next().is_some()
    }
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
        let put = self.publisher.put(picture).encoding(encoding).attachment(header.encode());
        put.await.map_err(|error| LinkError::open(&*error))
    }
}
