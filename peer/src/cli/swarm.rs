//! `gestalt swarm`: a whole swarm on this machine, shown one gesture after the other.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use gestalt_protocol::{ClassId, Decision, FusionRule, Gesture, Instruction, InstructorId, RobotId, RoundId};
use gestalt_strategies::Proportion;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde_json::json;

use super::progress::bar;
use super::show::{self, line};
use super::{Failure, interrupted};
use crate::body::Body;
use crate::config::{
    CameraSection, Config, LearnFrom, LearningSection, ModelSection, MotionConfig, RenderedSection, Schedule,
    SourceSection,
};
use crate::opinion::likeliest;
use crate::picture::{self, Panel};
use crate::swarm::{Members, Roster, Score, Tally, curve};
use gestalt_lab::shape::NetworkShape;
use gestalt_link::{Announcement, Client, LinkConfig, News};
use gestalt_vision::human::Human;
use gestalt_vision::model::RobotModel;
use gestalt_vision::pose::place;

/// Runs a swarm of robots with rendered cameras around one human, as real Zenoh peers.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Which robots: footbot, parrot and laptop, each with a count
    #[arg(long, default_value = "footbot:6,parrot:2", value_name = "KIND:COUNT,…")]
    robots: Roster,

    /// Who is linked to whom: line, ring, grid, star, random or full
    #[arg(long, default_value = "random")]
    topology: NetworkShape,

    /// How many gestures to show
    #[arg(long, default_value_t = 12)]
    rounds: u32,

    /// What opens the rounds: an instructor, or motion: the human shows a gesture every six seconds, the robots see it, and
    /// nobody tells them
    #[arg(long, value_enum, default_value_t = By::Instructor)]
    by: By,

    /// The pause between a decision and the next gesture, by an instructor
    #[arg(long, default_value = "1s", value_parser = super::duration)]
    pause: Duration,

    /// How votes are fused: log_pool, majority, mean_probability or confidence_weighted
    #[arg(long, default_value = "log_pool", value_parser = rule)]
    rule: FusionRule,

    /// A model that `gestalt train` wrote; without it, one is trained on drawn hands first
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,

    /// Let the robots learn: `nothing` starts them without knowing any gesture, `model` from the classifier. After each
    /// round a scripted instructor says what the gesture was
    #[arg(long, value_name = "nothing|model", value_parser = learn_from)]
    learn: Option<LearnFrom>,

    /// Keep each robot's memory in this folder, and take up what is there
    #[arg(long, value_name = "DIR", requires = "learn")]
    memory: Option<PathBuf>,

    /// Places the robots, links them, and chooses the gestures
    #[arg(long, default_value_t = 1)]
    seed: u64,

    /// One process for each robot, instead of one for all
    #[arg(long)]
    processes: bool,

    /// Write a picture of what every robot saw in the round they disagreed most about
    #[arg(long, value_name = "FILE.png", conflicts_with = "processes")]
    picture: Option<PathBuf>,

    /// Draw how the swarm got better, as SVG or PNG by the name's ending
    #[arg(long, value_name = "FILE.svg|FILE.png", requires = "learn")]
    curve: Option<PathBuf>,

    /// The swarm's name
    #[arg(long, default_value = "gestalt", value_name = "NAME")]
    swarm: String,

    /// Print one JSON object a line
    #[arg(long)]
    json: bool,
}

/// What opens rounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum By {
    Instructor,
    Motion,
}

/// When the human shows gestures to robots that watch for motion.
const SCHEDULE: Schedule = Schedule { period: Duration::from_secs(6), still: Duration::from_millis(2500) };

fn rule(text: &str) -> Result<FusionRule, String> {
    serde_json::from_value(json!(text)).map_err(|error| error.to_string())
}

fn learn_from(text: &str) -> Result<LearnFrom, String> {
    serde_json::from_value(json!(text)).map_err(|error| error.to_string())
}

/// Runs the verb.
///
/// # Errors
/// Whatever keeps the swarm from starting or the picture from being written.
pub fn run(args: &Args) -> Result<(), Failure> {
    if let Some(picture) = &args.picture {
        // Found out now, not after the last round.
        gestalt_draw::check(picture)?;
    }
    if let Some(curve) = &args.curve {
        gestalt_draw::check(curve)?;
    }
    let section = args.model.clone().map_or(ModelSection::Rendered, ModelSection::File);
    let training = bar("learning", 0);
    let model = crate::model::load(&section, |done, total| {
        training.set_length(total as u64);
        training.set_position(done as u64);
    })?
    .ok_or("a swarm needs a model")?;
    training.finish_and_clear();
    super::runtime()?.block_on(async {
        tokio::select! {
            done = show_gestures(args, &model) => done,
            () = interrupted() => Ok(()),
        }
    })
}

