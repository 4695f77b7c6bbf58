//! Records what passes, beside the swarm: whoever hands something in never waits for the disk, nor for those who look on.

use std::collections::BTreeMap;
use std::io::Write;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use gestalt_protocol::Keys;

use crate::foxglove::Level;
use crate::kind::Kind;
use crate::ledger::{Ledger, Tally};
use crate::passing::{Entry, Passing};
use crate::sink::{Sink, WriteError};
use crate::writer::TapeWriter;

/// A chunk is written after this long at the latest: a kill loses no more.
const FLUSH: Duration = Duration::from_millis(250);

/// And once so many bytes wait.
const CHUNK: usize = 256 * 1024;

/// How often the recorder says what it received, wrote and lost.
const REPORT: Duration = Duration::from_secs(1);

/// How much may wait for the disk before the next is dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    /// Messages, at least 1.
    pub messages: usize,
    /// Bytes, about.
    pub bytes: usize,
}

impl Default for Room {
    fn default() -> Self {
        Self { messages: 8192, bytes: 32 << 20 }
    }
}

/// Records into a file or another [`Sink`], in a thread of its own.
#[derive(Debug)]
pub struct Recorder {
    intake: Intake,
    thread: JoinHandle<Result<(), WriteError>>,
}

/// Where messages are handed in; a clone hands in to the same recording.
#[derive(Clone, Debug)]
pub struct Intake {
    queue: SyncSender<Order>,
    shared: Arc<Shared>,
    room: Room,
}

#[derive(Debug)]
enum Order {
    Take(Passing),
    Say(u64, Level, String),
}

#[derive(Debug, Default)]
struct Shared {
    ledger: Mutex<Ledger>,
    /// Bytes that wait, about.
    waiting: AtomicUsize,
    /// Nothing more is to be taken in.
    closing: AtomicBool,
    /// What was written last came to nothing.
    failed: AtomicBool,
}

impl Shared {
    fn ledger(&self) -> MutexGuard<'_, Ledger> {
        self.ledger.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Intake {
    /// Hands in what passed. Never waits: where there is no room it is dropped, and counted.
    pub fn take(&self, passing: Passing) {
        let Some(kind) = Kind::of(&passing.topic) else { return };
        if self.shared.closing.load(Ordering::Acquire) {
            return;
        }
        Ledger::count(&mut self.shared.ledger().received, kind);
        let size = passing.size();
        let room = self.shared.waiting.fetch_add(size, Ordering::AcqRel) + size <= self.room.bytes;
        if !room || self.queue.try_send(Order::Take(passing)).is_err() {
            self.shared.waiting.fetch_sub(size, Ordering::AcqRel);
            Ledger::count(&mut self.shared.ledger().dropped, kind);
        }
    }

    /// Adds a line to the log of the recording, at that time in nanoseconds since 1970.
    pub fn say(&self, at: u64, level: Level, words: impl Into<String>) {
        // A line that finds no room is one of the recorder's own, and no news of the swarm.
        let _ = self.queue.try_send(Order::Say(at, level, words.into()));
    }

    /// Notes that nothing could be heard for so long.
    pub fn unattached(&self, time: Duration) {
        let mut ledger = self.shared.ledger();
        let ms = u64::try_from(time.as_millis()).unwrap_or(u64::MAX);
        ledger.unattached_ms = ledger.unattached_ms.saturating_add(ms);
    }

    /// What was received, written and lost so far.
    #[must_use]
    pub fn ledger(&self) -> Ledger {
        self.shared.ledger().clone()
    }

    /// Whether the file takes no more, so that all that comes is lost.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        self.shared.failed.load(Ordering::Acquire)
    }
}

impl Recorder {
    /// Begins a recording of the swarm of these keys, into a file.
    ///
    /// # Errors
    /// [`WriteError`] when nothing can be written, or there is no room for a thread.
    pub fn start<W: Write + Send + 'static>(
        out: W,
        keys: Keys,
        about: BTreeMap<String, String>,
        room: Room,
    ) -> Result<Self, WriteError> {
        let shared = Arc::new(Shared::default());
        let writer = TapeWriter::new(Counting { out, shared: shared.clone() }, about)?;
        Self::spawn(writer, shared, keys, room)
    }

    /// Hands the same messages to somebody else, from now on.
    ///
    /// # Errors
    /// [`WriteError`] when there is no room for a thread.
    pub fn onto(sink: impl Sink, keys: Keys, room: Room) -> Result<Self, WriteError> {
        Self::spawn(sink, Arc::default(), keys, room)
    }

    fn spawn(sink: impl Sink, shared: Arc<Shared>, keys: Keys, room: Room) -> Result<Self, WriteError> {
        let (queue, orders) = sync_channel(room.messages);
        let desk = Desk { sink, orders, keys, shared: shared.clone(), under_way: Tally::new(), latest: 0 };
        let thread = std::thread::Builder::new().name("recorder".to_owned()).spawn(move || desk.run())?;
        Ok(Self { intake: Intake { queue, shared, room }, thread })
    }

    /// Where messages are handed in.
    #[must_use]
    pub fn intake(&self) -> &Intake {
        &self.intake
    }

    /// Ends the recording: what waits is written, then what was lost, an index and a footer.
    ///
    /// # Errors
    /// The [`WriteError`] that ended it before, with what the recording came to.
    pub fn finish(self) -> (Ledger, Result<(), WriteError>) {
        self.intake.shared.closing.store(true, Ordering::Release);
        let ended = self.thread.join().unwrap_or_else(|_| {
            Err(WriteError::Disk(std::io::Error::other("the recorder's thread panicked, which is a bug")))
        });
        (self.intake.ledger(), ended)
    }
}

