//! The verbs of the command line, one file each.

#[cfg(feature = "opencv")]
mod center;
mod config;
mod config_args;
mod emulate;
#[cfg(feature = "opencv")]
mod evaluate;
mod explain;
#[cfg(feature = "opencv")]
mod look;
mod open;
#[cfg(feature = "opencv")]
mod peer;
mod progress;
#[cfg(feature = "opencv")]
mod report;
mod robots;
mod show;
#[cfg(feature = "opencv")]
mod stream;
#[cfg(feature = "opencv")]
mod swarm;
mod teach;
#[cfg(feature = "opencv")]
mod train;
mod watch;

use std::io::{self, Write};
use std::time::Duration;

use clap::{Parser, Subcommand};
use gestalt_protocol::{Instruction, InstructorId};
use tracing_subscriber::EnvFilter;

use gestalt_link::{Announcement, Client, News};

/// A swarm of robots that reads hand gestures together.
#[derive(Debug, Parser)]
#[command(name = "gestalt", version, propagate_version = true)]
pub struct Command {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    #[cfg(feature = "opencv")]
    /// Run one robot
    Peer(peer::Args),
    /// Stream a robot's camera to a fusion centre
    #[cfg(feature = "opencv")]
    Stream(stream::Args),
    /// Run a fusion centre, which looks through the cameras of robots that stream
    #[cfg(feature = "opencv")]
    Center(center::Args),
    #[cfg(feature = "opencv")]
    /// Run a whole swarm on this machine, show it gestures, and keep the score
    Swarm(swarm::Args),
    /// Watch decisions and robots of a running swarm, live
    Watch(watch::Args),
    /// Tell a running swarm to look: open a round
    Open(open::Args),
    /// Teach a running swarm: open rounds, and say what the gesture was
    Teach(teach::Args),
    /// Learn a classifier from a folder of pictures
    #[cfg(feature = "opencv")]
    Train(train::Args),
    /// Measure a classifier on a folder of pictures
    #[cfg(feature = "opencv")]
    Evaluate(evaluate::Args),
    /// Show what perception makes of one frame, stage by stage
    #[cfg(feature = "opencv")]
    Look(look::Args),
    /// Run a scenario in the emulated network, over several seeds, under each fusion rule that it compares
    Emulate(emulate::Args),
    /// Draw what each rule of selection or forgetting picks
    Explain(explain::Args),
    /// Check a robot's configuration
    Config(config::Args),
}

/// How long robots may take to answer a client's question.
const ANSWER: Duration = Duration::from_secs(2);

/// Why a verb failed, in one line: cause and mend.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;

impl Command {
    /// Carries out the verb.
    ///
    /// # Errors
    /// Whatever stopped the verb, as a sentence for people.
    pub fn run(self) -> Result<(), Failure> {
        match self.verb {
            #[cfg(feature = "opencv")]
            Verb::Peer(args) => peer::run(&args),
            #[cfg(feature = "opencv")]
            Verb::Stream(args) => stream::run(&args),
            #[cfg(feature = "opencv")]
            Verb::Center(args) => center::run(&args),
            #[cfg(feature = "opencv")]
            Verb::Swarm(args) => swarm::run(&args),
            Verb::Watch(args) => watch::run(&args),
            Verb::Open(args) => open::run(&args),
            Verb::Teach(args) => teach::run(&args),
            #[cfg(feature = "opencv")]
            Verb::Train(args) => train::run(args),
            #[cfg(feature = "opencv")]
            Verb::Evaluate(args) => evaluate::run(args),
            #[cfg(feature = "opencv")]
            Verb::Look(args) => look::run(&args),
            Verb::Emulate(args) => emulate::run(&args),
            Verb::Explain(args) => explain::run(&args),
            Verb::Config(args) => config::run(&args),
        }
    }
}

/// Sends log lines to stderr; `RUST_LOG` chooses which. When it is silent: our own warnings, and Zenoh's errors; what
/// else concerns the user is said in Gestalt's own words.
pub fn start_log() {
    let filter =
        EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("error,gestalt_peer=warn"));
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
}

/// Zenoh needs a runtime with several threads.
fn runtime() -> Result<tokio::runtime::Runtime, Failure> {
    Ok(tokio::runtime::Builder::new_multi_thread().enable_all().build()?)
}

/// Has a round opened in the name of an instructor, and waits for the decision of one after `before`; `None` when there
/// is none within `patience`.
async fn open_round(
    client: &Client,
    news: &mut News,
    instructor: &InstructorId,
    before: Option<u32>,
    patience: Duration,
) -> Result<Option<Announcement>, Failure> {
    client.instruct(instructor, &Instruction::Open).await?;
    match tokio::time::timeout(patience, news.decision_after(before)).await {
        Ok(Some(decided)) => Ok(Some(decided)),
        Ok(None) => Err("the session has ended".into()),
        Err(_) => Ok(None),
    }
}

/// Ctrl-C; where signals cannot be had, never.
async fn interrupted() {
    if let Err(error) = tokio::signal::ctrl_c().await {
        tracing::warn!("cannot listen for Ctrl-C: {error}");
        std::future::pending::<()>().await;
    }
}

/// Writes a report to stdout, and sends it off at once: whoever reads may be a program that waits for it. A reader
/// that has seen enough (`| head`) is no failure.
fn say(report: &str) -> Result<(), Failure> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(report.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}

/// Reads `500ms`, `2s`, `1m 30s`.
fn duration(text: &str) -> Result<Duration, String> {
    match text.parse::<humantime_serde::re::humantime::Duration>() {
        Ok(duration) if !duration.is_zero() => Ok(duration.into()),
        Ok(_) => Err("must be longer than 0".to_owned()),
        Err(error) => Err(format!("{error}; write a number with a unit, like 500ms or 2s")),
    }
}
