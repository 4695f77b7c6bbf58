//! How a swarm of robots decides, together, what it was shown.
//!
//! Pure: no clock, no entropy, no socket, no file, no camera, and no learning: whoever wants a swarm's decisions embeds
//! this crate alone. Time is an argument. The entry type is [`Rounds`]: a state machine with one verb,
//! `handle(now, input) -> outputs`, which a host feeds and obeys.
//!
//! ```text
//! Observation ─► Classify ─► Evidence ─► my Vote ─► Ballot ─► fusion ─► Decision ─► Agreement ─► Hold, Announce
//!                                votes of others ──┘   decisions of others ──┘ the greatest wins
//! ```
//!
//! Who also wants to learn takes `gestalt-strategies`, whose mind [follows](Follow) these rounds.

mod agreement;
mod alike;
mod ballot;
mod called;
mod classify;
mod columns;
mod committee;
mod config;
mod correlated;
mod doubt;
mod electorate;
mod evidence;
mod fit;
mod fuse;
pub mod fusion;
mod life;
mod lot;
mod machine;
mod names;
mod observation;
mod others;
mod outcome;
mod proof;
mod quorum;
mod refusal;
mod round;
mod rows;
mod rule;
mod sign;
mod vocabulary;
mod voter;
mod withstand;

pub use ballot::{Ballot, Cast, Scale};
pub use called::Called;
pub use classify::{Classify, ClassifyError, Judgement};
pub use columns::Columns;
pub use config::{RoundsConfig, RoundsConfigError};
pub use correlated::CorrelatedPool;
pub use doubt::Doubt;
pub use evidence::{Evidence, JudgedFrame};
pub use fit::{Testimony, Weights, fit};
pub use fuse::Fuse;
pub use life::Life;
pub use lot::{Lottery, lot};
pub use machine::{Follow, Input, Output, Rounds, TAUGHT_AHEAD};
pub use observation::Observation;
pub use outcome::outcome;
pub use proof::{follows, is_refuted};
pub use quorum::Quorum;
pub use refusal::{Refusal, Refusals};
pub use sign::Sign;
pub use vocabulary::{Vocabulary, VocabularyError};
pub use voter::Voter;
