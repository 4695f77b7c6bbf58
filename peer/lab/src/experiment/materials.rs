//! What an experiment is made from, beside its file.

use std::path::PathBuf;

use gestalt_vision::dataset::each_once;
use serde::{Deserialize, Serialize};

use super::error::ExperimentError;

/// Where real hands come from.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Materials {
    /// Pictures that robots see; rendered hands when there are none.
    pub dataset: Option<PathBuf>,
    /// Pictures that a model is trained on to start from; rendered hands, seen from the front, when there are none.
    pub start: Option<PathBuf>,
}

impl Materials {
    /// That what robots see was not taught to the model that they start from.
    ///
    /// # Errors
    /// [`ExperimentError::Dataset`] where both are one folder, or one is not there.
    pub fn check(&self) -> Result<(), ExperimentError> {
        let folders: Vec<PathBuf> = [&self.dataset, &self.start].into_iter().flatten().cloned().collect();
        Ok(each_once(&folders)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_is_judged_on_what_it_starts_from() {
        let folder = tempfile::tempdir().unwrap();
        let (one, other) = (folder.path().join("one"), folder.path().join("other"));
        std::fs::create_dir(&one).unwrap();
        std::fs::create_dir(&other).unwrap();
        let of = |dataset: Option<PathBuf>, start: Option<PathBuf>| Materials { dataset, start }.check();
        assert!(of(Some(one.clone()), Some(one.join("../one"))).is_err());
        assert!(of(Some(one.clone()), Some(other)).is_ok());
        assert!(of(Some(one.clone()), None).is_ok() && of(None, Some(one)).is_ok() && of(None, None).is_ok());
    }
}
