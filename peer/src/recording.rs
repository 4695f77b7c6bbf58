//! A running swarm on a recorder: a client of its own hears what is said, and asks robots how they are.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use gestalt_link::{Client, Heard, LinkConfig, LinkError, News, Overheard};
use gestalt_protocol::{Keys, PROTOCOL_VERSION, RobotId, Topic};
use gestalt_strategies::MindConfig;
use gestalt_tape::foxglove::Level;
use gestalt_tape::{Disk, Intake, Ledger, Passing, ROUNDS, Recorder, Room, SWARM, WriteError};
use thiserror::Error;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tokio::time::MissedTickBehavior;

/// How often robots are asked how they are.
const ASK: Duration = Duration::from_secs(5);

/// How long they may take to answer.
const ANSWER: Duration = Duration::from_secs(2);

/// How often it is looked whether the recorder is still attached to a robot.
const LOOKOUT: Duration = Duration::from_secs(1);

/// Why there is no recording, or not all of it.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// A file of that name is there.
    #[error("{0} is there already, and no recording is ever overwritten: choose another name")]
    Exists(PathBuf),
    /// The file cannot be made.
    #[error("cannot write {path}: {cause}")]
    Create {
        /// Which file.
        path: PathBuf,
        /// The system's reason.
        cause: std::io::Error,
    },
    /// The swarm cannot be reached.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The disk took no more. What is in the file can be read.
    #[error(
        "{path}: {cause}: {written} messages are in it and can be replayed; {missing}; make room and record again"
    )]
    Disk {
        /// Which file.
        path: PathBuf,
        /// What went wrong.
        cause: WriteError,
        /// How many messages are in it.
        written: u64,
        /// What is not.
        missing: String,
    },
}

/// What is to be recorded.
#[derive(Clone, Debug)]
pub struct RecordingPlan<'a> {
    /// The swarm's name.
    pub swarm: &'a str,
    /// How one of its robots is reached.
    pub link: &'a LinkConfig,
    /// Into which new file.
    pub file: &'a Path,
    /// The rounds of its robots, if they are known: a replay counts by them.
    pub rounds: Option<&'a MindConfig>,
    /// Whether to record what cameras stream.
    pub frames: bool,
}

/// A recording that is being made.
pub struct Recording {
    file: PathBuf,
    recorder: Recorder,
    end: oneshot::Sender<()>,
    listener: JoinHandle<()>,
}

/// The time: that of the system at the start, from then on the processor's, which no setting of clocks moves.
#[derive(Clone, Copy)]
struct Clock(Duration, Instant);

impl Clock {
    fn start() -> Self {
        // A clock before 1970 is one that was never set.
        Self(SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default(), Instant::now())
    }

    /// Nanoseconds since 1970.
    fn now(self) -> u64 {
        nanoseconds(self.0 + self.1.elapsed())
    }
}

