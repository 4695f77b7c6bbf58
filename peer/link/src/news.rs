//! What happens in a swarm, as a client hears it.

mod newest;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use gestalt_protocol::{
    Announcement, DecodeError, Envelope, Holding, Keys, MAX_ROBOTS, Message, Question, RobotId, RoundId,
    Topic, decode_json,
};
use tokio::sync::broadcast;
use tokio::sync::broadcast::error::RecvError;
use zenoh::Session;
use zenoh::sample::{Sample, SampleKind};

use crate::complaints::Complaints;
use newest::Newest;
pub use newest::begins_anew;

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
    /// Each with how often the swarm had begun anew by then: its turn.
    heard: broadcast::Receiver<(Heard, u32)>,
    known: Arc<Mutex<Known>>,
}

/// The swarm's state, as far as the news tell it.
#[derive(Debug, Default)]
struct Known {
    alive: BTreeSet<RobotId>,
    held: BTreeMap<RobotId, Holding>,
    newest: Newest,
}

impl Known {
    /// Takes in what a decision, or a robot's word on what it holds, says. Says in which turn of the swarm.
    fn take_in(&mut self, heard: &Heard) -> u32 {
        match heard {
            Heard::Decided(announcement) => return self.newest.decide(announcement.decision.round),
            Heard::Held(robot, holding) => {
                if self.held.len() < MAX_ROBOTS || self.held.contains_key(robot) {
                    self.held.insert(*robot, holding.clone());
                }
                self.newest.hold(holding.round);
            }
            Heard::Asked(_) | Heard::Came(_) | Heard::Left(_) => {}
        }
        self.newest.turn()
    }
}

impl News {
    pub(super) async fn listen(session: &Session, keys: Keys) -> zenoh::Result<Self> {
        let (news, heard) = broadcast::channel(MAX_WAITING);
        let known = Arc::new(Mutex::new(Known::default()));
        Listener { keys, known: known.clone(), news, complaints: Arc::default() }.listen(session).await?;
        Ok(Self { heard, known })
    }

    /// The next thing that happens; `None` once the session has ended.
    pub async fn next(&mut self) -> Option<Heard> {
        self.receive().await.map(|(heard, _)| heard)
    }

    async fn receive(&mut self) -> Option<(Heard, u32)> {
        loop {
            match self.heard.recv().await {
                Ok(heard) => return Some(heard),
                Err(RecvError::Lagged(missed)) => tracing::warn!("{missed} messages passed unread"),
                Err(RecvError::Closed) => return None,
            }
        }
    }

    /// The decision of the first round to end after round `before`, or of the first in a swarm that starts again meanwhile and counts from one;
    /// `None` once the session has ended.
    pub async fn decision_after(&mut self, before: Option<u32>) -> Option<Announcement> {
        let turn = self.known().newest.turn();
        loop {
            match self.receive().await? {
                (Heard::Decided(it), now)
                    if now > turn || now == turn && Some(it.decision.round.counter) > before =>
                {
                    return Some(it);
                }
                _ => {}
            }
        }
    }

    /// The counter of the newest round heard of.
    #[must_use]
    pub fn newest(&self) -> Option<u32> {
        self.known().newest.counter()
    }

    /// Whether that round, of which a decision was heard, is the newest of those, or one that merges with it.
    #[must_use]
    pub fn is_newest(&self, round: RoundId) -> bool {
        self.known().newest.decided().is_some_and(|newest| newest.may_merge(&round))
    }

    /// Takes in a round that is known to be decided, though nothing was heard of it.
    pub fn know(&self, round: RoundId) {
        self.known().newest.decide(round);
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
    news: broadcast::Sender<(Heard, u32)>,
    complaints: Arc<Mutex<Complaints>>,
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
            Some(Topic::Decision) => decided(&bytes).map(Heard::Decided),
            Some(Topic::Question) => question(&bytes).map(Heard::Asked),
            Some(Topic::RobotDecision(robot)) => {
                held(robot, &bytes).map(|holding| Heard::Held(robot, holding))
            }
            _ => return,
        };
        let heard = match heard {
            Ok(heard) => heard,
            Err(error) => {
                let mut complaints = self.complaints.lock().unwrap_or_else(PoisonError::into_inner);
                complaints.note(format!("{}: {error}", sample.key_expr()));
                return match complaints.due(Instant::now()) {
                    None => {}
                    Some((cause, 1)) => tracing::warn!("{cause}"),
                    Some((cause, times)) => tracing::warn!("{cause}; {} before it", times - 1),
                };
            }
        };
        self.tell(heard);
    }

    fn tell(&self, heard: Heard) {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let turn = known.take_in(&heard);
        // In the order in which it was taken in. An error says that nobody reads, which is the reader's own business.
        let _ = self.news.send((heard, turn));
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
            self.tell(heard);
        }
    }
}

/// What was announced, as it is claimed.
fn decided(bytes: &[u8]) -> Result<Announcement, DecodeError> {
    let announcement: Announcement = decode_json(bytes)?;
    announcement.check()?;
    Ok(announcement)
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

#[cfg(test)]
mod tests {
    use gestalt_protocol::{Certificate, Decision, Stamp};
    use serde_json::json;

    use super::*;

    fn decided(counter: u32, life: u32) -> Heard {
        let certificate: Certificate = serde_json::from_value(json!({
            "vocabulary": 1, "rule": "majority", "probabilities": [], "votes": [], "others": [],
            "robots": 1, "quorum": 1, "elapsed_ms": 1
        }))
        .unwrap();
        let round = RoundId { counter, opener: RobotId(1), life };
        let decision =
            Decision { round, class: None, confidence: 1.0, author: RobotId(1), is_final: true, certificate };
        let stamp = Stamp::default();
        Heard::Decided(Announcement { decision, label: None, announcer: RobotId(1), stamp, signature: None })
    }

    fn news() -> (Listener, News) {
        let (news, heard) = broadcast::channel(MAX_WAITING);
        let known = Arc::new(Mutex::new(Known::default()));
        let keys = Keys::new("demo").unwrap();
        (Listener { keys, known: known.clone(), news, complaints: Arc::default() }, News { heard, known })
    }

    #[tokio::test]
    async fn the_next_decision_of_a_swarm_that_starts_again_is_waited_for() {
        let (listener, mut news) = news();
        listener.tell(decided(5, 7));
        let before = news.newest();
        let later = async {
            tokio::task::yield_now().await;
            [decided(5, 7), decided(4, 7), decided(1, 8)].into_iter().for_each(|heard| listener.tell(heard));
        };
        let (next, ()) = tokio::join!(news.decision_after(before), later);
        assert_eq!(next.unwrap().decision.round.counter, 1);
        // What was not read before is not what comes next.
        let before = news.newest();
        listener.tell(decided(5, 7));
        listener.tell(decided(2, 8));
        assert_eq!(news.decision_after(before).await.unwrap().decision.round.counter, 2);
        assert!(news.is_newest(RoundId { counter: 2, opener: RobotId(1), life: 8 }));
    }
}
