//! Whole swarms on real Zenoh, one scenario a file. Run them one after the other: they measure time.

mod center;
mod churn;
mod clients;
mod field;
mod in_process;
mod knowledge;
mod learning;
mod line;
mod memory;
mod ring;
mod scouting;
mod stream;
mod trouble;
