//! Hands the messages of a recorder to the clients that want them, and waits for none of them.

use std::collections::{BTreeMap, HashMap};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use axum::body::Bytes;
use gestalt_protocol::{Keys, RobotId, Topic};
use gestalt_tape::{Alive, Entry, Kind};
use serde::Serialize;
use thiserror::Error;
use tokio::sync::{mpsc, oneshot};

use super::channel::{Channel, Schema};
use super::wire::Subscription;

/// The most channels: a hundred robots have five each. Whoever may say anything may say it under the key of any robot.
const MAX_CHANNELS: usize = 4096;

/// What may wait for a client before it counts as one that does not read: messages, and bytes.
const MAX_WAITING: usize = 2048;
const MAX_WAITING_BYTES: usize = 16 << 20;

/// Pictures are left out for a client for which this much waits: the next one is as good.
const MAX_WAITING_BEFORE_PICTURE: usize = 1 << 20;

/// How long the first message of a channel is kept for those who subscribe when they are told of it.
const YOUNG: Duration = Duration::from_secs(2);

/// The most bytes that are kept for them.
const MAX_KEPT: usize = 1 << 20;

/// One thing that waits for a client.
#[derive(Debug)]
pub(super) enum Out {
    Data { subscription: u32, at: u64, data: Bytes },
    Advertise(Arc<Channel>),
    Unadvertise(u32),
}

impl Out {
    fn size(&self) -> usize {
        match self {
            Self::Data { data, .. } => size_of::<Self>() + data.len(),
            Self::Advertise(_) | Self::Unadvertise(_) => size_of::<Self>(),
        }
    }
}

/// Why a client is served no more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Dismissal {
    /// Too much waits for it.
    Slow,
    /// The server closes.
    Closing,
}

/// Why there is no such subscription.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub(super) enum Refusal {
    #[error("there is no channel {0}")]
    Channel(u32),
    #[error("channel {0} is subscribed already; it stays so, and this subscription is passed over")]
    Twice(u32),
    #[error("the subscription {0} is in use already, for another channel")]
    Used(u32),
    #[error("there is no subscription {0}")]
    Unknown(u32),
}

/// What became of all clients so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Visits {
    /// Clients that were let in.
    pub clients: u64,
    /// Those that were sent away: they took nothing of what was theirs, or said nothing when asked for a sign of life.
    pub dropped: u64,
    /// Messages of clients that were none of the protocol, or asked for what is not there.
    pub refused: u64,
}

/// The channels, and who wants which.
#[derive(Debug)]
pub(super) struct Hub {
    keys: Keys,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    channels: BTreeMap<u32, Arc<Channel>>,
    ids: HashMap<(Kind, String), u32>,
    next_channel: u32,
    schemas: BTreeMap<Kind, Arc<Schema>>,
    clients: BTreeMap<u64, Client>,
    next_client: u64,
    /// By channel, what one who subscribes now is told at once.
    kept: BTreeMap<u32, Kept>,
    kept_bytes: usize,
    closed: bool,
    visits: Visits,
}

#[derive(Debug)]
struct Kept {
    since: Duration,
    at: u64,
    data: Bytes,
    /// Not only while the channel is young: what it says is so until it says otherwise.
    is_state: bool,
}

#[derive(Debug)]
struct Client {
    queue: mpsc::Sender<Out>,
    waiting: Arc<AtomicUsize>,
    /// By channel.
    subscriptions: BTreeMap<u32, u32>,
    dismiss: oneshot::Sender<Dismissal>,
}

/// A client's end of the hub.
#[derive(Debug)]
pub(super) struct Seat {
    pub id: u64,
    /// The channels there were when it came.
    pub channels: Vec<Arc<Channel>>,
    outs: mpsc::Receiver<Out>,
    waiting: Arc<AtomicUsize>,
}

impl Seat {
    /// What is to be sent next.
    pub async fn next(&mut self) -> Option<Out> {
        let out = self.outs.recv().await?;
        self.waiting.fetch_sub(out.size(), Ordering::AcqRel);
        Some(out)
    }
}

