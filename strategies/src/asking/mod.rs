//! When a swarm asks its instructor, and what.
//!
//! | file | question |
//! |---|---|
//! | `config` | how often at most, and from which doubt on? |
//! | `budget` | may it ask now? |
//! | `rule` | is it worth asking, and what? |
//!
//! Pure: what was asked, heard and answered is the mind's to keep.

mod budget;
mod config;
mod rule;

pub use budget::QuestionBudget;
pub use config::{QuestionsConfig, QuestionsConfigError};
pub(crate) use rule::is_unknown;
pub use rule::{Occasion, worth_asking};
