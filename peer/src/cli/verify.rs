//! `gestalt verify`: whether a decision was really made.

use std::io::Read;
use std::path::{Path, PathBuf};

use gestalt_protocol::MAX_JSON;
use gestalt_trust::MAX_ROSTER;
use serde_json::json;

use super::Failure;
use super::show::{counted, line};
use crate::config::Config;
use crate::proof;

/// Check a decision without the swarm: that a member announced it so, that members signed its votes, and that it follows from them
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt verify decision.json --roster keys/roster.json
  gestalt verify - --roster keys/roster.json --config robot.json5")]
pub struct Args {
    /// Decision, JSON, as robots publish it on `gestalt/<swarm>/decision`, or a line of `gestalt watch --json` with one; `-` for standard input
    decision: PathBuf,
    /// Roster of the swarm, as `gestalt trust` writes it
    #[arg(long, value_name = "FILE")]
    roster: PathBuf,
    /// Configuration of a robot of the swarm, for its rounds [default: the defaults]
    #[arg(short, long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// How many robots the swarm had at least, where that is known: of how many it is, a decision says itself
    #[arg(long, value_name = "N", default_value_t = 1)]
    robots: u32,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
///
/// # Errors
/// What keeps the decision from being one.
pub fn run(args: &Args) -> Result<(), Failure> {
    let announcement = proof::read(&read(&args.decision, MAX_JSON)?)?;
    let roster = proof::read_roster(&read(&args.roster, MAX_ROSTER)?)?;
    let config = args.config.as_deref().map_or_else(|| Ok(Config::default()), Config::read)?;
    proof::check(&announcement, &roster, &config.rounds, args.robots)?;
    let decision = announcement.decision;
    let certificate = &decision.certificate;
    let reached = certificate.reached();
    let words = format!(
        "proven: round {}, {}, by {} of {}, signed by members of \"{}\"",
        decision.round.counter,
        decision
            .class
            .map_or("undecided".to_owned(), |class| format!("class {class}, p = {:.3}", decision.confidence)),
        reached,
        counted(certificate.robots as usize, "robot"),
        roster.members().swarm
    );
    let object = json!({"proven": true, "round": decision.round, "class": decision.class, "robots": reached});
    line(args.json, &object, &words)
}

/// So many bytes, and one more by which it is too long.
fn read(path: &Path, longest: usize) -> Result<Vec<u8>, Failure> {
    let at_most = longest as u64 + 1;
    let mut bytes = Vec::new();
    if path == Path::new("-") {
        std::io::stdin().take(at_most).read_to_end(&mut bytes)?;
    } else {
        let file = std::fs::File::open(path).map_err(|error| format!("{}: {error}", path.display()))?;
        file.take(at_most).read_to_end(&mut bytes)?;
    }
    Ok(bytes)
}
