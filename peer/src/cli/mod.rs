//! The verbs of the command line, one file each.

#[cfg(feature = "opencv")]
mod capture;
#[cfg(feature = "opencv")]
mod center;
#[cfg(feature = "opencv")]
mod choice;
mod config;
mod config_args;
mod doctor;
mod emulate;
#[cfg(feature = "opencv")]
mod evaluate;
mod explain;
mod foxglove;
#[cfg(feature = "opencv")]
mod look;
mod manual;
#[cfg(feature = "opencv")]
mod peer;
#[cfg(feature = "opencv")]
mod printing;
mod progress;
mod record;
mod replay;
#[cfg(feature = "opencv")]
mod report;
#[cfg(feature = "opencv")]
mod robot_args;
mod robots;
mod ros;
#[cfg(feature = "opencv")]
mod score;
mod show;
#[cfg(feature = "opencv")]
mod source_arg;
#[cfg(feature = "opencv")]
mod stream;
#[cfg(feature = "opencv")]
mod swarm;
mod teach;
#[cfg(feature = "opencv")]
mod train;
mod trust;
mod verify;
#[cfg(feature = "opencv")]
mod views;
mod vocabulary;
mod watch;
mod web;
#[cfg(not(feature = "opencv"))]
mod without_eyes;

use std::io::{self, IsTerminal, Write};
use std::pin::pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use clap::{Parser, Subcommand};
use gestalt_protocol::{Announcement, Answer, Instruction, InstructorId};
use tracing_subscriber::EnvFilter;

use gestalt_link::{Client, LinkError, News};

pub use show::clean;

#[cfg(feature = "opencv")]
const EXAMPLES: &str = "Examples:
  gestalt swarm --robots footbot:3,parrot:1 --rounds 3
  gestalt peer -c configs/footbot.json5";
#[cfg(not(feature = "opencv"))]
const EXAMPLES: &str = "This build is without OpenCV: the verbs that look at pictures are left out.

Examples:
  gestalt watch --web
  gestalt emulate configs/emulation/churn.json5";

/// A swarm of robots that reads hand gestures together.
#[derive(Debug, Parser)]
#[command(name = "gestalt", version, propagate_version = true)]
#[command(after_help = EXAMPLES)]
pub struct Command {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Run one robot
    #[cfg(feature = "opencv")]
    Peer(Box<peer::Args>),
    /// Stream a camera to a fusion centre
    #[cfg(feature = "opencv")]
    Stream(Box<stream::Args>),
    /// Run a fusion centre: classify the frames that robots stream, and vote for them
    #[cfg(feature = "opencv")]
    Center(Box<center::Args>),
    /// Run a whole swarm on this machine, show it gestures, and report its accuracy
    #[cfg(feature = "opencv")]
    Swarm(swarm::Args),
    /// Watch the decisions and robots of a running swarm, live
    Watch(watch::Args),
    /// Record a running swarm into an MCAP file
    Record(record::Args),
    /// Prove the decisions of a recording again, and count its votes by other rules
    Replay(replay::Args),
    /// Teach a running swarm: open rounds and give feedback on its decisions
    Teach(teach::Args),
    /// Show a swarm to a ROS 2 system, and take an instructor's words from it
    Ros(ros::Args),
    /// Print a ready vocabulary of gestures and their meanings, draw it, or make training pictures of it
    Vocabulary(vocabulary::Args),
    /// Take pictures of a gesture for training, each checked
    #[cfg(feature = "opencv")]
    Capture(Box<capture::Args>),
    /// Train a classifier on folders of labelled images
    #[cfg(feature = "opencv")]
    Train(Box<train::Args>),
    /// Evaluate a classifier on folders of labelled images
    #[cfg(feature = "opencv")]
    Evaluate(evaluate::Args),
    /// Show what perception makes of one frame, stage by stage
    #[cfg(feature = "opencv")]
    Look(look::Args),
    /// Write what a camera sees of drawn hands from many places, for simulators
    #[cfg(feature = "opencv")]
    Views(views::Args),
    /// Run a scenario or an experiment in an emulated network, over several seeds
    Emulate(emulate::Args),
    /// Draw which samples each selection or forgetting rule picks
    Explain(explain::Args),
    /// Enrol and expel the robots and clients of a sealed swarm
    Trust(Box<trust::Args>),
    /// Check a decision without the swarm: that a member announced it so, and every vote it rests on was signed by one
    Verify(verify::Args),
    /// Say what is wrong with a robot and its swarm, and how to mend it
    Doctor(Box<doctor::Args>),
    /// Print a commented configuration, or check one
    Config(config::Args),
    /// Print shell completions
    Completions(manual::CompletionsArgs),
    /// Write man pages to a folder
    Man(manual::ManArgs),
}

/// How long robots may take to answer a client's question.
const ANSWER: Duration = Duration::from_secs(2);

/// Why a verb failed, in one line: the cause, and how to fix it.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;

