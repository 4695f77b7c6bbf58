//! The classifier that a configuration names.

use gestalt_vision::model::{ModelError, RobotModel};

use crate::config::ModelSection;

/// Loads it; `None` for a robot without one. `progress` is told how far a training has come, as done and total.
///
/// # Errors
/// See [`ModelError`].
pub fn load(
    section: &ModelSection,
    progress: impl FnMut(usize, usize),
) -> Result<Option<RobotModel>, ModelError> {
    match section {
        ModelSection::None => Ok(None),
        ModelSection::Rendered => RobotModel::rendered(progress).map(Some),
        ModelSection::File(path) => RobotModel::read(path).map(Some),
    }
}
