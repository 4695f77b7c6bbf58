//! What an experiment is made from, beside its file.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// Where real hands come from.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Materials {
    /// Pictures that robots see; rendered hands when there are none.
    pub dataset: Option<PathBuf>,
    /// Pictures that a model is trained on to start from; rendered hands, seen from the front, when there are none.
    pub start: Option<PathBuf>,
}
