//! What a synthetic hand wears.

use serde::{Deserialize, Serialize};

/// What covers the hand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Glove {
    /// A saturated blue-green glove, easy to find by colour.
    #[default]
    Cyan,
    /// A saturated orange glove.
    Orange,
    /// None: skin, from fair to dark.
    Skin,
}
