//! Exceptions. What is refused is a `ValueError`, as the scientific Python world expects of a wrong argument.

use std::fmt::Display;

use gestalt_mind::MindError;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

pyo3::create_exception!(
    gestalt_swarm,
    GestaltError,
    PyValueError,
    "What Gestalt refuses; its message names the cause and the fix."
);
pyo3::create_exception!(
    gestalt_swarm,
    SettingsError,
    GestaltError,
    "A parameter out of its range, or a name that is none."
);
pyo3::create_exception!(
    gestalt_swarm,
    DataError,
    GestaltError,
    "Numbers of the wrong shape, or that are not finite."
);
pyo3::create_exception!(
    gestalt_swarm,
    DecodeError,
    GestaltError,
    "Bytes, or a dictionary, that are no message."
);
pyo3::create_exception!(gestalt_swarm, ModelError, GestaltError, "A model that cannot be read or used.");

pub(crate) fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("GestaltError", py.get_type::<GestaltError>())?;
    module.add("SettingsError", py.get_type::<SettingsError>())?;
    module.add("DataError", py.get_type::<DataError>())?;
    module.add("DecodeError", py.get_type::<DecodeError>())?;
    module.add("ModelError", py.get_type::<ModelError>())
}

pub(crate) fn settings(error: impl Display) -> PyErr {
    SettingsError::new_err(error.to_string())
}

pub(crate) fn data(error: impl Display) -> PyErr {
    DataError::new_err(error.to_string())
}

pub(crate) fn decode(error: impl Display) -> PyErr {
    DecodeError::new_err(error.to_string())
}

pub(crate) fn model(error: impl Display) -> PyErr {
    ModelError::new_err(error.to_string())
}

/// Of what an earlier call may have left half done.
pub(crate) fn broken(what: &str) -> PyErr {
    PyRuntimeError::new_err(format!(
        "an earlier call panicked and may have left this {what} half changed: start another, and report the panic"
    ))
}

pub(crate) fn of_mind(error: MindError) -> PyErr {
    match &error {
        MindError::Message { .. } | MindError::Key(_) | MindError::Mismatch(_) => decode(error),
        MindError::Model(_) | MindError::Vocabulary | MindError::TooLate | MindError::Learner(_) => {
            model(error)
        }
        MindError::Features(_)
        | MindError::Probabilities(_)
        | MindError::Sightless
        | MindError::Quality(_) => data(error),
        _ => settings(error),
    }
}
