//! How a call ended.

use gestalt_mind::MindError;

/// How a call ended. What is negative is an error, of which `gestalt_last_error` says more; the mind is unchanged by it, but by training.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// It is done.
    Ok = 0,
    /// There is nothing to give: no message waits, no decision is held, nothing is to be trained.
    Nothing = 1,
    /// The caller's buffer is too small: the lengths that were asked for are given, and nothing was taken.
    TooSmall = 2,
    /// A pointer that is null and must not be, a number out of range, or text that is not UTF-8.
    Argument = -1,
    /// Settings that no mind can start with.
    Settings = -2,
    /// Bytes or JSON from outside that are no message for this robot: count it, and go on.
    Message = -3,
    /// A model that cannot be read or used.
    Model = -4,
    /// Something in Gestalt is broken, and the mind with it: free it, and report what `gestalt_last_error` says.
    Panicked = -5,
}

impl From<&MindError> for Status {
    fn from(error: &MindError) -> Self {
        match error {
            MindError::Settings(_) | MindError::Swarm(_) | MindError::Rounds(_) | MindError::Learning(_) => {
                Self::Settings
            }
            MindError::Model(_) | MindError::Vocabulary | MindError::TooLate | MindError::Learner(_) => {
                Self::Model
            }
            MindError::Message { .. } | MindError::Key(_) | MindError::Mismatch(_) => Self::Message,
            _ => Self::Argument,
        }
    }
}
