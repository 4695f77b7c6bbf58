//! Frames of cameras, signed, and what tells new ones from recorded ones.
//!
//! Whoever looks at a robot's camera draws a number for it, its challenge, and sends it with every acknowledgement; the sender answers it in the
//! frames that follow. So a frame counts at those alone who asked for it, and not after they have started again.
//!
//! ```text
//! signed of a frame:     "gestalt-frame-1\0" ‖ swarm: 32 bytes ‖ robot: u32 ‖ the attachment up to the signature ‖ SHA-256 of the picture
//! signed of a challenge: "gestalt-challenge-1\0" ‖ swarm: 32 bytes ‖ who looks: u32 ‖ robot: u32 ‖ challenge: u64
//! ```
//!
//! Numbers are little-endian.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{FrameChallenge, FrameHeader, FrameProof, MAX_CHALLENGES, RobotId};
use sha2::{Digest, Sha256};

use crate::budget::{Bucket, Budget};
use crate::distrust::Distrust;
use crate::identity::Identity;
use crate::roster::Roster;
use crate::scheme::{Ed25519, Scheme};
use crate::statement::SwarmId;

/// Stands first under every signature of a frame.
pub const FRAME_DOMAIN: &[u8; 16] = b"gestalt-frame-1\0";

/// Stands first under every signature of a challenge.
pub const CHALLENGE_DOMAIN: &[u8; 20] = b"gestalt-challenge-1\0";

/// Signs a frame of that robot, in answer to those challenges, of which at most [`MAX_CHALLENGES`] are read.
#[must_use]
pub fn sign<S: Scheme>(
    identity: &Identity<S>,
    swarm: &SwarmId,
    robot: RobotId,
    header: &FrameHeader,
    challenges: Vec<u64>,
    picture: &[u8],
) -> FrameProof {
    let signature = identity.sign(&signed_bytes(swarm, robot, header, &challenges, picture));
    FrameProof { challenges, signature }
}

fn signed_bytes(
    swarm: &SwarmId,
    robot: RobotId,
    header: &FrameHeader,
    challenges: &[u64],
    picture: &[u8],
) -> Vec<u8> {
    let picture = Sha256::digest(picture);
    let robot = robot.0.to_le_bytes();
    let head = header.encode_answering(challenges);
    [FRAME_DOMAIN.as_slice(), swarm.as_bytes(), &robot, &head, &picture].concat()
}

/// Signs the challenge to the camera of that robot by one who looks at it.
#[must_use]
pub fn challenge<S: Scheme>(
    identity: &Identity<S>,
    swarm: &SwarmId,
    by: RobotId,
    robot: RobotId,
    challenge: u64,
) -> FrameChallenge {
    let signature = identity.sign(&challenge_bytes(swarm, by, robot, challenge));
    FrameChallenge { by, challenge, signature }
}

fn challenge_bytes(swarm: &SwarmId, by: RobotId, robot: RobotId, challenge: u64) -> Vec<u8> {
    let (by, robot, challenge) = (by.0.to_le_bytes(), robot.0.to_le_bytes(), challenge.to_le_bytes());
    [CHALLENGE_DOMAIN.as_slice(), swarm.as_bytes(), &by, &robot, &challenge].concat()
}

/// How many challenges a sender checks, in all names together: far more than come as long as nobody makes some up, and some hundredths of a core.
const OF_CHALLENGES: Budget = Budget::of(512, 512, 1);

/// Signs the frames of one robot's camera, in answer to those who look at it. Pure: time is an argument.
#[derive(Clone, Debug)]
pub struct FrameSigner<S: Scheme = Ed25519> {
    robot: RobotId,
    identity: Arc<Identity<S>>,
    roster: Roster<S>,
    /// Those that were asked last, one of each who looks; the longest known first.
    heard: VecDeque<FrameChallenge>,
    left: Option<Bucket>,
}

impl<S: Scheme> FrameSigner<S> {
    /// One that answers robots of that roster alone.
    #[must_use]
    pub fn new(robot: RobotId, identity: Arc<Identity<S>>, roster: Roster<S>) -> Self {
        Self { robot, identity, roster, heard: VecDeque::new(), left: None }
    }

    /// Answers that challenge from now on, in place of an earlier one of the same robot.
    ///
    /// # Errors
    /// The [`Distrust`] that it meets.
    pub fn hear(&mut self, now: Duration, asked: &FrameChallenge) -> Result<(), Distrust> {
        if self.heard.contains(asked) {
            return Ok(());
        }
        let key = self.roster.key(asked.by)?;
        if !self.left.get_or_insert_with(|| Bucket::new(&OF_CHALLENGES, now)).take(&OF_CHALLENGES, now) {
            return Err(Distrust::TooFast);
        }
        let signed = challenge_bytes(&self.roster.swarm_id(), asked.by, self.robot, asked.challenge);
        if !S::verify(key, &signed, &asked.signature) {
            return Err(Distrust::Forged);
        }
        self.heard.retain(|heard| heard.by != asked.by);
        if self.heard.len() == MAX_CHALLENGES {
            self.heard.pop_front();
        }
        self.heard.push_back(*asked);
        Ok(())
    }

    /// Signs a frame.
    #[must_use]
    pub fn sign(&self, header: &FrameHeader, picture: &[u8]) -> FrameProof {
        let challenges = self.heard.iter().map(|heard| heard.challenge).collect();
        sign(&self.identity, &self.roster.swarm_id(), self.robot, header, challenges, picture)
    }
}

