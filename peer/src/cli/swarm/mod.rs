//! `gestalt swarm`: a whole swarm on this machine, shown one gesture after the other.

mod picture;
mod plan;
mod report;
mod showing;

use std::path::PathBuf;
use std::pin::pin;
use std::time::{Duration, Instant};

use gestalt_protocol::FusionRule;
use gestalt_strategies::Classify;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde_json::json;

use self::showing::Showing;
use super::progress::bar;
use super::record;
use super::show::{Names, counted, line};
use super::trust::Authority;
use super::web::{self, WebArgs};
use super::{Failure, interrupted};
use crate::config::{Config, LearnFrom, ModelSection, Schedule};
use crate::recording::{Recording, RecordingPlan};
use crate::swarm::{Members, Roster, Tally};
use gestalt_desk::Desk;
use gestalt_lab::shape::NetworkShape;
use gestalt_link::{Client, LinkConfig, News};
use gestalt_vision::model::RobotModel;
use gestalt_vision::source::Glove;

/// Run a swarm of robots with synthetic cameras around one person, each a real Zenoh peer
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt swarm --robots footbot:3,parrot:1 --rounds 3
  gestalt swarm --learn nothing --rounds 30 --pause 300ms --curve curve.svg --picture round.png")]
pub struct Args {
    /// Robots to run, by camera model and count: footbot, parrot, laptop
    #[arg(long, default_value = "footbot:6,parrot:2", value_name = "KIND:COUNT,…")]
    robots: Roster,

    /// Network topology: line, ring, grid, star, random or full
    #[arg(long, default_value = "random")]
    topology: NetworkShape,

    /// Number of gestures to show (one round each)
    #[arg(long, default_value_t = 12, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    rounds: u32,

    /// How rounds are opened: by an instructor, or by the robots' own motion detection (a gesture is shown every six
    /// seconds; nobody announces it)
    #[arg(long, value_enum, default_value_t = By::Instructor)]
    by: By,

    /// Pause between a decision and the next gesture (with --by instructor)
    #[arg(long, default_value = "1s", value_name = "DURATION", value_parser = super::duration)]
    pause: Duration,

    /// Fusion rule
    #[arg(long, default_value_t, value_parser = super::choice::rule())]
    rule: FusionRule,

    /// Model file written by `gestalt train`, `hands` (bare hands before any camera) or `rendered` (synthetic hands)
    #[arg(long, value_name = "FILE|hands|rendered", default_value = "rendered")]
    model: ModelSection,

    /// What the hand wears: a cyan or orange glove, or `skin` [`--model hands` reads bare hands]
    #[arg(long, value_name = "GLOVE", default_value = "cyan", value_parser = super::choice::glove())]
    glove: Glove,

    /// Let the robots learn, starting from `nothing` (no gesture known) or from the `model`. After each round a scripted
    /// instructor says which gesture it was
    #[arg(long, value_parser = super::choice::learn())]
    learn: Option<LearnFrom>,

    /// Keep each robot's memory in this folder, and resume from what is there
    #[arg(long, value_name = "DIR", requires = "learn")]
    memory: Option<PathBuf>,

    /// Random seed: robot placement, links and gestures
    #[arg(long, default_value_t = 1)]
    seed: u64,

    /// Run each robot in a process of its own
    #[arg(long)]
    processes: bool,

    /// Write a picture of what each robot saw in the round with most disagreement
    #[arg(long, value_name = "FILE.svg|FILE.png", conflicts_with = "processes")]
    picture: Option<PathBuf>,

    /// Plot the learning curve (SVG or PNG, by the file extension)
    #[arg(long, value_name = "FILE.svg|FILE.png", requires = "learn")]
    curve: Option<PathBuf>,

    /// Record the run into a new MCAP file, as `gestalt record` does
    #[arg(long, value_name = "FILE.mcap")]
    record: Option<PathBuf>,

    /// Name of the swarm
    #[arg(long, default_value = "gestalt", value_name = "NAME")]
    swarm: String,

    /// Keep the robots' keys and the roster in this folder [default: beside the memory, or made for this run alone]
    #[arg(long, value_name = "DIR")]
    keys: Option<PathBuf>,

    /// An open swarm: robots sign nothing, and are who they say they are
    #[arg(long, conflicts_with = "keys")]
    open: bool,

    #[command(flatten)]
    web: WebArgs,

    /// Print JSON Lines, one object per line
    #[arg(long)]
    json: bool,
}

/// What opens rounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum By {
    Instructor,
    Motion,
}

/// When gestures are shown to robots that watch for motion.
const SCHEDULE: Schedule = Schedule { period: Duration::from_secs(6), still: Duration::from_millis(2500) };

