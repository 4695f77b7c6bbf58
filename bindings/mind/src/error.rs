//! What a mind cannot do, and why.

use gestalt_protocol::{DecodeError, RobotId, SwarmNameError};
use gestalt_strategies::{ClassifyError, LearnError, LearningError, MindConfigError};
use thiserror::Error;

use crate::model_file::ModelFileError;

/// What a mind cannot do. It is unchanged by what it refuses, but by training, which leaves out what cannot be trained on.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum MindError {
    /// Settings that are none.
    #[error("settings: {0}")]
    Settings(String),
    /// A swarm's name that could not stand in a key.
    #[error("settings: swarm: {0}")]
    Swarm(#[from] SwarmNameError),
    /// Parameters of the rounds that no robot can work with.
    #[error("settings: rounds: {0}")]
    Rounds(#[from] MindConfigError),
    /// Parameters of the learning that no robot can work with.
    #[error("settings: learning: {0}")]
    Learning(#[from] LearningError),
    /// A model that is none.
    #[error(transparent)]
    Model(#[from] ModelFileError),
    /// A model of other gestures than the settings name.
    #[error("the model's gestures are not those of the vocabulary in the settings: leave the vocabulary out")]
    Vocabulary,
    /// A learning mind was given a model after its start.
    #[error("a mind that learns takes its model before all else: load it first, or start anew with it")]
    TooLate,
    /// Nothing can be learned with that model.
    #[error("nothing can be learned from that: {0}")]
    Learner(#[from] LearnError),
    /// Nothing was said of what the observed numbers mean.
    #[error("the mind cannot judge what it sees: name a vocabulary in the settings, or load a model")]
    Sightless,
    /// Settings name learning, and there is no model.
    #[error(
        "the mind is to learn and has no model, in whose feature space it could: load one, or leave learning out"
    )]
    Spaceless,
    /// Features that the model does not take.
    #[error(transparent)]
    Features(#[from] ClassifyError),
    /// Numbers that are no distribution over the vocabulary.
    #[error("these are no probabilities: {0}")]
    Probabilities(String),
    /// A quality that is none.
    #[error("quality is {0}: choose from 0 to 1")]
    Quality(f32),
    /// Bytes that are no message.
    #[error("refused under '{key}': {cause}")]
    Message {
        /// The key it came under, shortened; empty for an envelope that came alone.
        key: String,
        /// Why.
        cause: DecodeError,
    },
    /// A key that no message comes under.
    #[error("no message of this swarm for this robot comes under '{0}'")]
    Key(String),
    /// A message of one robot under the key of another, or of another kind than the key says.
    #[error("under '{0}' came another robot's message, or another kind of message")]
    Mismatch(String),
    /// An instructor's name, or the text of a robot's number, that is none.
    #[error("'{0}' is no instructor name: 1 to 32 of the characters A-Z a-z 0-9 _ -")]
    Instructor(String),
    /// More robots than a swarm has.
    #[error("{found} robots, a swarm has at most {most}")]
    TooMany {
        /// How many were named.
        found: usize,
        /// How many may be.
        most: usize,
    },
    /// A number that means all robots at the border to C.
    #[error("no robot has the number {0}: take another")]
    Nobody(RobotId),
    /// The robot itself among others.
    #[error("robot {0} is this robot itself: name its neighbours")]
    Itself(RobotId),
}
