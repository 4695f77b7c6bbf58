//! How far an experiment has come.

/// How far an experiment has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// So many hands were looked at, of so many.
    Looked(usize, usize),
    /// So many runs have ended, of so many.
    Ran(usize, usize),
}