/// Runs the verb.
///
/// # Errors
/// Whatever keeps the swarm from starting, ends its rounds before their time, or keeps a picture from being written. What
/// the rounds before that gave is reported all the same.
pub fn run(args: &Args) -> Result<(), Failure> {
    // Found out now, not after the last round.
    if let Some(picture) = &args.picture {
        gestalt_draw::check(picture)?;
    }
    if let Some(curve) = &args.curve {
        gestalt_draw::check(curve)?;
    }
    if let Some(memory) = &args.memory {
        std::fs::create_dir_all(memory).map_err(|error| {
            format!("--memory {}: {error}: name a folder that can be written to", memory.display())
        })?;
    }
    let folder = tempfile::tempdir()?;
    // What robots remember of others is signed: with other keys it counts for nothing.
    let beside = args.memory.as_deref().unwrap_or(folder.path());
    let keys = (!args.open).then(|| args.keys.clone().unwrap_or_else(|| beside.join("keys")));
    let configs = plan::configs(args, keys.as_deref())?;
    if let Some(keys) = &keys {
        let mut authority = Authority::open_or_create(keys, Some(&args.swarm))?;
        configs.iter().try_for_each(|config| authority.enrol_here(config.robot.id))?;
        authority.save()?;
    }
    let model = crate::model::load(&args.model)?.ok_or("a swarm needs a model: give --model FILE")?;
    super::runtime()?.block_on(async {
        let mut interrupted = pin!(interrupted());
        let mut swarm = tokio::select! {
            started = start(args, &configs, &model, folder) => started?,
            () = &mut interrupted => return Ok(()),
        };
        let names = Names::new(model.classifier.vocabulary());
        let mut tally = Tally::new(configs.iter().map(|config| config.robot.id));
        let shown = {
            let mut showing = Showing::new(args, &configs, &names, &mut swarm, &mut tally);
            tokio::select! {
                shown = showing.all() => shown,
                () = &mut interrupted => Ok(()),
            }
        };
        // Whatever ended the rounds, what they gave is said.
        let reported = report::all(args, &configs, &tally);
        if let Some(page) = swarm.page.take() {
            page.close().await;
        }
        let recorded = match (swarm.recording, &args.record) {
            (Some(recording), Some(file)) => {
                tokio::time::sleep(LAST_WORDS).await;
                let ledger = recording.finish().await.map_err(Failure::from);
                ledger.and_then(|ledger| record::report(args.json, file, &ledger))
            }
            _ => Ok(()),
        };
        swarm.client.close().await;
        swarm.members.stop().await;
        shown.and(reported).and(recorded)
    })
}

/// How long what was said last may be on its way to the recorder.
const LAST_WORDS: Duration = Duration::from_millis(500);

/// A running swarm, and a client that hears it.
struct Swarm {
    members: Members,
    client: Client,
    news: News,
    page: Option<Desk>,
    recording: Option<Recording>,
    /// Holds their keys, and the configurations of robots in processes of their own.
    _folder: tempfile::TempDir,
}

/// Starts the robots, and waits until they know each other.
async fn start(
    args: &Args,
    configs: &[Config],
    model: &RobotModel,
    folder: tempfile::TempDir,
) -> Result<Swarm, Failure> {
    let links = args.topology.links(configs.len(), &mut ChaCha8Rng::seed_from_u64(args.seed));
    let began = Instant::now();
    let starting = bar("starting", configs.len());
    let started = |n| starting.set_position(n as u64);
    let (members, endpoints) = if args.processes {
        Members::processes(configs, &links, folder.path(), started).await?
    } else {
        Members::here(configs, &links, model, started).await?
    };
    starting.finish_and_clear();
    let link = LinkConfig { connect: endpoints[..1].to_vec(), ..LinkConfig::default() };
    let client = Client::open(&args.swarm, &link).await?;
    let news = client.news().await?;
    wait_for_all(&client, configs.len()).await?;
    let recording = match &args.record {
        None => None,
        Some(file) => {
            let rounds = configs.first().map(|config| &config.rounds);
            let plan = RecordingPlan { swarm: &args.swarm, link: &link, file, rounds, frames: false };
            Some(Recording::start(plan).await?)
        }
    };
    let seconds = began.elapsed().as_secs_f64();
    line(
        args.json,
        &json!({"event": "started", "robots": configs.len(), "links": links, "endpoints": endpoints, "seconds": seconds}),
        &format!(
            "{}, {}: connected in {seconds:.1} s · any Zenoh client can attach to {}",
            counted(configs.len(), "robot"),
            counted(links.len(), "link"),
            endpoints.first().map_or("no endpoint", String::as_str)
        ),
    )?;
    let page = args.web.open(&args.swarm, &link).await?;
    if let Some(page) = &page {
        web::say_where(page, args.json)?;
    }
    Ok(Swarm { members, client, news, page, recording, _folder: folder })
}

/// Waits until every robot knows every other.
async fn wait_for_all(client: &Client, robots: usize) -> Result<(), Failure> {
    const PATIENCE: Duration = Duration::from_secs(30);
    let deadline = Instant::now() + PATIENCE;
    loop {
        let statuses = client.statuses(super::ANSWER).await?;
        let ready = statuses.iter().filter(|status| status.alive.len() == robots).count();
        if ready == robots {
            return Ok(());
        }
        if Instant::now() > deadline {
            return Err(format!(
                "only {ready} of {robots} robots see all others after {PATIENCE:?}: is this machine overloaded?"
            )
            .into());
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}
