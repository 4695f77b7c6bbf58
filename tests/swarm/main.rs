//! Whole swarms on real Zenoh, one scenario a file. Run them one after the other: they measure time.

mod cameras;
mod center;
mod churn;
mod clients;
mod eyes;
mod field;
mod in_process;
mod knowledge;
mod learning;
mod line;
mod memory;
mod mixed;
mod motion;
mod ring;
mod scouting;
mod stream;
mod trouble;