/// Counts the bytes that reach the file.
struct Counting<W> {
    out: W,
    shared: Arc<Shared>,
}

impl<W: Write> Write for Counting<W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.shared.ledger().bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.out.flush()
    }
}

/// Where what passes becomes messages of the recording.
struct Desk<S> {
    sink: S,
    orders: Receiver<Order>,
    keys: Keys,
    shared: Arc<Shared>,
    /// Taken in, and not flushed yet.
    under_way: Tally,
    /// The time of the latest message: a report is made at no other.
    latest: u64,
}

impl<S: Sink> Desk<S> {
    fn run(mut self) -> Result<(), WriteError> {
        if let Err(error) = self.record() {
            self.shared.failed.store(true, Ordering::Release);
            Ledger::settle(&mut self.shared.ledger().lost, &mut self.under_way);
            self.lose_the_rest();
            return Err(error);
        }
        let end = self.shared.ledger().metadata();
        self.sink.finish(end)
    }

    fn record(&mut self) -> Result<(), WriteError> {
        let mut flush = Instant::now() + FLUSH;
        let mut report = Instant::now() + REPORT;
        loop {
            let closing = self.shared.closing.load(Ordering::Acquire);
            // What was handed in before the end is waited for no longer.
            let wait = if closing { Duration::ZERO } else { flush.saturating_duration_since(Instant::now()) };
            let idle = match self.orders.recv_timeout(wait) {
                Ok(order) => {
                    self.carry_out(order)?;
                    false
                }
                Err(RecvTimeoutError::Timeout) => true,
                Err(RecvTimeoutError::Disconnected) => break,
            };
            if closing && idle {
                break;
            }
            if Instant::now() >= flush || self.sink.pending() >= CHUNK {
                self.flush()?;
                flush = Instant::now() + FLUSH;
            }
            if Instant::now() >= report {
                self.report()?;
                report = Instant::now() + REPORT;
            }
        }
        self.flush()?;
        self.report()?;
        self.flush()
    }

    fn carry_out(&mut self, order: Order) -> Result<(), WriteError> {
        match order {
            Order::Take(passing) => {
                self.shared.waiting.fetch_sub(passing.size(), Ordering::AcqRel);
                self.latest = self.latest.max(passing.at);
                let (Some(kind), Some(entry)) = (Kind::of(&passing.topic), passing.entry(&self.keys)) else {
                    return Ok(());
                };
                Ledger::count(&mut self.under_way, kind);
                if !self.sink.write(&entry)? {
                    self.under_way.entry(kind).and_modify(|count| *count -= 1);
                    Ledger::count(&mut self.shared.ledger().dropped, kind);
                }
                Ok(())
            }
            Order::Say(at, level, words) => {
                self.latest = self.latest.max(at);
                self.sink.write(&Entry::log(&self.keys, at, level, &words)).map(drop)
            }
        }
    }

    fn flush(&mut self) -> Result<(), WriteError> {
        self.sink.flush()?;
        Ledger::settle(&mut self.shared.ledger().written, &mut self.under_way);
        Ok(())
    }

    /// Says what was received, written and lost so far.
    fn report(&mut self) -> Result<(), WriteError> {
        if self.latest == 0 {
            return Ok(());
        }
        let report = Entry::report(&self.keys, self.latest, &self.shared.ledger());
        self.sink.write(&report).map(drop)
    }

    /// Counts all that comes until the recorder is told to end.
    fn lose_the_rest(&mut self) {
        loop {
            match self.orders.recv_timeout(FLUSH) {
                Ok(Order::Take(passing)) => {
                    self.shared.waiting.fetch_sub(passing.size(), Ordering::AcqRel);
                    if let Some(kind) = Kind::of(&passing.topic) {
                        Ledger::count(&mut self.shared.ledger().lost, kind);
                    }
                }
                Ok(Order::Say(..)) => {}
                Err(RecvTimeoutError::Timeout) if !self.shared.closing.load(Ordering::Acquire) => {}
                Err(_) => return,
            }
        }
    }
}
