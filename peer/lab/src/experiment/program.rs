//! Which program measures, so that results of two are never mixed.

use std::fmt;

use serde::{Deserialize, Serialize};

/// What a program does, in figures that change when it does otherwise, whatever its version number says.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Program {
    /// The version it calls itself.
    pub version: String,
    /// Checksum of the features that perception measures on a few rendered hands.
    pub eyes: u32,
    /// Checksum of the trace of a small swarm that learns.
    pub minds: u32,
}

impl fmt::Display for Program {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "version {} (eyes {:08x}, minds {:08x})", self.version, self.eyes, self.minds)
    }
}
