//! A sample of a training set, as Python sees it.

use gestalt_strategies::{HeldSample, SetPart};
use pyo3::prelude::*;

/// A sample as held: it does not change.
#[pyclass(frozen, module = "gestalt_swarm._native")]
pub(crate) struct Sample {
    /// Local arrival number, from 1.
    #[pyo3(get)]
    key: u64,
    part: SetPart,
    /// Its name in the swarm: author, life and number; none while it is personal.
    #[pyo3(get)]
    id: Option<(u32, u32, u32)>,
    /// The gesture shown, as an index.
    #[pyo3(get)]
    class_: u32,
    /// The round it was seen in.
    #[pyo3(get)]
    round: String,
    /// Coordinates in the feature space.
    #[pyo3(get)]
    vector: Vec<f32>,
}

impl From<&HeldSample> for Sample {
    fn from(held: &HeldSample) -> Self {
        Self {
            key: held.key,
            part: held.part,
            id: held.id.map(|id| (id.author.0, id.life, id.number)),
            class_: held.class.0,
            round: held.round.to_string(),
            vector: held.vector.to_vec(),
        }
    }
}

#[pymethods]
impl Sample {
    /// Where it is: `personal`, `shared` or `external`.
    #[getter]
    fn part(&self) -> &'static str {
        match self.part {
            SetPart::Personal => "personal",
            SetPart::Shared => "shared",
            SetPart::External => "external",
        }
    }

    fn __repr__(&self) -> String {
        format!(
            "Sample(key={}, part='{}', class_={}, round='{}')",
            self.key,
            self.part(),
            self.class_,
            self.round
        )
    }
}
