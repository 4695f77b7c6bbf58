//! What happens in a swarm, as a client hears it.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use gestalt_protocol::{
    Announcement, DecodeError, Envelope, Holding, Keys, MAX_ROBOTS, Message, Question, RobotId, RoundId,
    Topic, decode_json,
};
use tokio::sync::broadcast;
use tokio::sync::broadcast::error::RecvError;
use zenoh::Session;
use zenoh::sample::{Sample, SampleKind};

/// How many news may wait for a slow reader before it misses some.
const MAX_WAITING: usize = 1024;

/// One thing that happened.
#[expect(clippy::large_enum_variant, reason = "it is taken apart as it comes, and not kept")]
#[derive(Clone, Debug, PartialEq)]
pub enum Heard {
    /// The swarm decided.
    Decided(Announcement),
    /// That robot now holds another decision.
    Held(RobotId, Holding),
    /// The swarm asks whoever instructs it.
    Asked(Question),
    /// A robot came.
    Came(RobotId),
    /// A robot left, or was lost.
    Left(RobotId),
}

/// Everything that happens in a swarm, from the moment of asking on.
#[derive(Debug)]
pub struct News {
    heard: broadcast::Receiver<Heard>,
    known: Arc<Mutex<Known>>,
}

/// The swarm's state, as far as the news tell it.
#[derive(Debug, Default)]
struct Known {
    alive: BTreeSet<RobotId>,
    held: BTreeMap<RobotId, Holding>,
    newest: Option<u32>,
}

impl News {
    pub(super) async fn listen(session: &Session, keys: Keys) -> zenoh::Result<Self> {
        let (news, heard) = broadcast::channel(MAX_WAITING);
        let known = Arc::new(Mutex::new(Known::default()));
        Listener { keys, known: known.clone(), news }.listen(session).await?;
        Ok(Self { heard, known })
    }

    /// The next thing that happens; `None` once the session has ended.
    pub async fn next(&mut self) -> Option<Heard> {
        loop {
            match self.heard.recv().await {
                Ok(heard) => return Some(heard),
                Err(RecvError::Lagged(missed)) => tracing::warn!("{missed} messages passed unread"),
                Err(RecvError::Closed) => return None,
            }
        }
    }

    /// The decision of the first round to end after round `before`; `None` once the session has ended.
    pub async fn decision_after(&mut self, before: Option<u32>) -> Option<Announcement> {
        loop {
            match self.next().await? {
                Heard::Decided(it) if Some(it.decision.round.counter) > before => return Some(it),
                _ => {}
            }
        }
    }

    /// The counter of the newest round heard of.
    #[must_use]
    pub fn newest(&self) -> Option<u32> {
        self.known().newest
    }

    /// The decisions that robots hold for a round, as far as they have said so.
    #[must_use]
    pub fn holding(&self, round: RoundId) -> Vec<(RobotId, Holding)> {
        let known = self.known();
        let of_round = known.held.iter().filter(|(_, held)| held.round.counter == round.counter);
        of_round.map(|(robot, held)| (*robot, held.clone())).collect()
    }

    fn known(&self) -> MutexGuard<'_, Known> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Takes in what arrives, on Zenoh's threads.
#[derive(Clone)]
struct Listener {
    keys: Keys,
    known: Arc<Mutex<Known>>,
    news: broadcast::Sender<Heard>,
}

impl Listener {
    async fn listen(&self, session: &Session) -> zenoh::Result<()> {
        let keys = &self.keys;
        for key in [keys.key(&Topic::Decision), keys.every_robot("decision"), keys.key(&Topic::Question)] {
            let listener = self.clone();
            session
                .declare_subscriber(key)
                .callback(move |sample| listener.on_sample(&sample))
                .background()
                .await?;
        }
        let listener = self.clone();
        session
            .liveliness()
            .declare_subscriber(self.keys.every_robot("alive"))
            .history(true)
            .callback(move |sample| listener.on_liveliness(&sample))
            .background()
            .await
    }

    fn on_sample(&self, sample: &Sample) {
        let bytes = sample.payload().to_bytes();
        let heard = match self.keys.parse(sample.key_expr()) {
            Some(Topic::Decision) => decode_json(&bytes).map(Heard::Decided),
            Some(Topic::Question) => question(&bytes).map(Heard::Asked),
            Some(Topic::RobotDecision(robot)) => {
                held(robot, &bytes).map(|holding| Heard::Held(robot, holding))
            }
            _ => return,
        };
        let heard = match heard {
            Ok(heard) => heard,
            Err(error) => return tracing::warn!("{}: {error}", sample.key_expr()),
        };
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let round = match &heard {
            Heard::Decided(announcement) => Some(announcement.decision.round.counter),
            Heard::Held(robot, holding) => {
                if known.held.len() < MAX_ROBOTS || known.held.contains_key(robot) {
                    known.held.insert(*robot, holding.clone());
                }
                Some(holding.round.counter)
            }
            Heard::Asked(_) | Heard::Came(_) | Heard::Left(_) => None,
        };
        known.newest = known.newest.max(round);
        drop(known);
        // An error says that nobody reads, which is the reader's own business.
        let _ = self.news.send(heard);
    }

    fn on_liveliness(&self, sample: &Sample) {
        let Some(Topic::Alive(robot)) = self.keys.parse(sample.key_expr()) else { return };
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let heard = match sample.kind() {
            SampleKind::Put if known.alive.len() >= MAX_ROBOTS => None,
            SampleKind::Put => known.alive.insert(robot).then_some(Heard::Came(robot)),
            SampleKind::Delete => known.alive.remove(&robot).then_some(Heard::Left(robot)),
        };
        drop(known);
        if let Some(heard) = heard {
            let _ = self.news.send(heard);
        }
    }
}

/// What is asked, as it is claimed.
fn question(bytes: &[u8]) -> Result<Question, DecodeError> {
    let question: Question = decode_json(bytes)?;
    question.check()?;
    Ok(question)
}

/// What a robot says under its own key that it holds.
fn held(robot: RobotId, bytes: &[u8]) -> Result<Holding, DecodeError> {
    match Envelope::decode(bytes)? {
        Envelope { author, message: Message::Holding(holding), .. } if author == robot => Ok(holding),
        _ => Err(DecodeError::Impossible("another message than its robot's own word on what it holds")),
    }
}
