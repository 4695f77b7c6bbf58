//! The classifier that a configuration names.

use gestalt_vision::model::{ModelError, RobotModel};

use crate::config::ModelSection;

/// Loads it; `None` for a robot without one.
///
/// # Errors
/// See [`ModelError`].
pub fn load(section: &ModelSection) -> Result<Option<RobotModel>, ModelError> {
    match section {
        ModelSection::None => Ok(None),
        ModelSection::Hands => RobotModel::hands().map(Some),
        ModelSection::Rendered => RobotModel::rendered().map(Some),
        ModelSection::File(path) => RobotModel::read(path).map(Some),
    }
}