impl Command {
    /// What the command line says; where it says nothing that can be done, the program ends with the reason.
    #[must_use]
    pub fn of_this_process() -> Self {
        Self::try_parse().unwrap_or_else(|error| {
            #[cfg(not(feature = "opencv"))]
            if let Some(reason) = without_eyes::explain(&error) {
                eprintln!("gestalt: {reason}");
                std::process::exit(2);
            }
            error.exit()
        })
    }

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
            Verb::Record(args) => record::run(&args),
            Verb::Replay(args) => replay::run(&args),
            Verb::Teach(args) => teach::run(&args),
            Verb::Ros(args) => ros::run(&args),
            #[cfg(feature = "opencv")]
            Verb::Capture(args) => capture::run(&args),
            #[cfg(feature = "opencv")]
            Verb::Train(args) => train::run(&args),
            #[cfg(feature = "opencv")]
            Verb::Evaluate(args) => evaluate::run(&args),
            #[cfg(feature = "opencv")]
            Verb::Look(args) => look::run(&args),
            #[cfg(feature = "opencv")]
            Verb::Views(args) => views::run(&args),
            Verb::Vocabulary(args) => vocabulary::run(&args),
            Verb::Emulate(args) => emulate::run(&args),
            Verb::Explain(args) => explain::run(&args),
            Verb::Trust(args) => trust::run(&args),
            Verb::Verify(args) => verify::run(&args),
            Verb::Doctor(args) => doctor::run(&args),
            Verb::Config(args) => config::run(&args),
            Verb::Completions(args) => manual::completions(&args),
            Verb::Man(args) => manual::man(&args),
        }
    }
}

/// Sends log lines to stderr; `RUST_LOG` chooses which. When it is silent: our own warnings, and Zenoh's errors; what
/// else concerns the user is said in Gestalt's own words.
pub fn start_log() {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| {
        // Zenoh's routing complains of each link that ends while it is shut down.
        let zenoh = "error,zenoh::net::routing=off";
        EnvFilter::new(format!(
            "{zenoh},gestalt_peer=warn,gestalt_link=warn,gestalt_vision=warn,gestalt_lab=warn"
        ))
    });
    // Colours are for a terminal alone.
    let colours = io::stderr().is_terminal();
    tracing_subscriber::fmt().with_env_filter(filter).with_ansi(colours).with_writer(io::stderr).init();
}

/// Zenoh needs a runtime with several threads.
fn runtime() -> Result<tokio::runtime::Runtime, Failure> {
    Ok(tokio::runtime::Builder::new_multi_thread().enable_all().build()?)
}

/// Has a round opened in the name of an instructor, and waits for the decision of one after `before`; `None` when there
/// is none within `timeout`. Who may not open one is told so, and waits no longer.
async fn open_round(
    client: &Client,
    news: &mut News,
    instructor: &InstructorId,
    before: Option<u32>,
    timeout: Duration,
) -> Result<Option<Announcement>, Failure> {
    let decided = pin!(next_decision(news, before, timeout));
    // Nothing answers it but a refusal.
    let refused = client.teach(instructor, &Instruction::Open, timeout);
    first_of(decided, refused).await
}

/// The decision, or an error by a refusal that came before it.
async fn first_of(
    mut decided: impl Future<Output = Result<Option<Announcement>, Failure>> + Unpin,
    refused: impl Future<Output = Result<Option<Answer>, LinkError>>,
) -> Result<Option<Announcement>, Failure> {
    tokio::select! {
        biased;
        decided = &mut decided => decided,
        answer = refused => match answer?.filter(|answer| answer.outcome.is_refusal()) {
            Some(answer) => Err(answer.outcome.describe().into()),
            None => decided.await,
        },
    }
}

/// Waits for the decision of a round after `before`; `None` when there is none within `timeout`.
async fn next_decision(
    news: &mut News,
    before: Option<u32>,
    timeout: Duration,
) -> Result<Option<Announcement>, Failure> {
    match tokio::time::timeout(timeout, news.decision_after(before)).await {
        Ok(Some(decided)) => Ok(Some(decided)),
        Ok(None) => Err("the Zenoh session was closed".into()),
        Err(_) => Ok(None),
    }
}

/// Waits for Ctrl-C or SIGTERM, as service managers and containers send it; where signals cannot be had, for ever. To be
/// made once and kept: what comes while nobody listens is lost. A second one ends the program at once.
async fn interrupted() {
    match signals() {
        Ok(mut signals) => {
            let (asked, is_asked) = tokio::sync::oneshot::channel();
            // Beside whoever is to end: a reader of its output that reads no more may hold that up.
            tokio::spawn(async move {
                signals.next().await;
                // Who needed it no more has ended already.
                let _ = asked.send(());
                signals.next().await;
                std::process::exit(130);
            });
            let _ = is_asked.await;
        }
        Err(error) => {
            tracing::warn!("cannot listen for Ctrl-C: {error}");
            std::future::pending::<()>().await;
        }
    }
}

/// What asks the program to end.
#[cfg(unix)]
struct Signals {
    interrupt: tokio::signal::unix::Signal,
    terminate: tokio::signal::unix::Signal,
}

