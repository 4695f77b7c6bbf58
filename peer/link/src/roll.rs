//! The newest roster of a sealed swarm that a robot knows.

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use gestalt_protocol::{InstructorId, RobotId};
use gestalt_trust::{Evidence, Judge, PublicKey, Roles, Roster, RosterError};
use tokio::sync::watch;

use crate::account::Account;
use crate::tls::Door;

/// How much work rosters may be in each such span, in microseconds: a tenth of a core. Somebody may say so many that the authority's would find no time
/// left, so each costs what it is worth: what is no roster, or none that follows, nearly nothing. What is much longer than the roster held has a
/// budget of its own, as large: to say that it is none it has to be read.
const MAX_WORK: u64 = 10_000;
const SPAN: Duration = Duration::from_millis(100);
/// The longest that counts as no longer than the roster held: so many of its lengths, and so many bytes.
const USUAL: (usize, usize) = (2, 4096);
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
    first: u64,
    usual: Allowance,
    long: Allowance,
    news: watch::Sender<()>,
}

/// The work done in one span.
struct Allowance(Mutex<(Instant, u64)>);

impl Allowance {
    fn new() -> Self {
        Self(Mutex::new((Instant::now(), 0)))
    }

    /// Whether there is so much left of it, which is then taken.
    fn take(&self, work: u64) -> bool {
        let mut worked = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if worked.0.elapsed() >= SPAN {
            *worked = (Instant::now(), 0);
        }
        let may = worked.1 + work <= MAX_WORK;
        worked.1 += if may { work } else { 0 };
        may
    }
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
        let first = roster.members().epoch;
        report(&account, &roster);
        let door = Arc::new(Door::new(roster.clone()));
        Self {
            me,
            key,
            door,
            account,
            file,
            held: Mutex::new(Held::new(roster)),
            first,
            usual: Allowance::new(),
            long: Allowance::new(),
            news: watch::Sender::new(()),
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
        self.allowance(length).take(1 + READ * length as u64 / 1024)
    }

    /// What rosters of that length are taken out of.
    fn allowance(&self, length: usize) -> &Allowance {
        let (times, more) = USUAL;
        if length <= times * self.held().json.len() + more { &self.usual } else { &self.long }
    }

    /// Goes by a roster that came from anywhere, if it follows the one held; the robots that have no key on it any more, or another one.
    ///
    /// # Errors
    /// [`RosterError`]; the one held stays.
    pub fn take_up(&self, judge: &mut Judge, json: &[u8]) -> Result<Option<BTreeSet<RobotId>>, RosterError> {
        let may_check = || self.allowance(json.len()).take(CHECK);
        let Some(next) = judge.roster().successor_if(json, may_check)? else { return Ok(None) };
        let before = judge.roster().members().robots.clone();
        judge.adopt(next.clone())?;
        let members = next.members();
        let gone = before.iter().filter(|(robot, key)| members.robots.get(robot) != Some(key));
        let gone: BTreeSet<RobotId> = gone.map(|(robot, _)| *robot).collect();
        // The status is told as the judge is, which has just forgotten them: nobody convicts in between.
        gone.iter().for_each(|robot| self.account.acquitted(*robot));
        report(&self.account, &next);
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
        self.news.send_replace(());
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
        self.news.send_replace(());
    }

    /// Changes when there is a newer roster, somebody to tell of it, or evidence that is to be kept.
    pub fn news(&self) -> watch::Receiver<()> {
        self.news.subscribe()
    }

    /// The epoch of the roster held, and its JSON.
    pub fn newest(&self) -> (u64, Arc<str>) {
        let held = self.held();
        (held.roster.members().epoch, held.json.clone())
    }

    /// The epoch of the roster that this robot started with.
    pub fn first(&self) -> u64 {
        self.first
    }

