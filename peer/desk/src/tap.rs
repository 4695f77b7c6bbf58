//! A running swarm on a recorder: hears all that is said, and asks robots how they are.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use gestalt_link::{Client, Heard, LinkError, News, Overheard};
use gestalt_protocol::{MAX_ROBOTS, RobotId, Topic};
use gestalt_tape::foxglove::Level;
use gestalt_tape::{Intake, Passing};
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tokio::time::MissedTickBehavior;

use crate::view::clipped;

/// How often robots are asked how they are.
const ASK: Duration = Duration::from_secs(5);

/// How long they may take to answer.
const ANSWER: Duration = Duration::from_secs(2);

/// How often it is looked whether the recorder is still attached to a robot.
const LOOKOUT: Duration = Duration::from_secs(1);

/// Hands a recorder all that passes in a swarm. It goes on until it is closed, or the session ends.
#[derive(Debug)]
pub struct Tap {
    end: oneshot::Sender<()>,
    listener: JoinHandle<()>,
}

impl Tap {
    /// Listens from now on; with `frames` also to what cameras stream.
    ///
    /// # Errors
    /// [`LinkError::Open`] when the client is closed.
    pub async fn open(client: Arc<Client>, frames: bool, intake: Intake) -> Result<Self, LinkError> {
        let clock = Clock::start();
        let news = client.news().await?;
        let taking = intake.clone();
        client.overhear(frames, move |heard| taking.take(passing(heard, clock.now()))).await?;
        let (end, ended) = oneshot::channel();
        let listener = Listener { client, news, intake, clock };
        Ok(Self { end, listener: tokio::spawn(listener.listen(ended)) })
    }

    /// Asks robots once more how they are, and lets go of the client: its session ends where nobody else has it.
    pub async fn close(self) {
        // An error says that it has ended by itself.
        let _ = self.end.send(());
        if let Err(error) = self.listener.await {
            tracing::warn!("listening to the swarm: {error}");
        }
    }
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
    client: Arc<Client>,
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
        if let Some(client) = Arc::into_inner(self.client) {
            client.close().await;
        }
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
            let error = status.errors.last().map(|error| clipped(&error.what));
            if let Some(error) = error
                && errors.insert(status.robot, error.clone()).as_ref() != Some(&error)
            {
                let words = format!("robot {}: {error}", status.robot);
                self.intake.say(self.clock.now(), Level::Error, words);
            }
            if errors.len() > MAX_ROBOTS {
                errors.pop_last();
            }
            let Ok(payload) = serde_json::to_vec(&status) else { continue };
            let (topic, at) = (Topic::Status(status.robot), self.clock.now());
            self.intake.take(Passing { topic, payload, attachment: None, at, published: None });
        }
    }
}
