//! `gestalt peer`: one robot.

use std::pin::pin;
use std::time::{Duration, SystemTime};

use gestalt_strategies::Classify;
use serde_json::json;
use tokio::sync::broadcast::error::RecvError;

use super::config_args::{ConfigArgs, Setting};
use super::printing::Printing;
use super::robot_args::{CameraArgs, IdentityArgs, ModelArgs};
use super::show::{self, Names, line};
use super::web::{self, WebArgs};
use super::{Failure, interrupted};
use crate::body::Body;
use crate::config::Config;
use crate::service_manager::{ServiceEnvironment, ServiceManager};
use gestalt_link::{Event, LinkConfig, Part};

/// Run one robot until Ctrl-C
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt peer -c configs/footbot.json5
  gestalt peer --id 3 --camera laptop --source /dev/video0 --model hands.gestalt --motion")]
pub struct Args {
    #[command(flatten)]
    config: ConfigArgs,

    #[command(flatten)]
    identity: IdentityArgs,

    #[command(flatten)]
    camera: CameraArgs,

    /// Open rounds automatically when a hand has moved and is at rest (camera.motion.enabled)
    #[arg(long)]
    motion: bool,

    #[command(flatten)]
    model: ModelArgs,

    /// Open a round at this interval, such as `5s`
    #[arg(long, value_name = "DURATION", value_parser = super::duration)]
    open_every: Option<Duration>,

    #[command(flatten)]
    web: WebArgs,

    /// Show what the robot sees to the ROS 2 system whose Zenoh router this is, as ~/view/compressed of the node
    /// /gestalt/robot_N (ros.enabled, ros.router)
    #[arg(long, value_name = "ROUTER")]
    ros: Option<String>,

    /// Print events as JSON Lines, one object per line
    #[arg(long)]
    json: bool,
}

impl Args {
    fn config(&self) -> Result<Config, Failure> {
        let mut settings = self.identity.settings();
        settings.extend(self.camera.settings()?);
        settings.extend(self.model.settings());
        if self.motion {
            settings.push(Setting::new(&["camera", "motion", "enabled"], json!(true)));
        }
        if let Some(router) = &self.ros {
            settings.push(Setting::new(&["ros", "enabled"], json!(true)));
            settings.push(Setting::new(&["ros", "router"], json!(router)));
        }
        Ok(self.config.load_with(settings)?)
    }
}

/// Runs the verb.
///
/// # Errors
/// Whatever keeps the robot from starting, and what ends it before its time.
pub fn run(args: &Args) -> Result<(), Failure> {
    // Few threads of one robot, for months.
    crate::heaps::share();
    let config = args.config()?;
    let model = crate::model::load(&config.model)?;
    let names = model.as_ref().map(|model| Names::new(model.classifier.vocabulary())).unwrap_or_default();
    let manager = ServiceManager::new(&ServiceEnvironment::read(), std::process::id())?;
    super::runtime()?.block_on(async {
        let mut interrupted = pin!(interrupted());
        let body = tokio::select! {
            body = Body::start(&config, model, config.trust.boot(config.robot.id, SystemTime::now())) => body?,
            () = &mut interrupted => return Ok(()),
        };
        let mut events = body.robot().events();
        let locators = body.robot().locators();
        let mut printing = Printing::default();
        printing.note(line(
            args.json,
            &json!({"event": "started", "robot": config.robot.id, "name": config.name(), "locators": locators}),
            &format!("robot {} \"{}\" of swarm \"{}\" is listening on {}", config.robot.id, config.name(), config.swarm.0, locators.join(" ")),
        ));
        // The page is a client of this robot, as others are.
        let endpoint = body.robot().for_clients();
        let credentials = match endpoint {
            Some(endpoint) if endpoint.starts_with("tls/") => config.trust.credentials(config.robot.id)?,
            _ => None,
        };
        let link = LinkConfig {
            connect: endpoint.into_iter().map(str::to_owned).collect(),
            credentials,
            ..LinkConfig::default()
        };
        let web = args.web.or(config.web.listen.as_ref());
        let page = match web.open(&config.swarm.0, &link).await {
            Ok(page) => page,
            Err(error) => {
                body.stop().await;
                return Err(error);
            }
        };
        printing.note(page.as_ref().map(|page| web::say_where(page, args.json)));
        manager.ready(&format!("robot {} of swarm {} listens on {}", config.robot.id, config.swarm.0, locators.join(" ")));
        let mut schedule = args.open_every.map(every);
        let mut watchdog = manager.watchdog_period().map(every);
        let mut unheard = 0;
        let ended = loop {
            tokio::select! {
                () = &mut interrupted => break Ok(()),
                () = tick(&mut schedule) => body.robot().open_round(),
                () = tick(&mut watchdog) => {
                    // A robot whose mind takes nothing in any more is no better than one that hangs.
                    let status = body.robot().status();
                    let full = status.counters.get("refused_command_full").copied().unwrap_or(0);
                    if std::mem::replace(&mut unheard, full) == full {
                        manager.alive();
                    }
                }
                event = events.recv() => match event {
                    Ok(event) => {
                        printing.note(report(args.json, &event, &names));
                        // Where nobody starts it again, whoever works with a robot alone is better off with it.
                        if let Some(failure) = outdated(&event).filter(|_| manager.is_there()) {
                            break Err(failure.to_string().into());
                        }
                    }
                    Err(RecvError::Lagged(missed)) => lagged(missed),
                    Err(RecvError::Closed) => break Err("the robot has ended".into()),
                },
                failure = body.robot().ended() => break Err(failure.to_string().into()),
            }
        };
        manager.stopping();
        if let Some(page) = page {
            page.close().await;
        }
        body.stop().await;
        ended
    })
}