async fn show_gestures(args: &Args, model: &RobotModel) -> Result<(), Failure> {
    let configs = plan(args)?;
    let links = args.topology.links(configs.len(), &mut ChaCha8Rng::seed_from_u64(args.seed));
    let folder = tempfile::tempdir()?;
    let began = Instant::now();
    let starting = bar("starting", configs.len());
    let started = |n| starting.set_position(n as u64);
    let (members, endpoints) = if args.processes {
        let configs = with_model_file(configs.clone(), model, folder.path())?;
        Members::processes(&configs, &links, folder.path(), started).await?
    } else {
        Members::here(&configs, &links, model, started).await?
    };
    starting.finish_and_clear();
    let link = LinkConfig { connect: endpoints[..1].to_vec(), ..LinkConfig::default() };
    let client = Client::open(&args.swarm, &link).await?;
    let mut news = client.news().await?;
    wait_for_all(&client, configs.len()).await?;
    line(
        args.json,
        &json!({"event": "started", "robots": configs.len(), "links": links, "endpoints": endpoints, "seconds": began.elapsed().as_secs_f64()}),
        &format!(
            "{} robots with {} links found each other in {:.1} s; any Zenoh client can attach to {}",
            configs.len(),
            links.len(),
            began.elapsed().as_secs_f64(),
            endpoints.first().map_or("none of them", String::as_str)
        ),
    )?;
    let tally = rounds(args, &configs, &members, &client, &mut news).await;
    client.close().await;
    members.stop().await;
    let tally = tally?;
    if let Some(path) = &args.curve {
        draw_curve(args, path, configs.len(), &tally)?;
    }
    say_score(args, &configs, &tally.score())
}

fn draw_curve(args: &Args, path: &Path, robots: usize, tally: &Tally) -> Result<(), Failure> {
    let from = match args.learn {
        Some(LearnFrom::Model) => "from a model",
        _ => "from nothing",
    };
    let svg = curve::svg(tally, &format!("{robots} robots learn {from}"))?;
    gestalt_draw::write(&svg, path)?;
    let (single, swarm) = curve::latest(tally);
    line(
        args.json,
        &json!({"event": "curve", "file": path, "rounds": tally.history()}),
        &format!(
            "how the swarm got better: {} · over the last {} rounds a single robot {:.0} %, the swarm {:.0} %",
            path.display(),
            curve::WINDOW,
            100.0 * single,
            100.0 * swarm
        ),
    )
}

/// One configuration for each robot: all around one human, listening on a free port of this machine.
fn plan(args: &Args) -> Result<Vec<Config>, Failure> {
    let cameras = args.robots.cameras();
    let schedule = (args.by == By::Motion).then_some(SCHEDULE);
    let mut configs = Vec::with_capacity(cameras.len());
    for (id, (camera, pose)) in (1..).zip(cameras.iter().zip(place(cameras.len(), args.seed))) {
        let mut config = Config::default();
        config.robot.id = RobotId(id);
        config.robot.name = format!("{}-{id}", camera.kind());
        config.swarm.0.clone_from(&args.swarm);
        config.camera = CameraSection {
            model: camera.clone(),
            source: SourceSection::Rendered(RenderedSection { pose, seed: args.seed, schedule }),
            motion: MotionConfig { enabled: args.by == By::Motion, ..MotionConfig::default() },
            ..CameraSection::default()
        };
        config.model = ModelSection::Rendered;
        config.rounds.rule = args.rule;
        if let Some(from) = args.learn {
            let memory = args.memory.as_ref().map(|folder| folder.join(format!("robot-{id}.memory")));
            config.learning = LearningSection {
                enabled: true,
                from,
                memory,
                seed: args.seed,
                ..LearningSection::default()
            };
        }
        config.links.scouting.enabled = false;
        config.zenoh.insert("listen".to_owned(), json!({"endpoints": ["tcp/127.0.0.1:0"]}));
        if !args.processes {
            // Robots of one process live and die together; a short lease would only mistake a busy processor for a
            // lost robot.
            config.zenoh.insert("transport".to_owned(), json!({"link": {"tx": {"lease": 10_000}}}));
        }
        config.validate()?;
        configs.push(config);
    }
    Ok(configs)
}

