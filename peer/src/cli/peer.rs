//! `gestalt peer`: one robot.

use std::time::{Duration, SystemTime};

use serde_json::json;
use tokio::sync::broadcast::error::RecvError;

use super::config_args::ConfigArgs;
use super::progress::bar;
use super::show::{self, line};
use super::{Failure, interrupted};
use crate::body::Body;
use gestalt_link::Event;
use gestalt_link::boot_number;

/// Runs one robot until Ctrl-C.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    config: ConfigArgs,

    /// Open a round this often: `5s`
    #[arg(long, value_name = "DURATION", value_parser = super::duration)]
    open_every: Option<Duration>,

    /// Say what happens as one JSON object a line
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
///
/// # Errors
/// Whatever keeps the robot from starting.
pub fn run(args: &Args) -> Result<(), Failure> {
    let config = args.config.load()?;
    let training = bar("learning", 0);
    let model = crate::model::load(&config.model, |done, total| {
        training.set_length(total as u64);
        training.set_position(done as u64);
    })?;
    training.finish_and_clear();
    super::runtime()?.block_on(async {
        let body = Body::start(&config, model, boot_number(SystemTime::now())).await?;
        let mut events = body.robot().events();
        line(
            args.json,
            &json!({"event": "started", "robot": config.robot.id, "name": config.name(), "locators": body.robot().locators()}),
            &format!("{} of swarm '{}' listens on {}", config.name(), config.swarm.0, body.robot().locators().join(" ")),
        )?;
        let mut schedule = args.open_every.map(tokio::time::interval);
        if let Some(schedule) = &mut schedule {
            schedule.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
        }
        loop {
            tokio::select! {
                () = interrupted() => break,
                () = tick(&mut schedule) => body.robot().open_round(),
                event = events.recv() => match event {
                    Ok(event) => report(args.json, &event)?,
                    Err(RecvError::Lagged(missed)) => tracing::warn!("{missed} events passed unreported"),
                    Err(RecvError::Closed) => break,
                },
            }
        }
        body.stop().await;
        Ok(())
    })
}

async fn tick(schedule: &mut Option<tokio::time::Interval>) {
    match schedule {
        Some(schedule) => {
            schedule.tick().await;
        }
        None => std::future::pending().await,
    }
}

pub(super) fn report(as_json: bool, event: &Event) -> Result<(), Failure> {
    match event {
        Event::Opened(round) => {
            line(as_json, &json!({"event": "opened", "round": round}), &format!("round {round} opens"))
        }
        Event::Closed(round) => {
            line(as_json, &json!({"event": "closed", "round": round}), &format!("round {round} is over"))
        }
        Event::Held(decision) => line(
            as_json,
            &json!({"event": "held", "decision": decision}),
            &format!("holds {}", show::decision(decision, None)),
        ),
        Event::Announced(announcement) => line(
            as_json,
            &json!({"event": "announced", "decision": announcement}),
            &format!("swarm: {}", show::decision(&announcement.decision, announcement.label.as_deref())),
        ),
        Event::Neighbours(robots) => line(
            as_json,
            &json!({"event": "neighbours", "robots": robots}),
            &format!("linked to {}", show::robots(robots)),
        ),
        Event::Alive(robots) => line(
            as_json,
            &json!({"event": "alive", "robots": robots}),
            &format!("alive: {}", show::robots(robots)),
        ),
        Event::Shared(samples) => line(
            as_json,
            &json!({"event": "shared", "samples": samples}),
            &format!("shares {} samples", samples.len()),
        ),
        Event::Answered(instructor, answer) => line(
            as_json,
            &json!({"event": "answered", "instructor": instructor, "answer": answer}),
            &format!("answers {instructor}: {}", answer.outcome.describe()),
        ),
        Event::Remembered(revision) => line(
            as_json,
            &json!({"event": "remembered", "revision": revision}),
            &format!("remembers revision {revision}"),
        ),
        Event::Failed { part, cause } => line(
            as_json,
            &json!({"event": "failed", "part": part.name(), "cause": cause}),
            &format!("{part} failed: {cause}"),
        ),
        // What a later release may have to tell.
        _ => Ok(()),
    }
}
