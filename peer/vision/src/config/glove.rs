//! What a synthetic hand wears.

use std::str::FromStr;

use serde::{Deserialize, Serialize};
use thiserror::Error;

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

/// A glove that nobody can draw.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("'{0}' is no glove: cyan, orange, or skin for a bare hand")]
pub struct NoSuchGlove(String);

impl FromStr for Glove {
    type Err = NoSuchGlove;

    fn from_str(text: &str) -> Result<Self, NoSuchGlove> {
        match text {
            "cyan" => Ok(Self::Cyan),
            "orange" => Ok(Self::Orange),
            "skin" => Ok(Self::Skin),
            _ => Err(NoSuchGlove(text.to_owned())),
        }
    }
}
