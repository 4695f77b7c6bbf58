//! How a robot of a Gestalt swarm talks and remembers: what a controller embeds.
//!
//! [`Robot`] hosts a [`Mind`](gestalt_strategies::Mind) on Zenoh: it feeds the mind what other robots and instructors say and
//! what the controller's own eyes see, and carries out what the mind wants done. [`Client`] watches a swarm without being part
//! of it. A robot that learns keeps its memory in a file. This crate knows neither cameras nor command lines.
//!
//! ```text
//! controller ─ observations ─► Robot ─► Mind ─► votes, samples, decisions ─► Zenoh ─► other robots, clients
//!            ◄─ events ───────       ◄──────── votes, samples, decisions, words of instructors ◄──
//! ```

mod account;
mod admission;
mod apprentice;
mod attach;
mod believer;
mod boot;
mod cells;
mod census;
mod checks;
mod client;
mod closing;
mod complaints;
mod config;
mod deafness;
mod echoes;
mod effector;
mod error;
mod event;
mod failure;
mod frames;
mod given;
mod guard;
mod guest;
mod guests;
mod hearing;
mod host;
mod identity;
mod inbox;
mod inbox_alive;
mod inbox_links;
mod inbox_question;
mod inbox_sealed;
mod inbox_silence;
mod interfaces;
mod keeper;
mod lookout;
mod memory;
mod mind;
mod neighbourhood;
mod news;
mod outbox;
mod overhear;
mod panics;
mod presence;
mod reach;
mod robot;
mod roll;
mod roll_call;
mod seal;
mod senders;
mod session;
mod sightings;
mod silence;
mod silent;
mod stage;
mod subscriptions;
mod supervisor;
#[cfg(test)]
mod tests;
mod tls;
mod token;
mod trainer;
mod voice;
mod waiting;
mod wake;
mod ways;
mod word_count;
mod words;
mod worker;

pub use apprentice::RobotLearning;
pub use boot::{boot_number, counted_boot};
pub use client::{Answers, Client, Decisions};
pub use complaints::Complaints;
pub use config::{Cells, LinkConfig, Scouting};
pub use error::LinkError;
pub use event::Event;
pub use failure::{Failure, Part};
pub use frames::{FrameArrival, FrameGate, FrameSender, TakenError};
pub use guest::GuestConfig;
pub use hearing::hear;
pub use identity::fresh_nonce;
pub use memory::StoreError;
pub use news::{Heard, News, begins_anew};
pub use overhear::Overheard;
pub use robot::{Robot, RobotConfig, rounds_in_words};
pub use seal::{Seal, SealError};
pub use stage::Stage;
pub use tls::{Bearer, Certificate, CertificateError, Credentials};