    /// Writes the roster held to its file: a robot that starts again must not go back to an older one. Says whether it is there now.
    pub async fn keep(&self) -> bool {
        let Some(file) = self.file.clone() else { return true };
        let roster = self.held().roster.clone();
        let write = move || match roster.write(&file) {
            // Of a robot that shares the folder, or of the authority itself, which were quicker.
            Err(RosterError::Older { .. }) => Ok(()),
            written => written,
        };
        self.write("the new roster is gone by", "roster_unkept", write).await
    }

    /// Writes evidence to the folder beside the roster: a robot that starts again must not believe again who was convicted. Says whether it is there now.
    pub async fn keep_evidence(&self, evidence: Vec<(RobotId, Evidence)>) -> bool {
        let Some(folder) = self.convicted() else { return true };
        // One that cannot be written keeps no other off the disk.
        let write = move || {
            let mut all = Ok(());
            for (robot, evidence) in &evidence {
                all = all.and(evidence.keep(&folder, *robot));
            }
            all
        };
        self.write("who was convicted counts no more", "evidence_unkept", write).await
    }

    /// The evidence that was kept before.
    pub fn kept_evidence(&self) -> Vec<Evidence> {
        let Some(folder) = self.convicted() else { return Vec::new() };
        let unknown = |path: &Path, error: &io::Error| {
            self.account
                .error(&format!("who was convicted before is not known: {}: {error}", path.display()));
        };
        match Evidence::kept_in(&folder) {
            Ok(kept) => {
                kept.unread.iter().for_each(|(path, error)| unknown(path, error));
                kept.evidence
            }
            Err(error) => {
                unknown(&folder, &error);
                Vec::new()
            }
        }
    }

    fn convicted(&self) -> Option<PathBuf> {
        Some(self.file.as_ref()?.with_file_name(CONVICTED))
    }

    /// `unkept` in the status is 1 for as long as it cannot be written; that is said once.
    async fn write<E: ToString + Send + 'static>(
        &self,
        done: &str,
        unkept: &str,
        write: impl FnOnce() -> Result<(), E> + Send + 'static,
    ) -> bool {
        let failed = match tokio::task::spawn_blocking(write).await {
            Ok(Ok(())) => None,
            Ok(Err(error)) => Some(error.to_string()),
            Err(error) => Some(error.to_string()),
        };
        let is_kept = failed.is_none();
        let before = self.account.lock().counters.get(unkept).copied().unwrap_or(0);
        match failed {
            None if before == 0 => {}
            None => self.account.set(unkept, 0),
            Some(_) if before != 0 => {}
            Some(failed) => {
                self.account.set(unkept, 1);
                self.account.error(&format!("{done}, but that is not kept, and is tried again: {failed}"));
            }
        }
        is_kept
    }
}

