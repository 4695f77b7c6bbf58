//! Tells a swarm that runs of its next roster, and waits until its robots go by it.

use std::collections::BTreeSet;
use std::path::Path;
use std::time::{Duration, Instant};

use gestalt_link::{Client, Credentials, Heard, LinkConfig, News, Scouting};
use gestalt_protocol::{RobotId, Status};
use gestalt_trust::Roster;
use thiserror::Error;

use super::super::{Failure, show};
use super::folder::Authority;

/// How long robots may take to go by a roster.
const PATIENCE: Duration = Duration::from_secs(5);

/// How often it is said again to those that do not go by it yet.
const AGAIN: Duration = Duration::from_millis(250);

/// Where the swarm runs.
#[derive(Debug, clap::Args)]
pub(super) struct Tell {
    /// Endpoint of a robot of the running swarm, `tls/192.168.1.5:7447`; repeatable
    #[arg(short = 'e', long, value_name = "ENDPOINT")]
    connect: Vec<String>,
}

impl Tell {
    /// Tells the swarm if it was said where it runs, or else says how to.
    ///
    /// # Errors
    /// As [`Tell::now`].
    pub fn if_named(&self, folder: &Path, authority: &Authority, roster: &Roster) -> Result<(), Failure> {
        if !self.connect.is_empty() {
            return self.now(authority, roster);
        }
        eprintln!(
            "robots that were enrolled before hold an older roster: once they run, gestalt trust tell {}",
            folder.display()
        );
        Ok(())
    }

    /// Tells the swarm; one that was not named is looked for.
    ///
    /// # Errors
    /// A swarm that cannot be reached, and robots that do not go by the roster in time.
    pub fn now(&self, authority: &Authority, roster: &Roster) -> Result<(), Failure> {
        let credentials = Credentials::of_authority(authority.identity(), roster)?;
        let scouting = self.connect.is_empty().then(Scouting::default);
        let link = LinkConfig {
            connect: self.connect.clone(),
            scouting,
            credentials: Some(credentials),
            ..LinkConfig::default()
        };
        super::super::runtime()?.block_on(async {
            let client = Client::open(&roster.members().swarm, &link).await.map_err(|error| {
                format!("the roster is written, but no robot was told: {error}; say it again with `gestalt trust tell` and the endpoint of one (-e), or by starting one with it")
            })?;
            let told = told(&client, roster).await;
            client.close().await;
            told
        })
    }
}

/// Robots that will never go by the roster they are told. They go on as before.
#[derive(Debug, PartialEq, Error)]
enum Refused {
    #[error(
        "robots {} go by epoch {held}, and refused epoch {told}: nothing was changed there. This folder is an older copy: do it again in the one \
         with the newest roster",
        show::robots(robots)
    )]
    Older { robots: BTreeSet<RobotId>, held: u64, told: u64 },
    #[error(
        "robots {} go by another roster of epoch {told}, and refused this one: nothing was changed there. This folder and another were changed \
         apart: do it again in the one whose roster they go by, and use that alone",
        show::robots(robots)
    )]
    Contradicts { robots: BTreeSet<RobotId>, told: u64 },
}

/// How far a roster has come among its robots.
#[derive(Debug, PartialEq)]
struct Progress {
    /// They go by it.
    done: BTreeSet<RobotId>,
    /// They do not yet.
    left: BTreeSet<RobotId>,
    /// They are alive, and do not say.
    silent: BTreeSet<RobotId>,
}

impl Progress {
    /// Whether all that are there go by it.
    fn is_complete(&self) -> bool {
        self.left.is_empty() && self.silent.is_empty() && !self.done.is_empty()
    }

    /// What is still to be done, when it was waited for long enough.
    fn missing(&self) -> String {
        let named = |robots: &BTreeSet<RobotId>, what: &str| {
            (!robots.is_empty()).then(|| format!("robots {} {what}", show::robots(robots)))
        };
        let left = named(
            &self.left,
            "do not go by it yet: they are told by their neighbours as soon as they can be reached",
        );
        let silent = named(
            &self.silent,
            "are alive and did not answer whether they go by it: if they run, `gestalt trust tell` says it again",
        );
        let missing: Vec<String> = left.into_iter().chain(silent).collect();
        if missing.is_empty() {
            return "the roster is written, but no robot answered: is one running there? `gestalt trust tell` says it again".to_owned();
        }
        format!("the roster is written, but {}", missing.join("; "))
    }
}

/// How far that roster has come among its robots that answered or are alive. Who is no member any more need not agree.
fn judge(statuses: &[Status], alive: &BTreeSet<RobotId>, roster: &Roster) -> Result<Progress, Refused> {
    let told = roster.members().epoch;
    let members = statuses.iter().filter(|status| roster.members().robots.contains_key(&status.robot));
    let held = members.map(|status| {
        let counter = |name| status.counters.get(name).copied();
        (status.robot, counter("roster_epoch"), counter("roster_checksum"))
    });
    let held: Vec<_> = held.collect();
    if let Some(newest) = held.iter().filter_map(|(_, epoch, _)| *epoch).max().filter(|epoch| *epoch > told) {
        let robots = held.iter().filter(|(_, epoch, _)| *epoch > Some(told)).map(|(robot, ..)| *robot);
        return Err(Refused::Older { robots: robots.collect(), held: newest, told });
    }
    // Robots of earlier releases report no checksum.
    let is_other = |sum: Option<u64>| sum.is_some_and(|sum| sum != u64::from(roster.checksum()));
    let others = held.iter().filter(|(_, epoch, sum)| *epoch == Some(told) && is_other(*sum));
    let robots: BTreeSet<RobotId> = others.map(|(robot, ..)| *robot).collect();
    if !robots.is_empty() {
        return Err(Refused::Contradicts { robots, told });
    }
    let answered: BTreeSet<RobotId> = held.iter().map(|(robot, ..)| *robot).collect();
    let silent = alive.difference(&answered).copied();
    let silent = silent.filter(|robot| roster.members().robots.contains_key(robot)).collect();
    let (done, left): (Vec<_>, Vec<_>) = held.into_iter().partition(|(_, epoch, _)| *epoch == Some(told));
    let robots = |of: Vec<(RobotId, _, _)>| of.into_iter().map(|(robot, ..)| robot).collect();
    Ok(Progress { done: robots(done), left: robots(left), silent })
}

