//! The verbs of the command line, one file each.

mod config;
mod config_args;
mod open;
#[cfg(feature = "opencv")]
mod peer;
mod show;
#[cfg(feature = "opencv")]
mod swarm;
mod watch;

use std::time::Duration;

use clap::{Parser, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};
use tracing_subscriber::EnvFilter;

/// A swarm of robots that reads hand gestures together.
#[derive(Debug, Parser)]
#[command(name = "gestalt", version, about, propagate_version = true)]
pub struct Command {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    #[cfg(feature = "opencv")]
    /// Run one robot
    Peer(peer::Args),
    #[cfg(feature = "opencv")]
    /// Run a whole swarm on this machine, show it gestures, and keep the score
    Swarm(swarm::Args),
    /// Watch decisions and robots of a running swarm, live
    Watch(watch::Args),
    /// Tell a running swarm to look: open a round
    Open(open::Args),
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
            Verb::Swarm(args) => swarm::run(&args),
            Verb::Watch(args) => watch::run(&args),
            Verb::Open(args) => open::run(&args),
            Verb::Config(args) => config::run(&args),
        }
    }
}

/// Sends log lines to stderr; `RUST_LOG` chooses which, warnings when it is silent.
pub fn start_log() {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("warn"));
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
}

/// Zenoh needs a runtime with several threads.
fn runtime() -> Result<tokio::runtime::Runtime, Failure> {
    Ok(tokio::runtime::Builder::new_multi_thread().enable_all().build()?)
}

/// Ctrl-C; where signals cannot be had, never.
async fn interrupted() {
    if let Err(error) = tokio::signal::ctrl_c().await {
        tracing::warn!("cannot listen for Ctrl-C: {error}");
        std::future::pending::<()>().await;
    }
}

/// A progress bar on stderr, hidden where stderr is no terminal.
fn bar(what: &'static str) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {eta}")
        .expect("the template is a constant that every start of a bar has proven");
    ProgressBar::new(0).with_style(style).with_message(what)
}

/// Reads `500ms`, `2s`, `1m 30s`.
fn duration(text: &str) -> Result<Duration, String> {
    match text.parse::<humantime_serde::re::humantime::Duration>() {
        Ok(duration) if !duration.is_zero() => Ok(duration.into()),
        Ok(_) => Err("must be longer than 0".to_owned()),
        Err(error) => Err(format!("{error}; write a number with a unit, like 500ms or 2s")),
    }
}