#[cfg(unix)]
fn signals() -> io::Result<Signals> {
    use tokio::signal::unix::{SignalKind, signal};
    Ok(Signals { interrupt: signal(SignalKind::interrupt())?, terminate: signal(SignalKind::terminate())? })
}

#[cfg(unix)]
impl Signals {
    async fn next(&mut self) {
        tokio::select! {
            _ = self.interrupt.recv() => {}
            _ = self.terminate.recv() => {}
        }
    }
}

#[cfg(not(unix))]
struct Signals;

#[cfg(not(unix))]
fn signals() -> io::Result<Signals> {
    Ok(Signals)
}

#[cfg(not(unix))]
impl Signals {
    async fn next(&mut self) {
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
    }
}

/// Writes a report to stdout, and sends it off at once: whoever reads may be a program that waits for it. A reader
/// that has seen enough (`| head`) is no failure.
fn say(report: &str) -> Result<(), Failure> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(report.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => {
            UNREAD.store(true, Ordering::Relaxed);
            Ok(())
        }
        said => Ok(said?),
    }
}

/// Whether the reader of stdout has gone.
static UNREAD: AtomicBool = AtomicBool::new(false);

/// Whether nobody reads what is said any more: who does nothing but say it ends then.
fn is_unread() -> bool {
    UNREAD.load(Ordering::Relaxed)
}

/// The longest duration of a command line: it is added to the clock, which has an end.
const LONGEST: Duration = Duration::from_secs(366 * 24 * 60 * 60);

/// Reads `500ms`, `2s`, `1m 30s`.
fn duration(text: &str) -> Result<Duration, String> {
    match text.parse::<humantime_serde::re::humantime::Duration>() {
        Ok(duration) if *duration > LONGEST => Err("must be at most a year".to_owned()),
        Ok(duration) if !duration.is_zero() => Ok(duration.into()),
        Ok(_) => Err("must be greater than 0".to_owned()),
        Err(error) => Err(format!("{error}; write a number with a unit, like 500ms or 2s")),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;
    use gestalt_protocol::{Outcome, RobotId};

    use super::*;

    #[test]
    fn a_duration_has_an_end() {
        assert_eq!(duration("1m 30s"), Ok(Duration::from_secs(90)));
        assert_eq!(duration("366days"), Ok(LONGEST));
        for (text, cause) in
            [("367days", "a year"), ("500000000000years", "a year"), ("0s", "greater than 0")]
        {
            let error = duration(text).unwrap_err();
            assert!(error.contains(cause), "{error}");
        }
    }

    #[tokio::test]
    async fn who_may_not_open_a_round_is_told_so_before_the_time_is_up() {
        let (robot, to) = (RobotId(1), Instruction::Open);
        let outcome = Outcome::NotAllowed;
        let answer = Answer { robot, at: 1, to, outcome, class: None, looks_like: None, samples: 0 };
        let refused = std::future::ready(Ok(Some(answer)));
        let refused = first_of(Box::pin(std::future::pending()), refused).await;
        assert!(refused.unwrap_err().to_string().starts_with("not allowed"));
        // Nobody answers what is done.
        let decided = Box::pin(async {
            tokio::task::yield_now().await;
            Ok(None)
        });
        assert!(first_of(decided, std::future::ready(Ok(None))).await.unwrap().is_none());
    }

    /// The words of a line as a shell takes them apart; enough for examples.
    fn words(line: &str) -> Vec<String> {
        let parts = line.split('\'').enumerate();
        let quoted = parts.flat_map(|(i, part)| match i % 2 {
            1 => vec![part.to_owned()],
            _ => part.split_whitespace().map(str::to_owned).collect(),
        });
        quoted.collect()
    }

    #[test]
    fn every_verb_ends_its_help_with_two_examples_that_can_be_run() {
        let command = Command::command();
        command.clone().debug_assert();
        let verbs = command.get_subcommands().flat_map(|verb| {
            let inner = verb
                .get_subcommands()
                .map(|inner| (format!("{} {}", verb.get_name(), inner.get_name()), inner));
            std::iter::once((verb.get_name().to_owned(), verb)).chain(inner)
        });
        for (name, verb) in verbs {
            let help = verb.get_after_help().unwrap_or_else(|| panic!("{name} has no examples")).to_string();
            let examples: Vec<&str> = help.lines().skip(1).map(str::trim).collect();
            assert!(help.starts_with("Examples:\n") && examples.len() == 2, "{name}: {help}");
            for example in examples {
                let given = example.split(['|', '>', '<']).next().unwrap();
                assert!(given.starts_with(&format!("gestalt {name}")), "{name}: {example}");
                if let Err(error) = Command::try_parse_from(words(given)) {
                    panic!("{example}: {error}");
                }
            }
        }
    }

    #[cfg(feature = "opencv")]
    #[test]
    fn what_flags_choose_from_is_listed() {
        let mut command = Command::command();
        for (verb, choices) in [("swarm", "confidence_weighted"), ("swarm", "nothing"), ("center", "central")]
        {
            let help = command.find_subcommand_mut(verb).unwrap().render_long_help().to_string();
            assert!(help.contains("possible values") && help.contains(choices), "{help}");
        }
    }
}
