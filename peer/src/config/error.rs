//! What is wrong with a configuration.

use std::path::PathBuf;

use thiserror::Error;

/// A configuration that cannot be used. Each variant names the key and how to fix it.
#[derive(Debug, Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read the configuration {}: {cause}", path.display())]
    Unreadable {
        /// Which file.
        path: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// The text is not JSON5.
    #[error("{origin}: JSON5 syntax error: {cause}")]
    Syntax {
        /// The file, or the flag.
        origin: String,
        /// Where and why.
        cause: String,
    },
    /// A `--cfg` that is not of the form `KEY:VALUE`, or whose key does not exist or leads through something that is not
    /// an object.
    #[error("--cfg '{given}': {fix}")]
    Override {
        /// What was given.
        given: String,
        /// What is expected.
        fix: String,
    },
    /// A key that does not exist, a value that it cannot have, or one that names something that cannot be used.
    #[error("{key}: {cause}")]
    Value {
        /// The path of the key, `rounds.deadline`.
        key: String,
        /// What is wrong, and what is expected.
        cause: String,
    },
}

impl ConfigError {
    pub(crate) fn value(key: &str, cause: impl ToString) -> Self {
        Self::Value { key: key.to_owned(), cause: cause.to_string() }
    }
}