fn every(period: Duration) -> tokio::time::Interval {
    let mut schedule = tokio::time::interval(period);
    schedule.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    schedule
}

async fn tick(schedule: &mut Option<tokio::time::Interval>) {
    match schedule {
        Some(schedule) => {
            schedule.tick().await;
        }
        None => std::future::pending().await,
    }
}

/// What the program ends for, to be started anew: it has a robot alone whose network came later.
fn outdated(event: &Event) -> Option<gestalt_link::Failure> {
    match event {
        Event::Failed { part: part @ Part::Network, cause } => {
            Some(gestalt_link::Failure { part: *part, cause: cause.clone() })
        }
        _ => None,
    }
}

pub(super) fn lagged(missed: u64) {
    tracing::warn!("{missed} events were not printed: the output is too slow");
}

/// Prints what happened to a robot.
pub(super) fn report(as_json: bool, event: &Event, names: &Names) -> Option<Result<(), Failure>> {
    let (object, words) = match event {
        Event::Opened(round) => (
            json!({"event": "opened", "round": round}),
            format!("round {} opened by robot {}", round.counter, round.opener),
        ),
        Event::Closed(round) => {
            (json!({"event": "closed", "round": round}), format!("round {} closed", round.counter))
        }
        Event::Held(decision) => (
            json!({"event": "held", "decision": decision}),
            format!("holds: {}", show::decision(decision, None, names)),
        ),
        Event::Announced(announcement) => (
            json!({"event": "announced", "decision": announcement}),
            format!("decided: {}", show::announced(announcement, names)),
        ),
        Event::Asked(question) => {
            (json!({"event": "asked", "question": question}), format!("asks: {}", show::question(question)))
        }
        Event::Neighbours(robots) => (
            json!({"event": "neighbours", "robots": robots}),
            match robots.len() {
                0 => "linked to no robot".to_owned(),
                1 => format!("linked to robot {}", show::robots(robots)),
                _ => format!("linked to robots {}", show::robots(robots)),
            },
        ),
        Event::Alive(robots) => {
            (json!({"event": "alive", "robots": robots}), format!("robots alive: {}", show::robots(robots)))
        }
        Event::Shared(samples) => (
            json!({"event": "shared", "samples": samples}),
            format!("shared {}", show::counted(samples.len(), "sample")),
        ),
        Event::Answered(instructor, answer) => (
            json!({"event": "answered", "instructor": instructor, "answer": answer}),
            format!("answered instructor {instructor}: {}", answer.outcome.describe()),
        ),
        Event::Remembered(revision) => (
            json!({"event": "remembered", "revision": revision}),
            format!("memory saved (revision {revision})"),
        ),
        Event::Failed { part, cause } => (
            json!({"event": "failed", "part": part.name(), "cause": cause}),
            format!("{part} failed: {}", show::clean(cause)),
        ),
        // What is for its guests, or what a later release may have to tell.
        _ => return None,
    };
    Some(line(as_json, &object, &words))
}
