//! `gestalt stream`: a camera whose pictures are looked at elsewhere.

use std::time::{SystemTime, UNIX_EPOCH};

use serde_json::json;

use super::config_args::ConfigArgs;
use super::show::{self, line};
use super::{Failure, interrupted};
use crate::stream::{Feed, Sender, SenderConfig, StreamEvent};

/// Sends what a robot's camera sees to a fusion centre, and prints what the swarm decides, until Ctrl-C or the camera's end.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    config: ConfigArgs,

    /// The quality of the JPEG pictures; files that are JPEG already are sent as they are
    #[arg(long, default_value_t = 80, value_name = "1..100", value_parser = clap::value_parser!(i32).range(1..=100))]
    quality: i32,

    /// Say what happens as one JSON object a line
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
///
/// # Errors
/// A robot without a camera, and what no waiting mends. A camera that is missing is waited for.
pub fn run(args: &Args) -> Result<(), Failure> {
    let (config, link) = args.config.streaming()?;
    let (swarm, robot) = (config.swarm.0.clone(), config.robot.id);
    let clock = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let feed = Feed::new(&config.camera, robot, clock).ok_or(
        "there is no camera to stream from: set camera.source to rendered, images, video or a device",
    )?;
    let source = feed.describe();
    let camera = config.camera.model.properties().name;
    super::runtime()?.block_on(async {
        let sender = Sender::start(
            SenderConfig { swarm: swarm.clone(), link, robot, camera, quality: args.quality },
            feed,
        )?;
        line(
            args.json,
            &json!({"event": "started", "robot": robot, "name": config.name(), "source": source}),
            &format!("{} of swarm '{swarm}' streams {source}", config.name()),
        )?;
        let mut failed = None;
        let sending = sender.run(|event| {
            if failed.is_none() {
                failed = report(args.json, &event).err();
            }
        });
        tokio::select! {
            () = interrupted() => {}
            ended = sending => ended?,
        }
        failed.map_or(Ok(()), Err)
    })
}

fn report(as_json: bool, event: &StreamEvent) -> Result<(), Failure> {
    match event {
        StreamEvent::Attached => line(as_json, &json!({"event": "attached"}), "attached"),
        StreamEvent::Detached { cause } => line(
            as_json,
            &json!({"event": "detached", "cause": cause}),
            &format!("attached to nobody: {cause}"),
        ),
        StreamEvent::Failed { cause, times } => {
            let often = if *times > 1 { format!("failed {times} times") } else { "failed".to_owned() };
            line(
                as_json,
                &json!({"event": "failed", "cause": cause, "times": times}),
                &format!("{often}: {cause}"),
            )
        }
        StreamEvent::Decided(announced) => line(
            as_json,
            &json!({"event": "announced", "decision": announced}),
            &show::decision(&announced.decision, announced.label.as_deref()),
        ),
        // For programs; a person would drown in it.
        StreamEvent::Count { sent, taken, overwritten } if as_json => line(
            true,
            &json!({"event": "count", "sent": sent, "taken": taken, "overwritten": overwritten}),
            "",
        ),
        StreamEvent::Count { .. } => Ok(()),
    }
}