fn nanoseconds(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

impl Recording {
    /// Attaches to the swarm and records from now on.
    ///
    /// # Errors
    /// [`RecordingError`]; no file is left where there is no recording.
    pub async fn start(plan: RecordingPlan<'_>) -> Result<Self, RecordingError> {
        let RecordingPlan { swarm, link, file, rounds, frames } = plan;
        let keys = Keys::new(swarm).map_err(LinkError::from)?;
        let client = Client::open(swarm, link).await?;
        let disk = Disk::create(file).map_err(|cause| match cause.kind() {
            ErrorKind::AlreadyExists => RecordingError::Exists(file.to_owned()),
            _ => RecordingError::Create { path: file.to_owned(), cause },
        })?;
        let mut about = BTreeMap::from([
            (SWARM.to_owned(), swarm.to_owned()),
            ("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
            ("protocol".to_owned(), PROTOCOL_VERSION.to_string()),
        ]);
        about
            .extend(rounds.and_then(|rounds| Some((ROUNDS.to_owned(), serde_json::to_string(rounds).ok()?))));
        let recorder =
            Recorder::start(disk, keys, about, Room::default()).map_err(|cause| RecordingError::Disk {
                path: file.to_owned(),
                cause,
                written: 0,
                missing: "nothing was heard yet".to_owned(),
            })?;
        let (clock, intake) = (Clock::start(), recorder.intake().clone());
        let news = client.news().await?;
        let taking = intake.clone();
        client.overhear(frames, move |heard| taking.take(passing(heard, clock.now()))).await?;
        let (end, ended) = oneshot::channel();
        let listener = Listener { client, news, intake, clock };
        let listener = tokio::spawn(listener.listen(ended));
        Ok(Self { file: file.to_owned(), recorder, end, listener })
    }

    /// What was received, written and lost so far.
    #[must_use]
    pub fn ledger(&self) -> Ledger {
        self.recorder.intake().ledger()
    }

    /// Whether the disk takes no more: all that comes is lost.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        self.recorder.intake().has_failed()
    }

    /// Ends the recording, with an index and a footer.
    ///
    /// # Errors
    /// [`RecordingError::Disk`] when not all of what was heard could be written.
    pub async fn finish(self) -> Result<Ledger, RecordingError> {
        let Self { file: path, recorder, end, listener } = self;
        // An error says that it has ended by itself.
        let _ = end.send(());
        if let Err(error) = listener.await {
            tracing::warn!("listening to the swarm: {error}");
        }
        let finished = tokio::task::spawn_blocking(|| recorder.finish()).await;
        let (ledger, ended) = finished.map_err(|error| RecordingError::Create {
            path: path.clone(),
            cause: std::io::Error::other(error),
        })?;
        let written = Ledger::total(&ledger.written);
        match ended {
            Ok(()) => Ok(ledger),
            Err(cause) => {
                let missing = ledger.missing().unwrap_or_else(|| "it has no index".to_owned());
                Err(RecordingError::Disk { path, cause, written, missing })
            }
        }
    }
}

fn passing(heard: Overheard, at: u64) -> Passing {
    match heard {
        Overheard::Present(robot, alive) => Passing::presence(robot, alive, at),
        Overheard::Said { topic, payload, attachment, published } => {
            let published = published.and_then(|time| time.duration_since(UNIX_EPOCH).ok()).map(nanoseconds);
            Passing { topic, payload, attachment, at, published }
        }
    }
}

/// Asks robots how they are, and writes the log of the recording.
struct Listener {
    client: Client,
    news: News,
    intake: Intake,
    clock: Clock,
}

impl Listener {
    async fn listen(mut self, mut ended: oneshot::Receiver<()>) {
        let mut lookout = tokio::time::interval(LOOKOUT);
        let mut ask = tokio::time::interval(ASK);
        lookout.set_missed_tick_behavior(MissedTickBehavior::Delay);
        ask.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut detached: Option<Instant> = None;
        let mut errors = BTreeMap::new();
        loop {
            tokio::select! {
                _ = &mut ended => break,
                heard = self.news.next() => match heard {
                    Some(heard) => self.log(&heard),
                    None => break,
                },
                _ = lookout.tick() => self.look_out(&mut detached).await,
                _ = ask.tick() => self.ask(&mut errors).await,
            }
        }
        self.ask(&mut errors).await;
        self.client.close().await;
    }

    /// One line for what happened.
    fn log(&self, heard: &Heard) {
        let words = match heard {
            Heard::Came(robot) => format!("robot {robot} is there"),
            Heard::Left(robot) => format!("robot {robot} left"),
            Heard::Decided(it) => {
                let what = match (&it.label, it.decision.class) {
                    (Some(label), _) => format!("\"{label}\""),
                    (None, Some(class)) => format!("class {class}"),
                    (None, None) => "undecided".to_owned(),
                };
                let votes = it.decision.certificate.votes.len();
                format!(
                    "round {}: {what}, p = {:.3}, {votes} votes",
                    it.decision.round, it.decision.confidence
                )
            }
            Heard::Asked(it) => format!("round {}: robot {} asks: {it}", it.round, it.robot),
            Heard::Held(..) => return,
        };
        self.intake.say(self.clock.now(), Level::Info, words);
    }

    /// What is said while the recorder is attached to nobody passes it by: for how long, the recording says.
    async fn look_out(&self, detached: &mut Option<Instant>) {
        if self.client.is_attached().await {
            if detached.take().is_some() {
                self.intake.say(self.clock.now(), Level::Info, "attached to a robot again");
            }
            return;
        }
        match detached.replace(Instant::now()) {
            Some(since) => self.intake.unattached(since.elapsed()),
            None => {
                let words = "attached to no robot: what is said now is not recorded";
                self.intake.say(self.clock.now(), Level::Warning, words);
                self.intake.unattached(LOOKOUT);
            }
        }
    }

    async fn ask(&self, errors: &mut BTreeMap<RobotId, String>) {
        // A closed session ends the news too.
        let Ok(statuses) = self.client.statuses(ANSWER).await else { return };
        for status in statuses {
            if let Some(error) = status.errors.last()
                && errors.insert(status.robot, error.what.clone()).as_ref() != Some(&error.what)
            {
                let words = format!("robot {}: {}", status.robot, error.what);
                self.intake.say(self.clock.now(), Level::Error, words);
            }
            let Ok(payload) = serde_json::to_vec(&status) else { continue };
            let (topic, at) = (Topic::Status(status.robot), self.clock.now());
            self.intake.take(Passing { topic, payload, attachment: None, at, published: None });
        }
    }
}
