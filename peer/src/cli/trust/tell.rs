//! Tells a swarm that runs of its next roster, and waits until its robots go by it.

use std::path::Path;
use std::time::{Duration, Instant};

use gestalt_link::{Client, Credentials, LinkConfig, Scouting};
use gestalt_protocol::{RobotId, Status};
use gestalt_trust::Roster;

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

async fn told(client: &Client, roster: &Roster) -> Result<(), Failure> {
    let (began, epoch) = (Instant::now(), roster.members().epoch);
    loop {
        client.tell_roster(roster).await?;
        tokio::time::sleep(AGAIN).await;
        let mut statuses = client.statuses(super::super::ANSWER).await?;
        // Who is no member any more need not agree.
        statuses.retain(|status| roster.members().robots.contains_key(&status.robot));
        let (done, left): (Vec<&Status>, Vec<&Status>) = statuses
            .iter()
            .partition(|status| status.counters.get("roster_epoch").is_some_and(|held| *held >= epoch));
        let robots = |of: &[&Status]| {
            let ids: std::collections::BTreeSet<RobotId> = of.iter().map(|status| status.robot).collect();
            show::robots(&ids)
        };
        if left.is_empty() && !done.is_empty() {
            return super::say(&format!(
                "epoch {epoch} is gone by at robots {} after {:.1} s",
                robots(&done),
                began.elapsed().as_secs_f64()
            ));
        }
        if began.elapsed() > PATIENCE {
            return Err(match left.is_empty() {
                true => "the roster is written, but no robot answered: is one running there? `gestalt trust tell` says it again".to_owned(),
                false => format!(
                    "the roster is written, but robots {} do not go by it yet: they are told by their neighbours as soon as they can be reached",
                    robots(&left)
                ),
            }
            .into());
        }
    }
}
