//! What a robot can tell of itself: counters, latest errors, and where it stands.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use gestalt_protocol::{DecodeError, InstructorId, MAX_ROBOTS, Reported, RobotId, Status};
use gestalt_strategies::Vocabulary;
use gestalt_trust::{Distrust, EvidenceError, Lie, RosterError};

const MAX_ERRORS: usize = 16;
const MAX_ERROR_LENGTH: usize = 400;

/// How many errors are logged in one such span; the status has the others too.
const MAX_LOGGED: u32 = 20;
const LOG_SPAN: Duration = Duration::from_secs(10);

/// The status of a robot, kept up to date from several threads.
#[derive(Debug)]
pub(super) struct Account {
    started: Instant,
    status: Mutex<Status>,
    /// Since when, and how many, errors were logged in the present span.
    logged: Mutex<(Instant, u32)>,
}

impl Account {
    pub(super) fn new(status: Status, started: Instant) -> Self {
        Self { started, status: Mutex::new(status), logged: Mutex::new((started, 0)) }
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, Status> {
        self.status.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The zero of the robot's own time.
    pub(super) fn started(&self) -> Instant {
        self.started
    }

    /// The robot judges with that model from now on.
    pub(super) fn judges_with(&self, vocabulary: &Vocabulary, model: String) {
        let mut status = self.lock();
        status.vocabulary = vocabulary.labels().to_vec();
        status.model = model;
    }

    /// Reports what Zenoh refused to send.
    pub(super) fn check(&self, put: zenoh::Result<()>) {
        if let Err(error) = put {
            self.error(&format!("Zenoh refused to send: {error}"));
        }
    }

    pub(super) fn sent(&self, kind: &str, bytes: usize) {
        self.message("sent", kind, bytes);
    }

    pub(super) fn received(&self, kind: &str, bytes: usize) {
        self.message("received", kind, bytes);
    }

    fn message(&self, verb: &str, kind: &str, bytes: usize) {
        let mut status = self.lock();
        add(&mut status.counters, format!("{verb}_{kind}"), 1);
        add(&mut status.counters, format!("{verb}_{kind}_bytes"), bytes as u64);
    }

    pub(super) fn count(&self, name: &str) {
        self.add(name, 1);
    }

    pub(super) fn add(&self, name: &str, amount: u64) {
        add(&mut self.lock().counters, name.to_owned(), amount);
    }

    /// Counts something that was refused, by cause, and names it among the latest errors, unless it is what always happens.
    pub(super) fn refused(&self, kind: &str, key: &str, bytes: usize, cause: &Refusal) {
        self.count(&format!("refused_{kind}_{}", cause.name()));
        if matches!(cause, Refusal::First) {
            return;
        }
        self.error(&format!("refused {bytes} bytes on {key}: {cause}"));
    }

    /// Another robot has this robot's id.
    pub(super) fn twin(&self) {
        self.count("twin");
        self.error(&Refusal::Twin.to_string());
    }

    /// A member is proven to lie. Counted once, however often it is told again.
    pub(super) fn convicted(&self, robot: RobotId, lie: Lie) {
        self.set(&conviction(robot), 1);
        self.error(&format!("robot {robot} {lie}; enrol it anew with a new key"));
    }

    /// The key that lied is none of a member any more: it has another one, or has left.
    pub(super) fn acquitted(&self, robot: RobotId) {
        self.lock().counters.remove(&conviction(robot));
    }

    /// Sets a counter that is kept elsewhere.
    pub(super) fn set(&self, name: &str, value: u64) {
        self.lock().counters.insert(name.to_owned(), value);
    }

    /// Whether one more error may be logged now: whoever can make a robot refuse something must not fill its disk.
    fn may_log(&self) -> bool {
        let mut logged = self.logged.lock().unwrap_or_else(PoisonError::into_inner);
        if logged.0.elapsed() >= LOG_SPAN {
            *logged = (Instant::now(), 0);
        }
        logged.1 = logged.1.saturating_add(1);
        logged.1 <= MAX_LOGGED
    }

    /// Puts an error among the latest; one that stands there already moves to the end. Part of it may be a stranger's own
    /// words: what controls a terminal is shown, not done.
    pub(super) fn error(&self, what: &str) {
        let shown = |c: char| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c };
        let what: String = what.chars().map(shown).take(MAX_ERROR_LENGTH).collect();
        let at_ms = u64::try_from(self.started.elapsed().as_millis()).unwrap_or(u64::MAX);
        let mut status = self.lock();
        let known = status.errors.iter().position(|error| error.what == what);
        if let Some(known) = known {
            status.errors.remove(known);
        } else if self.may_log() {
            tracing::warn!(robot = status.robot.0, "{what}");
        } else {
            add(&mut status.counters, "errors_not_logged".to_owned(), 1);
        }
        if status.errors.len() == MAX_ERRORS {
            status.errors.remove(0);
        }
        status.errors.push(Reported { at_ms, what });
    }
}

/// The counter that says that this robot lied with the key that it has.
fn conviction(robot: RobotId) -> String {
    format!("convicted_{robot}")
}

fn add(counters: &mut BTreeMap<String, u64>, name: String, amount: u64) {
    let counter = counters.entry(name).or_default();
    *counter = counter.saturating_add(amount);
}

/// Why something that arrived goes no further.
#[derive(Debug, thiserror::Error)]
pub(super) enum Refusal {
    #[error(transparent)]
    Bytes(#[from] DecodeError),
    #[error("a key that is none of this swarm's")]
    Key,
    #[error("the author is not the robot in the key")]
    Author,
    #[error("a message that does not belong on this key")]
    Kind,
    #[error("the queue is full; neighbours will repeat what matters")]
    Full,
    #[error("as many robots are there already as a swarm has at most: {MAX_ROBOTS}")]
    Crowd,
    #[error("another robot of the swarm has this robot's id: give each its own, then restart one")]
    Twin,
    #[error(transparent)]
    Distrust(#[from] Distrust),
    #[error(transparent)]
    Evidence(#[from] EvidenceError),
    #[error(transparent)]
    Roster(#[from] RosterError),
    #[error("the first of a camera, which has not heard yet what it is asked")]
    First,
    #[error(
        "two cameras stream as this robot, and the one that was started last is looked at: stop one, or give each an id of its own"
    )]
    TwoSenders,
    #[error("more of it than is looked into: it comes again")]
    TooOften,
    /// Answered, as what may not be said.
    #[error("'{0}' has a key: say it with that (--keys), or under another name")]
    HasKey(InstructorId),
}

impl Refusal {
    fn name(&self) -> &'static str {
        match self {
            Self::Bytes(DecodeError::Empty) => "empty",
            Self::Bytes(DecodeError::TooLong { .. }) => "too_long",
            Self::Bytes(DecodeError::Version { .. }) => "version",
            Self::Bytes(DecodeError::Malformed(_)) => "malformed",
            Self::Bytes(DecodeError::Trailing(_)) => "trailing",
            Self::Bytes(DecodeError::Impossible(_)) => "impossible",
            Self::Key => "key",
            Self::Author => "author",
            Self::Kind => "kind",
            Self::Full => "full",
            Self::Crowd => "too_many",
            Self::Twin => "twin",
            Self::Evidence(_) => "false",
            Self::Roster(RosterError::Older { .. }) => "older",
            Self::Roster(RosterError::OtherSwarm) => "other_swarm",
            Self::Roster(RosterError::Contradiction { .. }) => "contradiction",
            Self::Roster(RosterError::Forged) => "forged",
            Self::Roster(RosterError::TooFast) => "too_often",
            Self::Roster(_) => "malformed",
            Self::First => "unasked",
            Self::TwoSenders => "two_senders",
            Self::TooOften => "too_often",
            Self::HasKey(_) => "unsigned",
            Self::Distrust(cause) => cause.name().trim_start_matches("refused_"),
        }
    }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::RobotId;

    use super::*;

    fn account() -> Account {
        let status = Status::new(RobotId(1), "one".to_owned(), 1);
        Account::new(status, Instant::now())
    }

    #[test]
    fn the_errors_kept_are_the_latest_and_differ() {
        let account = account();
        for i in 0..40 {
            account.error(&format!("error {}", i % 20));
        }
        let status = account.lock();
        assert_eq!(status.errors.len(), MAX_ERRORS);
        assert_eq!(status.errors.last().unwrap().what, "error 19");
        account_is_distinct(&status);
    }

    #[test]
    fn a_flood_of_errors_is_not_logged_whole_and_controls_no_terminal() {
        let account = account();
        for i in 0..100 {
            account.error(&format!("refused \u{1b}[2J {i}"));
        }
        let status = account.lock();
        assert_eq!(status.counters["errors_not_logged"], 100 - u64::from(MAX_LOGGED));
        assert!(!status.errors.iter().any(|error| error.what.contains('\u{1b}')));
    }

    fn account_is_distinct(status: &Status) {
        for (i, error) in status.errors.iter().enumerate() {
            assert!(!status.errors[..i].iter().any(|other| other.what == error.what));
        }
    }

    #[test]
    fn a_refusal_is_counted_by_its_cause() {
        let account = account();
        account.refused("vote", "k", 3, &Refusal::Bytes(DecodeError::Version { found: 9 }));
        account.refused("vote", "k", 3, &Refusal::Bytes(DecodeError::Version { found: 9 }));
        assert_eq!(account.lock().counters["refused_vote_version"], 2);
    }
}
