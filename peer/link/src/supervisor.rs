//! Nothing of a robot ends unnoticed: every part's end that nobody asked for is told, and the part begun anew, or the
//! robot ended.

use std::convert::Infallible;
use std::future::Future;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::{broadcast, watch};
use tokio::task::{JoinError, JoinSet};
use zenoh::Session;

use crate::account::Account;
use crate::event::Event;
use crate::failure::{Failure, Part};
use crate::panics::said;

/// How long after its end a part begins anew: at first, and at most. One that has run for as long as the most begins with
/// the first again.
const PAUSE: Duration = Duration::from_millis(200);
const MAX_PAUSE: Duration = Duration::from_secs(30);

/// How often it is made sure that a session is still open.
const LOOK_AFTER: Duration = Duration::from_millis(500);

/// Watches over the parts of one robot.
#[derive(Debug)]
pub(crate) struct Supervisor {
    account: Arc<Account>,
    events: broadcast::Sender<Event>,
    ended: watch::Sender<Option<Failure>>,
    /// Tasks that run until the robot ends.
    parts: Mutex<JoinSet<()>>,
    #[cfg(any(test, feature = "test-hooks"))]
    doomed: watch::Sender<std::collections::BTreeSet<Part>>,
}

impl Supervisor {
    pub fn new(account: Arc<Account>, events: broadcast::Sender<Event>) -> Arc<Self> {
        Arc::new(Self {
            account,
            events,
            ended: watch::Sender::new(None),
            parts: Mutex::default(),
            #[cfg(any(test, feature = "test-hooks"))]
            doomed: watch::Sender::default(),
        })
    }

    /// Where what fails is told.
    pub fn account(&self) -> &Arc<Account> {
        &self.account
    }

    /// Tells that a part failed, and goes on: who calls this begins it anew.
    pub fn failed(&self, part: Part, cause: &str) {
        let failure = Failure { part, cause: cause.to_owned() };
        self.account.count(&format!("failed_{part}"));
        self.account.error(&failure.to_string());
        // An error says that nobody listens, which is fine.
        let _ = self.events.send(Event::Failed { part, cause: failure.cause });
    }

    /// Tells that a part failed that the robot cannot do without: it ends.
    pub fn end(&self, part: Part, cause: String) {
        self.failed(part, &cause);
        self.ended.send_if_modified(|ended| {
            let first = ended.is_none();
            ended.get_or_insert(Failure { part, cause });
            first
        });
    }

    /// Waits until the robot has to end.
    pub fn ended(&self) -> impl Future<Output = Failure> + use<> {
        let mut ended = self.ended.subscribe();
        async move {
            let failure = ended.wait_for(Option::is_some).await.ok().and_then(|failure| failure.clone());
            match failure {
                Some(failure) => failure,
                // Nobody is left who could end it.
                None => std::future::pending().await,
            }
        }
    }

    /// Runs a task until the robot ends: whenever it ends or panics before, that is told, and `start` begins it anew, each
    /// time after a longer pause. A task that returns `Ok` is done.
    pub fn keep<F>(self: &Arc<Self>, part: Part, mut start: impl FnMut() -> F + Send + 'static)
    where
        F: Future<Output = Result<(), String>> + Send + 'static,
    {
        let supervisor = self.clone();
        let kept = async move {
            let mut pause = PAUSE;
            loop {
                let began = Instant::now();
                match run_apart(supervisor.clone(), part, start()).await {
                    Ok(Ok(())) => return,
                    Ok(Err(cause)) | Err(cause) => supervisor.failed(part, &cause),
                }
                if began.elapsed() >= MAX_PAUSE {
                    pause = PAUSE;
                }
                tokio::time::sleep(pause).await;
                pause = (pause * 2).min(MAX_PAUSE);
            }
        };
        self.parts.lock().unwrap_or_else(PoisonError::into_inner).spawn(kept);
    }

    /// Ends all that is kept, and waits until it has ended.
    pub async fn stop(&self) {
        let mut parts = std::mem::take(&mut *self.parts.lock().unwrap_or_else(PoisonError::into_inner));
        parts.shutdown().await;
    }
}

/// Ends a robot whose session has been closed, by whomever. Never returns before.
pub(crate) async fn watch_session(session: Session, supervisor: Arc<Supervisor>) -> Result<(), String> {
    loop {
        tokio::time::sleep(LOOK_AFTER).await;
        if session.is_closed() {
            supervisor.end(Part::Session, "Zenoh closed it".to_owned());
            return Ok(());
        }
    }
}

/// Runs a part as a task of its own, so that a panic ends nothing else. Dropping it ends the part.
pub(crate) async fn run_apart<T: Send + 'static>(
    supervisor: Arc<Supervisor>,
    part: Part,
    run: impl Future<Output = T> + Send + 'static,
) -> Result<T, String> {
    let mut task = JoinSet::new();
    task.spawn(async move {
        tokio::select! {
            done = run => done,
            never = supervisor.doom(part) => match never {},
        }
    });
    match task.join_next().await {
        Some(ended) => ended.map_err(cause),
        None => Err("it was never begun".to_owned()),
    }
}

/// Why a task ended that nobody ended.
pub(crate) fn cause(error: JoinError) -> String {
    match error.try_into_panic() {
        Ok(panic) => said(&*panic),
        Err(error) => error.to_string(),
    }
}

#[cfg(not(any(test, feature = "test-hooks")))]
impl Supervisor {
    /// How long a thread without work sleeps: until it is woken.
    pub const GLANCE: Duration = Duration::MAX;

    async fn doom(&self, _: Part) -> Infallible {
        std::future::pending().await
    }

    pub fn is_doomed(&self, _: Part) -> bool {
        false
    }

    pub fn stumble(&self, _: Part) {}
}

/// For tests: parts that are made to fail.
#[cfg(any(test, feature = "test-hooks"))]
impl Supervisor {
    /// How long a thread without work sleeps, before it looks whether it is made to fail.
    pub const GLANCE: Duration = Duration::from_millis(50);

    /// Makes a part panic, once.
    pub fn make_fail(&self, part: Part) {
        self.doomed.send_modify(|doomed| {
            doomed.insert(part);
        });
    }

    /// Panics when that part is made to fail.
    async fn doom(&self, part: Part) -> Infallible {
        let mut doomed = self.doomed.subscribe();
        loop {
            self.stumble(part);
            if doomed.changed().await.is_err() {
                std::future::pending::<()>().await;
            }
        }
    }

    /// Whether that part is made to fail.
    pub fn is_doomed(&self, part: Part) -> bool {
        self.doomed.borrow().contains(&part)
    }

    /// Panics when that part is made to fail.
    pub fn stumble(&self, part: Part) {
        let mut hit = false;
        self.doomed.send_if_modified(|doomed| {
            hit = doomed.remove(&part);
            false
        });
        assert!(!hit, "made to fail by a test");
    }
}
