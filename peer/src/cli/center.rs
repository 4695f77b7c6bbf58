//! `gestalt center`: one machine that processes the frames of many robots.

use std::pin::pin;
use std::time::SystemTime;

use gestalt_strategies::Classify;
use serde_json::json;
use tokio::sync::broadcast::error::RecvError;

use super::config_args::ConfigArgs;
use super::peer::{lagged, report};
use super::printing::Printing;
use super::robot_args::{IdentityArgs, ModelArgs};
use super::show::{Names, line};
use super::{Failure, interrupted};
use crate::center::Center;
use crate::config::Fuse;

/// Run a fusion centre until Ctrl-C: it classifies the frames that robots stream, and votes for them
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt center -c configs/fusion-center.json5
  gestalt center --id 100 --listen tcp/[::]:7447 --model hands.gestalt --fuse swarm")]
pub struct Args {
    #[command(flatten)]
    config: ConfigArgs,

    #[command(flatten)]
    identity: IdentityArgs,

    #[command(flatten)]
    model: ModelArgs,

    /// Who decides: `central`, one mind in the centre for all streaming robots; `swarm`, one mind per robot (center.fuse)
    #[arg(long, value_parser = super::choice::fuse())]
    fuse: Option<Fuse>,

    /// Print events as JSON Lines, one object per line
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
///
/// # Errors
/// Whatever keeps the centre from starting, and what ends it before its time.
pub fn run(args: &Args) -> Result<(), Failure> {
    let settings = [args.identity.settings(), args.model.settings()].concat();
    let mut config = args.config.load_with(settings)?;
    config.center.fuse = args.fuse.unwrap_or(config.center.fuse);
    let model = crate::model::load(&config.model)?.ok_or(
        "a fusion centre needs a classifier: set model (--model) to \"hands\", \"rendered\" or {file: \"FILE\"}",
    )?;
    let names = Names::new(model.classifier.vocabulary());
    super::runtime()?.block_on(async {
        let mut interrupted = pin!(interrupted());
        let center = tokio::select! {
            center = Center::start(&config, model, config.trust.boot(config.robot.id, SystemTime::now())) => center?,
            () = &mut interrupted => return Ok(()),
        };
        let mut events = center.robot().events();
        let locators = center.robot().locators();
        let mut printing = Printing::default();
        printing.note(line(
            args.json,
            &json!({"event": "started", "robot": config.robot.id, "name": config.name(), "fuse": config.center.fuse, "locators": locators}),
            &format!("fusion centre {} \"{}\" of swarm \"{}\" is listening on {}", config.robot.id, config.name(), config.swarm.0, locators.join(" ")),
        ));
        let ended = loop {
            tokio::select! {
                () = &mut interrupted => break Ok(()),
                event = events.recv() => match event {
                    Ok(event) => printing.note(report(args.json, &event, &names)),
                    Err(RecvError::Lagged(missed)) => lagged(missed),
                    Err(RecvError::Closed) => break Err("the fusion centre has ended".into()),
                },
                failure = center.robot().ended() => break Err(failure.to_string().into()),
            }
        };
        center.stop().await;
        ended
    })
}