/// Takes in for a while which robots come and go; those that were there are the first that come.
async fn follow(news: &mut News, alive: &mut BTreeSet<RobotId>, pause: Duration) {
    let follow = async {
        while let Some(heard) = news.next().await {
            note(alive, &heard);
        }
        // The session has ended: the next question says so.
        std::future::pending().await
    };
    let _: Result<(), _> = tokio::time::timeout(pause, follow).await;
}

fn note(alive: &mut BTreeSet<RobotId>, heard: &Heard) {
    match heard {
        Heard::Came(robot) => {
            alive.insert(*robot);
        }
        Heard::Left(robot) => {
            alive.remove(robot);
        }
        Heard::Decided(_) | Heard::Held(..) | Heard::Asked(_) => {}
    }
}

async fn told(client: &Client, roster: &Roster) -> Result<(), Failure> {
    let (began, epoch) = (Instant::now(), roster.members().epoch);
    let (mut news, mut alive) = (client.news().await?, BTreeSet::new());
    loop {
        client.tell_roster(roster).await?;
        follow(&mut news, &mut alive, AGAIN).await;
        let progress = judge(&client.statuses(super::super::ANSWER).await?, &alive, roster)?;
        if progress.is_complete() {
            return super::say(&format!(
                "epoch {epoch} is gone by at robots {} after {:.1} s",
                show::robots(&progress.done),
                began.elapsed().as_secs_f64()
            ));
        }
        if began.elapsed() > PATIENCE {
            return Err(progress.missing().into());
        }
    }
}

#[cfg(test)]
mod tests {
    use gestalt_trust::{Identity, Membership};

    use super::*;

    fn roster(robots: &[u32]) -> Roster {
        let key = |number: u32| Identity::<gestalt_trust::Ed25519>::from_bytes(&[number as u8; 32]);
        let robots = robots.iter().map(|robot| (RobotId(*robot), key(*robot).public_key())).collect();
        let members = Membership { swarm: "demo".to_owned(), epoch: 4, robots, ..Membership::default() };
        members.sign(&key(100)).unwrap()
    }

    fn status(robot: u32, epoch: u64, checksum: Option<u32>) -> Status {
        let mut status = Status::new(RobotId(robot), "demo".to_owned(), 1);
        status.counters.insert("roster_epoch".to_owned(), epoch);
        status.counters.extend(checksum.map(|sum| ("roster_checksum".to_owned(), sum.into())));
        status
    }

    fn set(robots: &[u32]) -> BTreeSet<RobotId> {
        robots.iter().copied().map(RobotId).collect()
    }

    #[test]
    fn robots_that_refused_a_roster_do_not_go_by_it() {
        let told = roster(&[1, 2]);
        let sum = Some(told.checksum());
        let of = |first, second| judge(&[first, second, status(3, 9, None)], &set(&[1, 2, 3]), &told);
        let progress =
            |done: &[u32], left: &[u32]| Ok(Progress { done: set(done), left: set(left), silent: set(&[]) });
        assert_eq!(of(status(1, 4, sum), status(2, 3, Some(7))), progress(&[1], &[2]));
        assert_eq!(of(status(1, 4, sum), status(2, 4, None)), progress(&[1, 2], &[]));
        let newer = of(status(1, 4, sum), status(2, 5, Some(7)));
        assert_eq!(newer, Err(Refused::Older { robots: set(&[2]), held: 5, told: 4 }));
        let words = newer.unwrap_err().to_string();
        assert!(words.contains("robots 2 go by epoch 5") && words.contains("older copy"), "{words}");
        let other = Some(roster(&[1, 2, 3]).checksum());
        let contradicts = of(status(1, 4, other), status(2, 4, other));
        assert_eq!(contradicts, Err(Refused::Contradicts { robots: set(&[1, 2]), told: 4 }));
    }
    #[test]
    fn a_member_that_is_alive_and_does_not_answer_is_waited_for_and_named() {
        let told = roster(&[1, 2, 5]);
        let sum = Some(told.checksum());
        let mut alive = BTreeSet::new();
        // Robot 3 is a member no more; robot 5 is off.
        for robot in [1, 2, 3] {
            note(&mut alive, &Heard::Came(RobotId(robot)));
        }
        let quiet = judge(&[status(1, 4, sum)], &alive, &told).unwrap();
        assert_eq!(quiet, Progress { done: set(&[1]), left: set(&[]), silent: set(&[2]) });
        assert!(!quiet.is_complete());
        let words = quiet.missing();
        assert!(
            words.contains("robots 2 are alive and did not answer") && !words.contains("robots 1"),
            "{words}"
        );
        let both = judge(&[status(1, 3, Some(7))], &alive, &told).unwrap().missing();
        assert!(
            both.contains("robots 1 do not go by it yet") && both.contains("robots 2 are alive"),
            "{both}"
        );
        note(&mut alive, &Heard::Left(RobotId(2)));
        assert!(judge(&[status(1, 4, sum)], &alive, &told).unwrap().is_complete());
        assert!(judge(&[], &set(&[]), &told).unwrap().missing().contains("no robot answered"));
    }
}