impl Hub {
    /// With the channels of the whole swarm that every recording may have.
    pub fn new(keys: Keys) -> Self {
        let mut state = State::default();
        for (kind, topic) in Entry::channels(&keys, None) {
            state.channel(kind, &topic);
        }
        Self { keys, state: Mutex::new(state) }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A client comes, and may be sent away. `None` once the hub is closed.
    pub fn join(&self) -> Option<(Seat, oneshot::Receiver<Dismissal>)> {
        let mut state = self.state();
        if state.closed {
            return None;
        }
        state.next_client += 1;
        state.visits.clients += 1;
        let (id, waiting) = (state.next_client, Arc::default());
        let (queue, outs) = mpsc::channel(MAX_WAITING);
        let (dismiss, dismissed) = oneshot::channel();
        let subscriptions = BTreeMap::new();
        state.clients.insert(id, Client { queue, waiting: Arc::clone(&waiting), subscriptions, dismiss });
        Some((Seat { id, channels: state.channels.values().cloned().collect(), outs, waiting }, dismissed))
    }

    /// A client has gone; `dropped` if it was sent away.
    pub fn leave(&self, id: u64, dropped: bool) {
        let mut state = self.state();
        state.clients.remove(&id);
        state.visits.dropped += u64::from(dropped);
    }

    pub fn subscribe(&self, id: u64, subscription: Subscription) -> Result<(), Refusal> {
        let mut state = self.state();
        let State { channels, clients, kept, .. } = &mut *state;
        let Some(client) = clients.get_mut(&id) else { return Ok(()) };
        let Subscription { id: number, channel_id } = subscription;
        if !channels.contains_key(&channel_id) {
            return Err(Refusal::Channel(channel_id));
        }
        if client.subscriptions.contains_key(&channel_id) {
            return Err(Refusal::Twice(channel_id));
        }
        if client.subscriptions.values().any(|used| *used == number) {
            return Err(Refusal::Used(number));
        }
        client.subscriptions.insert(channel_id, number);
        let taken = kept.get(&channel_id).is_none_or(|Kept { at, data, .. }| {
            client.take(Out::Data { subscription: number, at: *at, data: data.clone() })
        });
        if !taken {
            state.dismiss(&[id]);
        }
        Ok(())
    }

    pub fn unsubscribe(&self, id: u64, number: u32) -> Result<(), Refusal> {
        let mut state = self.state();
        let Some(client) = state.clients.get_mut(&id) else { return Ok(()) };
        let before = client.subscriptions.len();
        client.subscriptions.retain(|_, used| *used != number);
        if client.subscriptions.len() < before { Ok(()) } else { Err(Refusal::Unknown(number)) }
    }

    /// Hands a message to all who want it, at `now`, a time since any fixed moment; `false` when there is no room for its channel.
    pub fn write(&self, entry: &Entry, now: Duration) -> bool {
        let mut state = self.state();
        let alive = alive(entry);
        if let Some(Alive { robot, alive: true }) = alive {
            state.expect(&self.keys, robot);
        }
        let (is_new, channel) = match state.channel(entry.kind, &entry.channel) {
            Some(found) => found,
            None => return false,
        };
        let data = Bytes::copy_from_slice(&entry.data);
        state.send(channel, entry, &data);
        state.keep(channel, is_new, alive.is_some(), now, entry.at, data);
        if let Some(Alive { robot, alive: false }) = alive {
            state.forget(&self.keys, robot);
        }
        true
    }

    /// Lets go of what was kept for those who subscribe to a young channel.
    pub fn age(&self, now: Duration) {
        let mut state = self.state();
        state.kept.retain(|_, kept| kept.is_state || now.saturating_sub(kept.since) < YOUNG);
        state.kept_bytes = state.kept.values().map(|kept| kept.data.len()).sum();
    }

    /// Counts what was refused.
    pub fn refuse(&self) {
        self.state().visits.refused += 1;
    }

    pub fn visits(&self) -> Visits {
        self.state().visits
    }

    /// Sends all clients away, and lets in no more.
    pub fn close(&self) {
        let mut state = self.state();
        state.closed = true;
        for (_, client) in std::mem::take(&mut state.clients) {
            // An error says that it is leaving.
            let _ = client.dismiss.send(Dismissal::Closing);
        }
    }
}

impl State {
    /// The channel, and whether it is new; `None` when there is no room for it.
    fn channel(&mut self, kind: Kind, topic: &str) -> Option<(bool, u32)> {
        if let Some(id) = self.ids.get(&(kind, topic.to_owned())) {
            return Some((false, *id));
        }
        if self.channels.len() >= MAX_CHANNELS {
            return None;
        }
        self.next_channel += 1;
        let id = self.next_channel;
        let schema = self.schemas.entry(kind).or_insert_with(|| Arc::new(Schema::of(kind))).clone();
        let channel = Arc::new(Channel { id, kind, topic: topic.to_owned(), schema });
        self.channels.insert(id, channel.clone());
        self.ids.insert((kind, topic.to_owned()), id);
        self.tell(|| Out::Advertise(channel.clone()));
        Some((true, id))
    }

