//! What Python imports.

use gestalt_strategies::{ForgettingRule, SelectionRule};
use pyo3::prelude::*;

use crate::{ballot, errors, learner, mind, model, sample, training_set, wire};

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    errors::add(module)?;
    module.add_class::<model::Model>()?;
    module.add_class::<learner::Learner>()?;
    module.add_class::<sample::Sample>()?;
    module.add_class::<training_set::TrainingSet>()?;
    module.add_class::<ballot::Ballot>()?;
    module.add_class::<mind::Mind>()?;
    module.add_function(wrap_pyfunction!(ballot::fuse, module)?)?;
    module.add_function(wrap_pyfunction!(wire::decode_envelope, module)?)?;
    module.add_function(wrap_pyfunction!(wire::encode_envelope, module)?)?;
    module.add_function(wrap_pyfunction!(wire::decode_frame_header, module)?)?;
    module.add_function(wrap_pyfunction!(wire::encode_frame_header, module)?)?;
    module.add_function(wrap_pyfunction!(wire::decode_frame_taken, module)?)?;
    module.add_function(wrap_pyfunction!(wire::encode_frame_taken, module)?)?;
    module.add("SELECTION_RULES", SelectionRule::ALL.map(SelectionRule::name).to_vec())?;
    module.add("FORGETTING_RULES", ForgettingRule::ALL.map(ForgettingRule::name).to_vec())?;
    module.add(
        "FUSION_RULES",
        gestalt_protocol::FusionRule::ALL.iter().map(|rule| rule.name()).collect::<Vec<_>>(),
    )?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))
}