/// The same configurations, all with this model, written to a file that every process reads.
fn with_model_file(
    mut configs: Vec<Config>,
    model: &RobotModel,
    folder: &Path,
) -> Result<Vec<Config>, Failure> {
    let file = folder.join("swarm.model");
    model.write(&file)?;
    for config in &mut configs {
        config.model = ModelSection::File(file.clone());
    }
    Ok(configs)
}

/// Waits until every robot knows every other.
async fn wait_for_all(client: &Client, robots: usize) -> Result<(), Failure> {
    const PATIENCE: Duration = Duration::from_secs(30);
    let deadline = Instant::now() + PATIENCE;
    loop {
        let statuses = client.statuses(super::ANSWER).await?;
        if statuses.len() == robots && statuses.iter().all(|status| status.alive.len() == robots) {
            return Ok(());
        }
        if Instant::now() > deadline {
            return Err(format!(
                "after {PATIENCE:?} only {} of {robots} robots know all others: is the machine overloaded?",
                statuses.iter().filter(|status| status.alive.len() == robots).count()
            )
            .into());
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
}

/// Shows the gestures, reports each decision, and keeps the score.
async fn rounds(
    args: &Args,
    configs: &[Config],
    members: &Members,
    client: &Client,
    news: &mut News,
) -> Result<Tally, Failure> {
    let human = Human::new(args.seed);
    let mut tally = Tally::new(configs.iter().map(|config| config.robot.id));
    let mut most_disputed = 0;
    for _ in 0..args.rounds {
        let announcement = match args.by {
            By::Instructor => {
                tokio::time::sleep(args.pause).await;
                next_decision(client, news).await?
            }
            By::Motion => next_shown(news).await?,
        };
        let decision = &announcement.decision;
        let shown = match args.by {
            By::Instructor => human.shows(decision.round).gesture,
            By::Motion => human.last_shown(opened(decision), &SCHEDULE),
        };
        let truth = shown.map(ClassId).ok_or("the human showed nothing")?;
        tally.record(truth, decision);
        // The others hold it a moment after the first; what was not held by then is said to be so.
        tokio::time::sleep(Duration::from_millis(300)).await;
        let held = news.holding(decision.round);
        let holding = held.iter().filter(|(_, held)| held.class == decision.class).count();
        let right = decision.class == Some(truth);
        line(
            args.json,
            &json!({"event": "decision", "shown": truth, "right": right, "holding": holding, "decision": announcement}),
            &format!(
                "{} shown {truth} · {} · held by {holding} of {}",
                if right { "✓" } else { "✗" },
                show::decision(decision, announcement.label.as_deref()),
                configs.len()
            ),
        )?;
        if let Some(path) = &args.picture {
            let disputed = 1 + dissenters(members.bodies(), decision);
            if disputed > most_disputed {
                most_disputed = disputed;
                draw(path, configs, members.bodies(), decision, truth)?;
            }
        }
        if args.learn.is_some() {
            teach(args, client, decision.round, truth).await?;
        }
    }
    if let Some(path) = &args.picture {
        line(
            args.json,
            &json!({"event": "picture", "file": path}),
            &format!("what every robot saw: {}", path.display()),
        )?;
    }
    Ok(tally)
}

/// The name that the gestures' shower speaks under.
const INSTRUCTOR: &str = "gestalt-swarm";

/// Has a round opened, and waits for its decision.
async fn next_decision(client: &Client, news: &mut News) -> Result<Announcement, Failure> {
    /// Far beyond any deadline: a round that takes longer will never end.
    const PATIENCE: Duration = Duration::from_secs(30);
    let instructor: InstructorId = INSTRUCTOR.parse()?;
    let before = news.newest();
    let decided = super::open_round(client, news, &instructor, before, PATIENCE).await?;
    decided.ok_or_else(|| format!("no decision within {PATIENCE:?}").into())
}

/// Waits for the decision of the next round that the robots open by themselves.
async fn next_shown(news: &mut News) -> Result<Announcement, Failure> {
    /// Some showings, should none of the robots notice the first.
    const PATIENCE: Duration = Duration::from_secs(30);
    let before = news.newest();
    match tokio::time::timeout(PATIENCE, news.decision_after(before)).await {
        Ok(decided) => decided.ok_or_else(|| "the session has ended".into()),
        Err(_) => Err(format!("no robot opened a round within {PATIENCE:?}").into()),
    }
}

/// When the round of a decision that was announced just now was opened, since 1970.
fn opened(decision: &Decision) -> Duration {
    // Decisions are left a while to meet before one is announced.
    const SETTLED: Duration = Duration::from_millis(300);
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    now.saturating_sub(SETTLED + Duration::from_millis(decision.certificate.elapsed_ms.into()))
}

/// Says what the gesture was, and waits until that is learned.
async fn teach(args: &Args, client: &Client, round: RoundId, truth: ClassId) -> Result<(), Failure> {
    const PATIENCE: Duration = Duration::from_secs(10);
    let instructor: InstructorId = INSTRUCTOR.parse()?;
    let was = Instruction::Was { round, class: Gesture::Class(truth) };
    let answer = client.teach(&instructor, &was, PATIENCE).await?;
    let answer = answer.ok_or_else(|| format!("nobody answered what was said of round {round}"))?;
    line(
        args.json,
        &json!({"event": "taught", "answer": answer}),
        &format!("  taught: {}", answer.outcome.describe()),
    )
}

/// How many robots see it otherwise than the swarm.
fn dissenters(bodies: &[Body], decision: &Decision) -> usize {
    let own = |body: &Body| {
        let seen = body.seen().filter(|seen| seen.round.counter == decision.round.counter)?;
        likeliest(&seen.probabilities(&*body.robot().classifier()?))
    };
    bodies.iter().filter(|body| own(body).map(|(class, _)| class) != decision.class).count()
}

/// The picture of one round.
fn draw(
    path: &Path,
    configs: &[Config],
    bodies: &[Body],
    decision: &Decision,
    truth: ClassId,
) -> Result<(), Failure> {
    let RoundId { counter, .. } = decision.round;
    let seen: Vec<_> =
        bodies.iter().zip(configs).filter_map(|(body, config)| Some((config, body, body.seen()?))).collect();
    let panels: Vec<Panel<'_>> = seen
        .iter()
        .filter(|(_, _, seen)| seen.round.counter == counter)
        .map(|(config, body, seen)| {
            let classifier = body.robot().classifier();
            let label = |class: ClassId| {
                let label = classifier.as_ref().and_then(|known| known.vocabulary().label(class));
                label.map_or_else(|| class.to_string(), str::to_owned)
            };
            let probabilities =
                classifier.as_ref().map(|classifier| seen.probabilities(&**classifier)).unwrap_or_default();
            let opinion = likeliest(&probabilities);
            let by_class = (0u8..).zip(probabilities);
            Panel {
                title: config.name(),
                image: &seen.image,
                opinion: opinion.map(|(class, probability)| (label(class), probability)),
                correct: opinion.map(|(class, _)| Some(class) == decision.class),
                probabilities: by_class.map(|(class, p)| (label(ClassId(class)), p)).collect(),
            }
        })
        .collect();
    let decided = decision.class.map_or("no decision".to_owned(), |class| class.to_string());
    let headline = format!(
        "round {counter}: shown {truth}, the swarm decides {decided} ({:.3}, {} robots, {} ms)",
        decision.confidence,
        decision.certificate.votes.len(),
        decision.certificate.elapsed_ms
    );
    Ok(gestalt_draw::write(&picture::round(&panels, &headline)?, path)?)
}

fn say_score(args: &Args, configs: &[Config], score: &Score) -> Result<(), Failure> {
    let percent = |p: &Option<Proportion>| match p {
        Some(p) => format!("{:.1} % [{:.1}, {:.1}]", 100.0 * p.value, 100.0 * p.low, 100.0 * p.high),
        None => "not measured".to_owned(),
    };
    let each: BTreeMap<RobotId, String> =
        configs.iter().map(|config| (config.robot.id, config.name())).collect();
    let each: Vec<String> = score
        .robots
        .iter()
        .filter_map(|(robot, accuracy)| Some(format!("{} {:.0} %", each.get(robot)?, 100.0 * accuracy)))
        .collect();
    line(
        args.json,
        &json!({"event": "score", "score": score}),
        &format!(
            "score over {} rounds: a single robot {} · the swarm {} · undecided {}\neach robot: {}",
            score.rounds,
            percent(&score.single),
            percent(&score.swarm),
            score.undecided,
            each.join(", ")
        ),
    )
}
