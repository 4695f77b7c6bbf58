//! What all readers of the page are shown, written once for all of them.

use std::time::Duration;

use axum::body::Bytes;
use serde::Serialize;
use serde_json::json;
use tokio::sync::watch;

use crate::follow::Show;
use crate::view::View;

/// The parts of the page, by the names of their events.
const NAMES: [&str; 5] = ["swarm", "decision", "rounds", "question", "beat"];

/// One part as it was last written.
#[derive(Clone, Debug, Default)]
struct Part {
    /// Grows whenever it is written otherwise.
    version: u64,
    /// The whole event, as it goes to readers.
    event: Bytes,
}

/// All parts. A reader that comes, or comes back, gets all of them; one that was slow gets the newest of each and no more,
/// so nothing ever waits for it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Parts([Part; NAMES.len()]);

/// Where the parts are hung up.
#[derive(Debug)]
pub(crate) struct Board {
    parts: watch::Sender<Parts>,
    swarm: String,
}

/// What a reader has seen of the board.
#[derive(Clone, Debug)]
pub(crate) struct Reader {
    parts: watch::Receiver<Parts>,
    seen: [u64; NAMES.len()],
}

impl Board {
    pub fn new(swarm: &str) -> Self {
        Self { parts: watch::Sender::new(Parts::default()), swarm: swarm.to_owned() }
    }

    pub fn reader(&self) -> Reader {
        Reader { parts: self.parts.subscribe(), seen: [0; NAMES.len()] }
    }

    /// How many readers there are.
    pub fn readers(&self) -> usize {
        self.parts.receiver_count()
    }
}

impl Show for Board {
    /// Writes what has changed.
    fn show(&self, view: &View, now: Duration) {
        let events = [
            event(NAMES[0], &view.swarm(now)),
            event(NAMES[1], &view.decision()),
            event(NAMES[2], &json!({"rounds": view.rounds(), "curve": view.curve(), "said": view.said()})),
            event(NAMES[3], &view.question(now)),
        ];
        self.parts.send_if_modified(|parts| {
            let parts = parts.0.iter_mut().zip(events);
            let changed = parts.filter(|(part, event)| part.event != *event);
            changed.map(|(part, event)| part.write(event)).count() > 0
        });
    }

    /// Says that the page is live: readers that hear this no more have lost it.
    fn beat(&self, now: Duration) {
        let at_ms = u64::try_from(now.as_millis()).unwrap_or(u64::MAX);
        let event = event(NAMES[4], &json!({"swarm": self.swarm, "at_ms": at_ms}));
        self.parts.send_modify(|parts| parts.0[4].write(event));
    }
}

impl Part {
    fn write(&mut self, event: Bytes) {
        self.version += 1;
        self.event = event;
    }
}

impl Reader {
    /// The parts that were written since it last looked, waiting for the first; `None` once the board is gone.
    pub async fn next(&mut self) -> Option<Bytes> {
        loop {
            let mut events = Vec::new();
            for (part, seen) in self.parts.borrow_and_update().0.iter().zip(&mut self.seen) {
                if part.version > *seen {
                    *seen = part.version;
                    events.extend_from_slice(&part.event);
                }
            }
            if !events.is_empty() {
                return Some(events.into());
            }
            self.parts.changed().await.ok()?;
        }
    }
}

pub(crate) const IN_JSON: &str = "numbers, texts and lists of them have a place in JSON";

/// A server-sent event; JSON has no line breaks of its own.
fn event(name: &str, data: &impl Serialize) -> Bytes {
    let data = serde_json::to_string(data).expect(IN_JSON);
    format!("event: {name}\ndata: {data}\n\n").into()
}
