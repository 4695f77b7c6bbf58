//! Recordings of Gestalt swarms.
//!
//! Writes what passes in a swarm as [MCAP](https://mcap.dev), which Foxglove, Rerun and PlotJuggler open; reads it again, also when it was torn
//! or damaged; draws each recorded decision again from its votes, bit for bit; and counts the same votes by other rules.
//!
//! No Zenoh, no camera: who listens hands in what it heard, with the time. Only the recorder has a thread and a file.
//!
//! ```text
//! Passing ─► Recorder (queue, thread) ─► Sink: TapeWriter ─► file ─► read ─► Run ─► prove: was it decided so?
//!                                                                        └──► WhatIf ─► Score: what would have been?
//! ```

mod count;
mod definition;
mod disk;
pub mod foxglove;
mod kind;
mod ledger;
mod line;
mod passing;
mod proof;
mod reader;
mod recorder;
mod run;
mod schema;
mod score;
mod sink;
mod view;
mod what_if;
mod words;
mod writer;

pub use definition::definition;
pub use disk::Disk;
pub use kind::Kind;
pub use ledger::{Ledger, Tally};
pub use line::Line;
pub use passing::{Entry, Passing};
pub use proof::{Difference, Proof, prove};
pub use reader::{Condition, ReadError, Recorded, read};
pub use recorder::{Intake, Recorder, Room};
pub use run::{ROUNDS, Run, SWARM, Showing, Truth, rounds_of};
pub use schema::schema;
pub use score::{PairedDifference, Score};
pub use sink::{Sink, WriteError};
pub use view::{Alive, unreadable, view, wire};
pub use what_if::{Outcome, WhatIf, outcomes};
pub use words::Words;
pub use writer::TapeWriter;
