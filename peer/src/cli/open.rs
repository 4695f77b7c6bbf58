//! `gestalt open`: tell a running swarm to look.

use std::time::Duration;

use gestalt_protocol::InstructorId;
use serde_json::json;

use super::Failure;
use super::config_args::ConfigArgs;
use super::show::{self, line};
use gestalt_link::Client;

/// Opens a round as an instructor, and prints the swarm's decision.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    config: ConfigArgs,

    /// The name to speak under
    #[arg(long, default_value = "console")]
    instructor: InstructorId,

    /// How long to wait for the decision
    #[arg(long, default_value = "15s", value_parser = super::duration)]
    patience: Duration,

    /// Print the decision as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
///
/// # Errors
/// When no robot is reached, or none decides.
pub fn run(args: &Args) -> Result<(), Failure> {
    let (swarm, link) = args.config.client()?;
    super::runtime()?.block_on(async {
        let client = Client::open(&swarm, &link).await?;
        let mut news = client.news().await?;
        let before = client.last_decision(super::ANSWER).await?.map(|last| last.decision.round.counter);
        let decided = super::open_round(&client, &mut news, &args.instructor, before, args.patience).await;
        client.close().await;
        let decided = decided?.ok_or_else(|| {
            format!("no decision within {:?}: is a robot of swarm '{swarm}' alive?", args.patience)
        })?;
        let words = show::decision(&decided.decision, decided.label.as_deref());
        line(args.json, &json!({"event": "decision", "decision": decided}), &words)
    })
}
