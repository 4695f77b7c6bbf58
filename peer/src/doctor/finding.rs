//! What a check says.

use serde::Serialize;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// As it should be.
    Fine,
    /// It works, and may not do what is expected.
    Warning,
    /// Something that the robot or the swarm needs does not work.
    Failure,
}

/// One thing that was looked at, and how it is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// What was looked at, one word of the table in `docs/doctor.md`.
    pub check: &'static str,
    /// How bad it is.
    pub severity: Severity,
    /// What was found.
    pub what: String,
    /// Why it matters; empty for what is fine.
    pub why: String,
    /// What to do: a command, or a line of configuration; empty for what is fine.
    pub fix: String,
}

impl Finding {
    /// As it should be.
    pub fn fine(check: &'static str, what: impl Into<String>) -> Self {
        Self { check, severity: Severity::Fine, what: what.into(), why: String::new(), fix: String::new() }
    }

    /// Worth a look.
    pub fn warning(
        check: &'static str,
        what: impl Into<String>,
        why: impl Into<String>,
        fix: impl Into<String>,
    ) -> Self {
        Self { check, severity: Severity::Warning, what: what.into(), why: why.into(), fix: fix.into() }
    }

    /// To be mended.
    pub fn failure(
        check: &'static str,
        what: impl Into<String>,
        why: impl Into<String>,
        fix: impl Into<String>,
    ) -> Self {
        Self { severity: Severity::Failure, ..Self::warning(check, what, why, fix) }
    }
}
