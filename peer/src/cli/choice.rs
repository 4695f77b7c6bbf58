//! Flags whose values are one of a few names, which `--help` and the shell's completion list.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use gestalt_protocol::FusionRule;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::config::{CameraChoice, Fuse, LearnFrom};

/// Those of `names` that mean a `T`, as a configuration file writes it.
fn one_of<T: DeserializeOwned + Clone + Send + Sync + 'static>(
    names: &'static [&'static str],
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(names).try_map(|name| serde_json::from_value::<T>(Value::String(name)))
}

/// `--rule`.
pub(super) fn rule() -> impl TypedValueParser<Value = FusionRule> {
    one_of(&["log_pool", "majority", "mean_probability", "confidence_weighted", "correlated_pool"])
}

/// `--learn`.
pub(super) fn learn() -> impl TypedValueParser<Value = LearnFrom> {
    one_of(&["nothing", "model"])
}

/// `--glove`.
#[cfg(feature = "opencv")]
pub(super) fn glove() -> impl TypedValueParser<Value = gestalt_vision::source::Glove> {
    one_of(&["cyan", "orange", "skin"])
}

/// `--fuse`.
pub(super) fn fuse() -> impl TypedValueParser<Value = Fuse> {
    one_of(&["central", "swarm"])
}

/// `--camera`.
pub(super) fn camera() -> impl TypedValueParser<Value = CameraChoice> {
    one_of(&CameraChoice::NAMES)
}
