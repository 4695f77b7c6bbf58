//! The thread that sends what may wait: samples, and repairs for neighbours.
//!
//! Sending is a call that Zenoh may hold up: for a millisecond at a link that takes nothing, for seconds where another
//! program's message, one that must not be lost, waits at the same link and priority. That is no place for the mind's task.

use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use zenoh::qos::{CongestionControl, Priority};
use zenoh::{Session, Wait};

use crate::account::Account;
use crate::failure::Part;
use crate::panics::said;
use crate::supervisor::Supervisor;
use crate::worker::{Tray, Worker};

/// The most bytes that wait.
const MAX_WAITING: usize = 8 << 20;

/// One message to be sent.
pub(crate) struct Parcel {
    /// What it is, for the counters.
    pub kind: &'static str,
    pub key: String,
    pub bytes: Vec<u8>,
    /// What travels beside it.
    pub attachment: Option<Vec<u8>>,
    /// Whether it is sent at once, and not gathered with others.
    pub express: bool,
}

/// Sends what it is given, in order. What exceeds its bound, or finds no room at a link, is dropped and counted: repair
/// brings it again. Dropping it waits until what was handed over is sent.
pub(crate) struct Outbox {
    worker: Worker<Waiting>,
    account: Arc<Account>,
}

#[derive(Default)]
struct Waiting {
    parcels: VecDeque<Parcel>,
    bytes: usize,
}

impl Waiting {
    fn take(&mut self) -> VecDeque<Parcel> {
        self.bytes = 0;
        std::mem::take(&mut self.parcels)
    }
}

impl Outbox {
    pub fn start(
        session: Session,
        account: Arc<Account>,
        supervisor: Arc<Supervisor>,
    ) -> std::io::Result<Self> {
        let of_death = supervisor.clone();
        let died = move |panic: &(dyn std::any::Any + Send)| of_death.end(Part::Speaking, said(panic));
        let of_thread = account.clone();
        let work = move |tray: &Tray<Waiting>| send_all(tray, &session, &of_thread, &supervisor);
        Ok(Self { worker: Worker::start("speaking", Waiting::default(), work, died)?, account })
    }

    /// Hands over a message.
    pub fn send(&self, parcel: Parcel) {
        let kind = parcel.kind;
        let taken = self.worker.hand_over(|waiting| {
            let fits = waiting.bytes + parcel.bytes.len() <= MAX_WAITING;
            if fits {
                waiting.bytes += parcel.bytes.len();
                waiting.parcels.push_back(parcel);
            }
            fits
        });
        if !taken {
            self.account.count(&format!("dropped_{kind}"));
        }
    }
}

fn send_all(tray: &Tray<Waiting>, session: &Session, account: &Account, supervisor: &Supervisor) {
    loop {
        let is_work = |waiting: &Waiting| !waiting.parcels.is_empty() || supervisor.is_doomed(Part::Speaking);
        let (mut parcels, ended) = tray.take(is_work, Supervisor::GLANCE, Waiting::take);
        // A panic costs the one message that it came at.
        while let Err(panic) = catch_unwind(AssertUnwindSafe(|| {
            supervisor.stumble(Part::Speaking);
            while let Some(parcel) = parcels.pop_front() {
                send(session, account, parcel);
            }
        })) {
            supervisor.failed(Part::Speaking, &said(&*panic));
        }
        if ended {
            return;
        }
    }
}

fn send(session: &Session, account: &Account, parcel: Parcel) {
    let Parcel { kind, key, bytes, attachment, express } = parcel;
    account.sent(kind, bytes.len() + attachment.as_ref().map_or(0, Vec::len));
    let put = session
        .put(key, bytes)
        .attachment(attachment)
        .priority(Priority::Data)
        .congestion_control(CongestionControl::Drop)
        .express(express)
        .wait();
    account.check(put);
}
