//! `gestalt watch`: decisions and robots of a running swarm, live.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use gestalt_protocol::Heeded;
use serde_json::json;
use tokio::time::MissedTickBehavior;

use super::config_args::ConfigArgs;
use super::foxglove::FoxgloveArgs;
use super::robots::table;
use super::show::{self, Names, clean, line};
use super::web::{self, WebArgs};
use super::{Failure, interrupted};
use crate::doctor::swarm::NOBODY_ANSWERS;
use gestalt_desk::{Event, View};
use gestalt_link::{Client, News};

/// How long a swarm that is there takes at most until it is heard of.
const SILENCE: Duration = Duration::from_secs(3);

/// Attach to a swarm and print its decisions, and robots joining and leaving, until Ctrl-C
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt watch -e tcp/192.168.1.5:7447 --web --foxglove
  gestalt watch --robots")]
pub struct Args {
    #[command(flatten)]
    config: ConfigArgs,

    /// Stop after this many decisions; 0: never
    #[arg(long, value_name = "N")]
    count: Option<u64>,

    /// Print the status of each robot once and exit
    #[arg(long, conflicts_with_all = ["web", "foxglove"])]
    status: bool,

    /// Show a table of all robots, refreshed every second: source, frames per second, latency, motion, opinion
    #[arg(long, conflicts_with_all = ["status", "count", "web", "foxglove"])]
    robots: bool,

    #[command(flatten)]
    web: WebArgs,

    #[command(flatten)]
    foxglove: FoxgloveArgs,

    /// Print JSON Lines, one object per line
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
///
/// # Errors
/// When no robot is reached, none gives its status, or the session breaks.
pub fn run(args: &Args) -> Result<(), Failure> {
    let (swarm, link) = args.config.client()?;
    super::runtime()?.block_on(async {
        let client = Client::open(&swarm, &link).await?;
        let nobody = nobody(&swarm, link.credentials.is_some());
        if args.status {
            statuses(args.json, &nobody, &client).await?;
        } else if args.robots {
            tokio::select! {
                () = interrupted() => {}
                shown = robots(args.json, &client) => shown?,
            }
        } else {
            let mut news = client.news().await?;
            let page = args.web.open(&swarm, &link).await?;
            if let Some(page) = &page {
                web::say_where(page, args.json)?;
            }
            let foxglove = args.foxglove.open(&swarm, &link, args.json).await?;
            tokio::select! {
                () = interrupted() => {}
                watched = watch(args, &nobody, &client, &mut news) => watched?,
            }
            if let Some(page) = page {
                page.close().await;
            }
            if let Some(foxglove) = foxglove {
                FoxgloveArgs::close(foxglove, args.json).await?;
            }
        }
        client.close().await;
        Ok(())
    })
}

async fn watch(args: &Args, nobody: &str, client: &Client, news: &mut News) -> Result<(), Failure> {
    let (mut view, began) = (View::default(), Instant::now());
    let mut names = Names::default();
    let mut decisions = 0;
    let mut next = match tokio::time::timeout(SILENCE, news.next()).await {
        Ok(heard) => heard,
        Err(_) => {
            eprintln!("{nobody}");
            news.next().await
        }
    };
    while let Some(heard) = next {
        match view.hear(began.elapsed(), heard.into()) {
            Some(Event::Decided(it)) => {
                if !args.json && !names.cover(&it.decision) {
                    names = Names::reported(&client.statuses(super::ANSWER).await?);
                }
                let words = show::announced(&it, &names);
                line(args.json, &json!({"event": "decision", "decision": it}), &words)?;
                decisions += 1;
                if is_last(decisions, args.count) {
                    break;
                }
            }
            Some(Event::Came(robot)) => {
                line(args.json, &json!({"event": "came", "robot": robot}), &format!("robot {robot} joined"))?;
            }
            Some(Event::Left(robot)) => {
                line(args.json, &json!({"event": "left", "robot": robot}), &format!("robot {robot} left"))?;
            }
            Some(Event::Question(question)) => {
                let words = show::question(&question);
                line(args.json, &json!({"event": "question", "question": question}), &words)?;
            }
            // What each robot holds is in the decision's own message already.
            Some(Event::Answered(_)) | None => {}
        }
        if super::is_unread() {
            break;
        }
        next = news.next().await;
    }
    Ok(())
}

/// Whether so many decisions are all that are wanted.
fn is_last(decisions: u64, count: Option<u64>) -> bool {
    count.is_some_and(|count| count > 0 && decisions >= count)
}

/// Why there may be nobody to hear of: a swarm of another name is as silent as one that is off, and so is one that lets nobody in.
pub(super) fn nobody(swarm: &str, is_sealed: bool) -> String {
    let off_the_roster = match is_sealed {
        true => {
            "; or this client is not on the roster any more: gestalt trust roster says who is, where its authority is"
        }
        false => "",
    };
    format!(
        "no robot of the swarm \"{swarm}\" is heard of: {NOBODY_ANSWERS}{off_the_roster}; 'gestalt doctor' looks for it"
    )
}

/// Shows how all robots are, again and again.
async fn robots(as_json: bool, client: &Client) -> Result<(), Failure> {
    let on_screen = !as_json && std::io::stdout().is_terminal();
    let mut seconds = tokio::time::interval(Duration::from_secs(1));
    seconds.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        seconds.tick().await;
        let statuses = client.statuses(super::ANSWER).await?;
        if super::is_unread() {
            return Ok(());
        }
        if as_json {
            line(true, &json!({"event": "robots", "robots": statuses}), "")?;
            continue;
        }
        // On a screen each table takes the place of the one before: to the top, and clear below it.
        let mut shown = if on_screen { "\x1b[H\x1b[J".to_owned() } else { String::new() };
        shown.push_str(&table(&statuses, true).join("\n"));
        super::say(&format!("{shown}\n{}", if on_screen { "" } else { "\n" }))?;
    }
}

async fn statuses(as_json: bool, nobody: &str, client: &Client) -> Result<(), Failure> {
    let statuses = client.statuses(super::ANSWER).await?;
    if statuses.is_empty() {
        return Err(nobody.into());
    }
    for (status, camera) in statuses.iter().zip(table(&statuses, false)) {
        let state = match (status.round, status.open) {
            (Some(round), true) => format!("round {} open", round.counter),
            (Some(round), false) => format!("round {} closed", round.counter),
            (None, _) => "no round yet".to_owned(),
        };
        let mut words = format!(
            "{camera}  model: {}, {state}, linked to {}, {} alive",
            clean(&status.model),
            show::robots(&status.neighbours),
            status.alive.len()
        );
        if let Some(learning) = &status.learning {
            let total = |classes: &[usize]| classes.iter().sum::<usize>();
            words.push_str(&format!(
                ", samples: {} personal, {} shared, {} external, at most {} (common knowledge {}; memory: {})",
                total(&learning.personal),
                total(&learning.shared),
                total(&learning.external),
                learning.capacity,
                learning.common,
                clean(&learning.memory)
            ));
            for Heeded { robot, held, trained } in &learning.doubted {
                words.push_str(&format!(
                    ", trains on {trained} of {held} samples of robot {robot}, which it doubts"
                ));
            }
        }
        if let Some(error) = status.errors.last() {
            words.push_str(&format!(", last error: {}", clean(&error.what)));
        }
        line(as_json, &serde_json::to_value(status)?, &words)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_decision_is_the_last_of_none() {
        assert!(is_last(1, Some(1)) && !is_last(1, Some(2)));
        assert!(!is_last(1, Some(0)) && !is_last(1, None), "never");
    }
}