/// Says in the status which roster is gone by: by its epoch, and by what tells two of one epoch apart, which stands there first.
fn report(account: &Account, roster: &Roster) {
    account.set("roster_checksum", roster.checksum().into());
    account.set("roster_epoch", roster.members().epoch);
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::Status;
    use gestalt_trust::{Identity, Lie, Membership};

    use super::*;

    fn roster(epoch: u64, by: u8) -> Roster {
        let key = |number| Identity::from_bytes(&[number; 32]);
        let robots = [(RobotId(1), key(1).public_key())].into();
        let members = Membership { swarm: "demo".to_owned(), epoch, robots, ..Membership::default() };
        members.sign(&key(by)).unwrap()
    }

    fn roll() -> (Roll, Judge) {
        let held = roster(1, 100);
        let key = held.members().robots[&RobotId(1)];
        let status = Status::new(RobotId(1), "demo".to_owned(), 1);
        let account = Arc::new(Account::new(status, Instant::now()));
        (Roll::new(RobotId(1), key, held.clone(), None, account), Judge::new(held, |_| false))
    }

    #[test]
    fn what_is_no_roster_keeps_no_roster_from_being_taken_up() {
        let ((roll, mut judge), next) = (roll(), roster(2, 100).to_json());
        let mut forged = roster(2, 100).to_json();
        let digit = forged.rfind(|digit: char| digit.is_ascii_digit()).unwrap();
        forged.replace_range(digit..=digit, if &forged[digit..=digit] == "1" { "2" } else { "1" });
        // In a tenth of a second: junk, rosters that follow none, and some that somebody made up.
        for _ in 0..1000 {
            assert!(roll.may_read(1) && roll.take_up(&mut judge, b"x").is_err());
        }
        // As much of what is too long to be read as there may be.
        while roll.may_read(500 * 1024) || roll.may_read(64 * 1024) {}
        let older = roster(1, 101).to_json();
        for _ in 0..50 {
            assert!(roll.may_read(older.len()) && roll.take_up(&mut judge, older.as_bytes()).is_err());
            assert!(roll.may_read(forged.len()) && roll.take_up(&mut judge, forged.as_bytes()).is_err());
        }
        assert!(roll.may_read(next.len()));
        assert!(roll.take_up(&mut judge, next.as_bytes()).unwrap().is_some());
        assert_eq!(roll.newest().0, 2);
    }

    #[test]
    fn who_has_another_key_or_has_left_is_no_liar_any_more() {
        let key = |number| Identity::from_bytes(&[number; 32]).public_key();
        let with = |epoch, robots: &[(u32, u8)]| {
            let robots = robots.iter().map(|(robot, number)| (RobotId(*robot), key(*number)));
            Membership { epoch, robots: robots.collect(), ..roster(epoch, 100).members().clone() }
                .sign(&Identity::from_bytes(&[100; 32]))
                .unwrap()
        };
        let (roll, _) = roll();
        let mut judge = Judge::new(with(1, &[(1, 1), (2, 2), (3, 3)]), |_| false);
        (2..=3).for_each(|robot| roll.account.convicted(RobotId(robot), Lie::Unfounded));
        let convicted = || -> Vec<String> {
            let counters = roll.account.lock().counters.clone();
            counters
                .into_keys()
                .filter_map(|name| Some(name.strip_prefix("convicted_")?.to_owned()))
                .collect()
        };
        let mut follow = |next: Roster| -> Vec<String> {
            roll.take_up(&mut judge, next.to_json().as_bytes()).unwrap();
            convicted()
        };
        assert_eq!(follow(with(2, &[(1, 1), (2, 2), (3, 3), (4, 4)])), ["2", "3"], "they have their keys");
        assert_eq!(follow(with(3, &[(1, 1), (2, 2), (3, 9), (4, 4)])), ["2"]);
        // By its new key it can lie again.
        roll.account.convicted(RobotId(3), Lie::Unfounded);
        assert_eq!(follow(with(4, &[(1, 1), (3, 9), (4, 4)])), ["3"]);
    }

    #[tokio::test]
    async fn what_cannot_be_written_is_known_as_such_until_it_is() {
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("full");
        let (mut roll, _) = roll();
        roll.file = Some(folder.join("roster.json"));
        let unkept = |roll: &Roll| roll.account.lock().counters.get("roster_unkept").copied();
        assert!(!roll.keep().await && !roll.keep().await);
        assert_eq!((unkept(&roll), roll.account.lock().errors.len()), (Some(1), 1), "said once");
        std::fs::create_dir(&folder).unwrap();
        assert!(roll.keep().await && folder.join("roster.json").exists());
        assert_eq!(unkept(&roll), Some(0));
    }

    #[test]
    fn no_more_is_looked_into_than_a_tenth_of_a_core_can() {
        let (roll, _) = roll();
        let began = Instant::now();
        let read = (0..100_000).filter(|_| roll.may_read(100 * 1024)).count() as u64;
        let spans = 1 + began.elapsed().as_millis() as u64 / 100;
        assert!((1..=(1 + spans) * (MAX_WORK / (READ * 100))).contains(&read), "{read}");
    }
}
