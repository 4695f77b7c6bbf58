//! `gestalt center`: one machine that looks through the cameras of many robots.

use std::time::SystemTime;

use serde_json::json;
use tokio::sync::broadcast::error::RecvError;

use super::config_args::ConfigArgs;
use super::peer::report;
use super::progress::bar;
use super::show::line;
use super::{Failure, interrupted};
use crate::center::Center;
use crate::config::Fuse;
use gestalt_link::boot_number;

/// Runs a fusion centre until Ctrl-C: it serves every robot that streams to it.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    config: ConfigArgs,

    /// Who decides: the centre for all robots it serves, or each of them with a mind of its own
    #[arg(long, value_name = "central|swarm", value_parser = fuse)]
    fuse: Option<Fuse>,

    /// Say what happens as one JSON object a line
    #[arg(long)]
    json: bool,
}

fn fuse(text: &str) -> Result<Fuse, String> {
    serde_json::from_value(json!(text)).map_err(|error| error.to_string())
}

/// Runs the verb.
///
/// # Errors
/// Whatever keeps the centre from starting.
pub fn run(args: &Args) -> Result<(), Failure> {
    let mut config = args.config.load()?;
    config.center.fuse = args.fuse.unwrap_or(config.center.fuse);
    let training = bar("learning", 0);
    let model = crate::model::load(&config.model, |done, total| {
        training.set_length(total as u64);
        training.set_position(done as u64);
    })?
    .ok_or("a centre needs a classifier: set model to \"rendered\" or {file: \"FILE\"}")?;
    training.finish_and_clear();
    super::runtime()?.block_on(async {
        let center = Center::start(&config, model, boot_number(SystemTime::now())).await?;
        let mut events = center.robot().events();
        let locators = center.robot().locators();
        line(
            args.json,
            &json!({"event": "started", "robot": config.robot.id, "name": config.name(), "fuse": config.center.fuse, "locators": locators}),
            &format!("{} of swarm '{}' serves cameras on {}", config.name(), config.swarm.0, locators.join(" ")),
        )?;
        loop {
            tokio::select! {
                () = interrupted() => break,
                event = events.recv() => match event {
                    Ok(event) => report(args.json, &event)?,
                    Err(RecvError::Lagged(missed)) => tracing::warn!("{missed} events passed unreported"),
                    Err(RecvError::Closed) => break,
                },
            }
        }
        center.stop().await;
        Ok(())
    })
}
