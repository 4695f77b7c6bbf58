//! The thread that takes pictures, and the newest one of them.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::Instant;

use gestalt_protocol::RoundId;
use tokio::sync::Notify;

use super::feed::{Content, Feed};
use gestalt_vision::source::SourceError;

/// The newest picture of a running camera; it stops when this is dropped.
#[derive(Debug, Default)]
pub(super) struct Lens {
    newest: Mutex<Option<Shot>>,
    taken: Notify,
    round: Mutex<Option<RoundId>>,
    overwritten: AtomicU64,
}

/// A picture, or why there is none.
#[derive(Debug)]
pub(super) struct Shot {
    pub content: Result<Content, SourceError>,
    pub at: Instant,
}

impl Lens {
    /// Starts to take pictures at the camera's rate.
    pub fn open(feed: Feed) -> std::io::Result<Arc<Self>> {
        let lens = Arc::new(Self::default());
        let weak = Arc::downgrade(&lens);
        std::thread::Builder::new().name("camera".to_owned()).spawn(move || take(feed, &weak))?;
        Ok(lens)
    }

    /// Waits for a picture and takes it out; those before it are gone.
    pub async fn newest(&self) -> Shot {
        loop {
            let shot = self.newest.lock().unwrap_or_else(PoisonError::into_inner).take();
            match shot {
                Some(shot) => return shot,
                None => self.taken.notified().await,
            }
        }
    }

    /// Which round is judged now, for a camera before which somebody shows gestures by rounds.
    pub fn look_for(&self, round: Option<RoundId>) {
        *self.round.lock().unwrap_or_else(PoisonError::into_inner) = round;
    }

    /// How many pictures gave way to newer ones.
    pub fn overwritten(&self) -> u64 {
        self.overwritten.load(Ordering::Relaxed)
    }

    fn put(&self, shot: Shot) {
        let before = self.newest.lock().unwrap_or_else(PoisonError::into_inner).replace(shot);
        if before.is_some() {
            self.overwritten.fetch_add(1, Ordering::Relaxed);
        }
        self.taken.notify_one();
    }
}

fn take(mut feed: Feed, lens: &Weak<Lens>) {
    let (started, period) = (Instant::now(), feed.period());
    let mut next = started;
    while let Some(lens) = lens.upgrade() {
        let round = *lens.round.lock().unwrap_or_else(PoisonError::into_inner);
        let content = feed.next(started.elapsed(), round);
        let ended = matches!(content, Err(SourceError::Ended(_)));
        lens.put(Shot { content, at: Instant::now() });
        drop(lens);
        if ended {
            return;
        }
        // A camera that fell behind drops frames; it never hurries to make up for them.
        next = Instant::now().max(next + period);
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
    }
}
