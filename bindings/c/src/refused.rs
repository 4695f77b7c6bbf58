//! Why a call was refused.

use gestalt_mind::MindError;

/// Why a call was refused, here or by the mind.
pub(crate) enum Refused {
    Argument(String),
    Mind(MindError),
    Io(String),
}

impl From<MindError> for Refused {
    fn from(error: MindError) -> Self {
        Self::Mind(error)
    }
}