/// A frame as it arrived, with what it claims of itself.
#[derive(Clone, Copy, Debug)]
pub struct FrameClaim<'a> {
    /// Whose camera took it, by the key it came under.
    pub robot: RobotId,
    /// What belongs to it.
    pub header: &'a FrameHeader,
    /// What was behind its header.
    pub proof: &'a FrameProof,
    /// The encoded picture.
    pub picture: &'a [u8],
}

impl FrameClaim<'_> {
    /// Whether it is signed with that key, in that swarm.
    #[must_use]
    pub fn is_signed<S: Scheme>(&self, key: &S::Key, swarm: &SwarmId) -> bool {
        let FrameProof { challenges, signature } = self.proof;
        S::verify(key, &signed_bytes(swarm, self.robot, self.header, challenges, self.picture), signature)
    }
}

/// How much of a picture one check of a frame reads; longer ones take several.
const UNIT: usize = 64 * 1024;

/// How much of one robot's frames is checked: 32 MiB a second, which is more than cameras send, and a tenth of a core at most.
const OF_FRAMES: Budget = Budget::of(256, 512, 1);

/// Tells which frames are new at one who looks. Pure: time is an argument, and so are numbers drawn at random.
///
/// Of each robot that is on the roster and streams some hundred bytes are kept, and nothing of anybody else.
#[derive(Debug)]
pub struct FrameGuard<S: Scheme = Ed25519> {
    cameras: BTreeMap<RobotId, Camera<S>>,
}

#[derive(Debug)]
struct Camera<S: Scheme> {
    key: S::Key,
    left: Bucket,
    /// What a sender that was not heard yet must answer.
    next: u64,
    /// The sender that is heard.
    sender: Option<Sender>,
}

#[derive(Debug)]
struct Sender {
    nonce: u64,
    /// The challenge that it answered first. It may go on to answer it until it has heard the next one.
    under: u64,
    sequence: u32,
}

impl<S: Scheme> Camera<S> {
    /// Whether that would be the next frame of this camera.
    fn is_next(&self, frame: &FrameClaim) -> Result<(), Distrust> {
        let sender = self.sender.as_ref().filter(|sender| sender.nonce == frame.header.nonce);
        let answers = |challenge| frame.proof.challenges.contains(&challenge);
        if !answers(self.next) && !sender.is_some_and(|sender| answers(sender.under)) {
            return Err(Distrust::Unasked);
        }
        match sender {
            Some(sender) if frame.header.sequence <= sender.sequence => Err(Distrust::Repeated),
            _ => Ok(()),
        }
    }
}

impl<S: Scheme> Default for FrameGuard<S> {
    fn default() -> Self {
        Self { cameras: BTreeMap::new() }
    }
}

impl<S: Scheme> FrameGuard<S> {
    /// That robot's camera, as long as it has that key; `fresh` was drawn for it.
    fn camera(&mut self, now: Duration, robot: RobotId, key: &S::Key, fresh: u64) -> &mut Camera<S> {
        let new =
            || Camera { key: key.clone(), left: Bucket::new(&OF_FRAMES, now), next: fresh, sender: None };
        let camera = self.cameras.entry(robot).or_insert_with(new);
        if camera.key != *key {
            *camera = new();
        }
        camera
    }

    /// What the next sender of that robot's frames must answer; `fresh` was drawn at random.
    pub fn challenge(&mut self, now: Duration, robot: RobotId, key: &S::Key, fresh: u64) -> u64 {
        self.camera(now, robot, key, fresh).next
    }

    /// Whether a frame, of a robot with that key, is worth the check of [its signature](FrameClaim::is_signed), which is taken from what is spared
    /// for that robot's.
    ///
    /// # Errors
    /// [`Distrust::Unasked`] for one that answers no challenge of this guard, [`Distrust::Repeated`] for one that was admitted before or is older
    /// than one that was, [`Distrust::TooFast`].
    pub fn weigh(
        &mut self,
        now: Duration,
        key: &S::Key,
        frame: &FrameClaim,
        fresh: u64,
    ) -> Result<(), Distrust> {
        let camera = self.camera(now, frame.robot, key, fresh);
        camera.is_next(frame)?;
        let units = frame.picture.len().div_ceil(UNIT).max(1);
        if (0..units).all(|_| camera.left.take(&OF_FRAMES, now)) { Ok(()) } else { Err(Distrust::TooFast) }
    }

    /// Takes in a frame whose signature was checked. The first one of a sender uses up the challenge: no other sender's answer it.
    ///
    /// # Errors
    /// As [`weigh`](Self::weigh), if another frame came meanwhile.
    pub fn admit(
        &mut self,
        now: Duration,
        key: &S::Key,
        frame: &FrameClaim,
        fresh: u64,
    ) -> Result<(), Distrust> {
        let camera = self.camera(now, frame.robot, key, fresh);
        camera.is_next(frame)?;
        let FrameHeader { nonce, sequence, .. } = *frame.header;
        match &mut camera.sender {
            Some(sender) if sender.nonce == nonce => sender.sequence = sequence,
            sender => {
                *sender = Some(Sender { nonce, under: camera.next, sequence });
                camera.next = fresh;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
