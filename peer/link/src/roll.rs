//! The newest roster of a sealed swarm that a robot knows.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use gestalt_protocol::{InstructorId, RobotId};
use gestalt_trust::{Evidence, Judge, PublicKey, Roles, Roster, RosterError};
use tokio::sync::Notify;

use crate::account::Account;
use crate::tls::Door;

/// How much work rosters may be in each such span, in microseconds: a tenth of a core. Somebody may say so many that the authority's would find no time
/// left, so each costs what it is worth: what is no roster, or none that follows, nearly nothing.
const MAX_WORK: u64 = 10_000;
const SPAN: Duration = Duration::from_millis(100);
/// How much it takes to check a signature, and to read a kilobyte of JSON.
const CHECK: u64 = 100;
const READ: u64 = 10;

/// The folder beside a roster's file with the evidence against robots on it.
const CONVICTED: &str = "convicted";

/// The newest roster that a robot knows.
pub(crate) struct Roll {
    me: RobotId,
    key: PublicKey,
    door: Arc<Door>,
    account: Arc<Account>,
    file: Option<PathBuf>,
    held: Mutex<Held>,
    worked: Mutex<(Instant, u64)>,
    news: Notify,
}

struct Held {
    roster: Roster,
    json: Arc<str>,
}

impl Held {
    fn new(roster: Roster) -> Self {
        Self { json: roster.to_json().into(), roster }
    }
}

impl Roll {
    pub fn new(
        me: RobotId,
        key: PublicKey,
        roster: Roster,
        file: Option<PathBuf>,
        account: Arc<Account>,
    ) -> Self {
        account.set("roster_epoch", roster.members().epoch);
        let door = Arc::new(Door::new(roster.clone()));
        let worked = Mutex::new((Instant::now(), 0));
        Self {
            me,
            key,
            door,
            account,
            file,
            held: Mutex::new(Held::new(roster)),
            worked,
            news: Notify::new(),
        }
    }

    /// Who is let in by it.
    pub fn door(&self) -> Arc<Door> {
        self.door.clone()
    }

    fn held(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether those bytes are the roster held: then they need no look.
    pub fn is_held(&self, json: &[u8]) -> bool {
        self.held().json.as_bytes() == json
    }

    /// Whether one of that length may be read now.
    pub fn may_read(&self, length: usize) -> bool {
        self.may_work(1 + READ * length as u64 / 1024)
    }

    fn may_work(&self, work: u64) -> bool {
        let mut worked = self.worked.lock().unwrap_or_else(PoisonError::into_inner);
        if worked.0.elapsed() >= SPAN {
            *worked = (Instant::now(), 0);
        }
        let may = worked.1 + work <= MAX_WORK;
        worked.1 += if may { work } else { 0 };
        may
    }

    /// Goes by a roster that came from anywhere, if it follows the one held; the robots that have no key on it any more, or another one.
    ///
    /// # Errors
    /// [`RosterError`]; the one held stays.
    pub fn take_up(&self, judge: &mut Judge, json: &[u8]) -> Result<Option<BTreeSet<RobotId>>, RosterError> {
        let Some(next) = judge.roster().successor_if(json, || self.may_work(CHECK))? else { return Ok(None) };
        let before = judge.roster().members().robots.clone();
        judge.adopt(next.clone())?;
        let members = next.members();
        let gone = before.iter().filter(|(robot, key)| members.robots.get(robot) != Some(key));
        let gone = gone.map(|(robot, _)| *robot).collect();
        self.account.set("roster_epoch", members.epoch);
        if members.robots.get(&self.me) != Some(&self.key) {
            self.account.count("expelled");
            self.account.error(&format!(
                "the roster of epoch {} does not have this robot with its key: nothing it says counts any more; enrol it anew, or start it with the \
                 key that it was given",
                members.epoch
            ));
        }
        self.door.follow(next.clone());
        *self.held() = Held::new(next);
        self.news.notify_one();
        Ok(Some(gone))
    }

    /// What somebody of that name may do here without a key; and whether one of that name has a key, and speaks for themselves.
    pub fn local_roles(&self, by: &InstructorId) -> (Roles, bool) {
        let held = self.held();
        let members = held.roster.members();
        (members.local, members.instructors.contains_key(by))
    }

    /// A link to a robot has come, or evidence that is to be kept.
    pub fn meet(&self) {
        self.news.notify_one();
    }

    /// Waits until there is a newer roster, or somebody to tell of it.
    pub async fn news(&self) {
        self.news.notified().await;
    }

    /// The epoch of the roster held, and its JSON.
    pub fn newest(&self) -> (u64, Arc<str>) {
        let held = self.held();
        (held.roster.members().epoch, held.json.clone())
    }

    /// Writes the roster held to its file: a robot that starts again must not go back to an older one.
    pub async fn keep(&self) {
        let Some(file) = self.file.clone() else { return };
        let roster = self.held().roster.clone();
        let write = move || match roster.write(&file) {
            // Of a robot that shares the folder, or of the authority itself, which were quicker.
            Err(RosterError::Older { .. }) => Ok(()),
            written => written,
        };
        self.write("the new roster is gone by", write).await;
    }

    /// Writes evidence to the folder beside the roster: a robot that starts again must not believe again who was convicted.
    pub async fn keep_evidence(&self, evidence: Vec<(RobotId, Evidence)>) {
        let Some(folder) = self.convicted() else { return };
        let write = move || evidence.iter().try_for_each(|(robot, evidence)| evidence.keep(&folder, *robot));
        self.write("who was convicted counts no more", write).await;
    }

    /// The evidence that was kept before.
    pub fn kept_evidence(&self) -> Vec<Evidence> {
        let Some(folder) = self.convicted() else { return Vec::new() };
        Evidence::kept_in(&folder).unwrap_or_else(|error| {
            let folder = folder.display();
            self.account.error(&format!("who was convicted before is not known: {folder}: {error}"));
            Vec::new()
        })
    }

    fn convicted(&self) -> Option<PathBuf> {
        Some(self.file.as_ref()?.with_file_name(CONVICTED))
    }

    async fn write<E: ToString + Send + 'static>(
        &self,
        done: &str,
        write: impl FnOnce() -> Result<(), E> + Send + 'static,
    ) {
        let failed = match tokio::task::spawn_blocking(write).await {
            Ok(Ok(())) => return,
            Ok(Err(error)) => error.to_string(),
            Err(error) => error.to_string(),
        };
        self.account.error(&format!("{done}, but that is not kept: {failed}"));
    }
}
