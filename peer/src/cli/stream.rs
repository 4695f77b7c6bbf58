//! `gestalt stream`: a camera whose frames are processed elsewhere.

use std::pin::pin;
use std::time::{SystemTime, UNIX_EPOCH};

use serde_json::json;

use super::config_args::ConfigArgs;
use super::printing::Printing;
use super::robot_args::{CameraArgs, IdentityArgs};
use super::show::{self, Names, line};
use super::{Failure, interrupted};
use crate::config::SourceSection;
use crate::stream::{Feed, Sender, SenderConfig, StreamEvent};

/// Stream a camera to a fusion centre and print the swarm's decisions, until Ctrl-C or the end of the source
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt stream -c configs/parrot.json5 -e tcp/192.168.1.5:7447
  gestalt stream --id 7 --source /dev/video0 -e tcp/192.168.1.5:7447 --quality 70")]
pub struct Args {
    #[command(flatten)]
    config: ConfigArgs,

    #[command(flatten)]
    identity: IdentityArgs,

    #[command(flatten)]
    camera: CameraArgs,

    /// JPEG quality, 1 to 100; files that are JPEG already are sent unchanged
    #[arg(long, default_value_t = 80, value_name = "1..100", value_parser = clap::value_parser!(i32).range(1..=100))]
    quality: i32,

    /// Print events as JSON Lines, one object per line
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
///
/// # Errors
/// A robot without a camera, and what no waiting changes. A camera that is missing is waited for, a file is not.
pub fn run(args: &Args) -> Result<(), Failure> {
    let (config, link) =
        args.config.streaming([args.identity.settings(), args.camera.settings()?].concat())?;
    let (swarm, robot) = (config.swarm.0.clone(), config.robot.id);
    let clock = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    if let SourceSection::Images(files) | SourceSection::Video(files) = &config.camera.source
        && !files.path.exists()
    {
        return Err(format!("{} does not exist: check the path", files.path.display()).into());
    }
    let feed = Feed::new(&config.camera, robot, clock).ok_or(
        "no camera source to stream: set camera.source (--source) to rendered, images, video or device",
    )?;
    let signer = config.trust.frame_signer(robot)?;
    let source = feed.describe();
    let camera = config.camera.model.properties().name;
    super::runtime()?.block_on(async {
        let mut interrupted = pin!(interrupted());
        let sender = Sender::start(
            SenderConfig { swarm: swarm.clone(), link, robot, camera, quality: args.quality, signer },
            feed,
        )?;
        let mut printing = Printing::default();
        printing.note(line(
            args.json,
            &json!({"event": "started", "robot": robot, "name": config.name(), "source": source}),
            &format!("robot {robot} \"{}\" of swarm \"{swarm}\" is streaming {source}", config.name()),
        ));
        let sending = sender.run(|event| printing.note(report(args.json, &event)));
        tokio::select! {
            () = &mut interrupted => {}
            ended = sending => ended?,
        }
        Ok(())
    })
}

fn report(as_json: bool, event: &StreamEvent) -> Result<(), Failure> {
    match event {
        StreamEvent::Attached => line(as_json, &json!({"event": "attached"}), "attached"),
        StreamEvent::Detached { cause } => {
            line(as_json, &json!({"event": "detached", "cause": cause}), &format!("detached: {cause}"))
        }
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
            &show::announced(announced, &Names::default()),
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
