//! What the robots of a Gestalt swarm say to each other, and where.
//!
//! Robots speak [`Message`]s in postcard inside a versioned [`Envelope`]; clients read JSON ([`Announcement`],
//! [`Question`], [`Status`], [`Answer`]) and write JSON ([`Instruction`]). [`Keys`] builds and parses the key expressions under which all
//! of it travels.
//!
//! This crate holds no behaviour: when to speak, and what to make of what is heard, is `gestalt-strategies`;
//! how bytes get from robot to robot is `gestalt-peer`.
//!
//! Decoding is total and bounded: any bytes give a value or a [`DecodeError`], never a panic, and never an
//! allocation above [`MAX_ALLOCATION`] bytes.

mod announcement;
mod bounded;
mod decision;
mod decode;
mod envelope;
mod fixed;
mod fnv;
mod frame;
mod fusion_rule;
pub mod hex;
mod holding;
mod id;
mod instruction;
mod key;
mod lesson;
mod limits;
mod message;
mod naming;
mod pool;
mod question;
mod round_outcome;
mod sample;
mod signature;
mod status;
mod terms;
mod vote;

pub use announcement::{Announced, Announcement};
pub use decision::{Certificate, CountedVote, Decision, Rank};
pub use decode::{DecodeError, decode_json};
pub use envelope::Envelope;
pub use fnv::Fnv1a;
pub use frame::{
    FrameChallenge, FrameHeader, FrameProof, FrameTaken, ImageEncoding, MAX_CHALLENGES, MAX_FRAME,
    MAX_FRAME_HEADER,
};
pub use fusion_rule::{FusionRule, RuleName, RuleNameError};
pub use holding::{Holder, Holding};
pub use id::{
    ClassId, FeatureSpaceId, IdError, InstructorId, RobotId, RoundId, SampleId, SampleSeries, Stamp,
    VocabularyId,
};
pub use instruction::{Answer, Gesture, Instruction, Outcome};
pub use key::{Keys, SwarmNameError, Topic};
pub use lesson::{Lesson, MAX_ATTACHMENT, MAX_LESSONS, MAX_WORD, SignedWord, Word};
pub use limits::{MAX_ALLOCATION, MAX_CLASSES, MAX_JSON, MAX_MESSAGE, MAX_ROBOTS, PROTOCOL_VERSION};
pub use message::{Give, Have, Message};
pub use naming::{Fate, MAX_LABEL, MAX_NAMED, MAX_TITLE, Naming, Namings};
pub use pool::Pool;
pub use question::{Ask, Asked, Question};
pub use round_outcome::{Reason, RoundOutcome};
pub use sample::{
    Batches, Digest, HeldBatch, Know, Known, Lessons, MAX_BATCH_BYTES, MAX_BATCHES, MAX_COMPONENTS,
    MAX_INTERVALS, MAX_SAMPLES, Samples, SharedSample, Vector,
};
pub use signature::Signature;
pub use status::{
    Camera, CameraState, Heeded, LearningStatus, Motion, MotionState, NamedGesture, Opinion, Reported, Status,
};
pub use terms::Terms;
pub use vote::{HeldVote, Vote};