    /// The channels of a robot, before it says anything there: whoever subscribes misses nothing. Tokens of robots that do not
    /// exist take no room from those that speak.
    fn expect(&mut self, keys: &Keys, robot: RobotId) {
        for (kind, topic) in Entry::channels(keys, Some(robot)) {
            if self.channels.len() < MAX_CHANNELS / 2 {
                self.channel(kind, &topic);
            }
        }
    }

    /// The robot has left: its channels go.
    fn forget(&mut self, keys: &Keys, robot: RobotId) {
        let alive = keys.key(&Topic::Alive(robot));
        let of_robot = format!("/{}", alive.trim_end_matches("alive"));
        let gone: Vec<_> =
            self.channels.values().filter(|it| it.topic.starts_with(&of_robot)).cloned().collect();
        for channel in gone {
            self.channels.remove(&channel.id);
            self.ids.remove(&(channel.kind, channel.topic.clone()));
            self.kept.remove(&channel.id);
            for client in self.clients.values_mut() {
                client.subscriptions.remove(&channel.id);
            }
            self.tell(|| Out::Unadvertise(channel.id));
        }
    }

    fn tell(&mut self, out: impl Fn() -> Out) {
        let slow: Vec<_> =
            self.clients.iter().filter(|(_, client)| !client.take(out())).map(|(id, _)| *id).collect();
        self.dismiss(&slow);
    }

    fn send(&mut self, channel: u32, entry: &Entry, data: &Bytes) {
        let takes = |client: &Client| {
            let Some(&subscription) = client.subscriptions.get(&channel) else { return true };
            let is_picture = entry.kind == Kind::Frame;
            if is_picture && client.waiting.load(Ordering::Acquire) > MAX_WAITING_BEFORE_PICTURE {
                return true;
            }
            client.take(Out::Data { subscription, at: entry.at, data: data.clone() })
        };
        let slow: Vec<_> =
            self.clients.iter().filter(|(_, client)| !takes(client)).map(|(id, _)| *id).collect();
        self.dismiss(&slow);
    }

    fn keep(&mut self, channel: u32, is_new: bool, is_state: bool, now: Duration, at: u64, data: Bytes) {
        let old = self.kept.get(&channel).map(|kept| kept.data.len());
        let room = self.kept_bytes - old.unwrap_or_default() + data.len() <= MAX_KEPT;
        if (is_new || is_state) && room {
            self.kept_bytes += data.len();
            self.kept_bytes -= old.unwrap_or_default();
            self.kept.insert(channel, Kept { since: now, at, data, is_state });
        }
    }

    fn dismiss(&mut self, slow: &[u64]) {
        for client in slow.iter().filter_map(|id| self.clients.remove(id)) {
            // An error says that it is leaving.
            let _ = client.dismiss.send(Dismissal::Slow);
        }
    }
}

impl Client {
    /// Whether there is room for it.
    fn take(&self, out: Out) -> bool {
        let size = out.size();
        let room = self.waiting.fetch_add(size, Ordering::AcqRel) + size <= MAX_WAITING_BYTES;
        room && self.queue.try_send(out).is_ok()
    }
}

/// Whether a robot is there, where a message says so.
fn alive(entry: &Entry) -> Option<Alive> {
    (entry.kind == Kind::Alive).then(|| serde_json::from_slice(&entry.data).ok())?
}
