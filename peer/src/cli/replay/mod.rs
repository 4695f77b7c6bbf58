//! `gestalt replay`: what a recording proves, and what would have been.

mod play;
mod table;
mod variants;

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use gestalt_protocol::{FusionRule, RobotId};
use gestalt_strategies::{MindConfig, Quorum};
use gestalt_tape::{Condition, Proof, ROUNDS, Run, prove, read, rounds_of};
use serde_json::json;

use super::Failure;
use super::config_args::ConfigArgs;
use super::show::{counted, line};
use variants::Axis;

/// Prove the decisions of a recording again, and count its votes by other rules
///
/// Each recorded decision is drawn again from its votes, bit for bit; the first difference is named. With --rule, --quorum and the like
/// the same votes are counted otherwise, and a table compares that with what people said and with what happened. With --play the
/// recording is said again on Zenoh, under another swarm's name.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt replay run.mcap --sweep rule,quorum
  gestalt replay run.mcap --play --speed 4 -l tcp/127.0.0.1:7447")]
pub struct Args {
    /// Recording, as `gestalt record` writes it
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,

    #[command(flatten)]
    config: ConfigArgs,

    /// What if votes were fused by this rule? Several: separated by commas, as for each of these flags; all combinations are counted
    #[arg(long, value_name = "RULE,…", value_delimiter = ',', value_parser = variants::rule)]
    rule: Vec<FusionRule>,

    /// What if so many robots were needed: `majority`, or a number
    #[arg(long, value_name = "N,…", value_delimiter = ',', value_parser = variants::quorum)]
    quorum: Vec<Quorum>,

    /// What if a decision needed 1 − α
    #[arg(long, value_name = "A,…", value_delimiter = ',')]
    alpha: Vec<f64>,

    /// What if so many liars were expected
    #[arg(long, value_name = "F,…", value_delimiter = ',')]
    liars: Vec<u32>,

    /// What if this robot had not been there; repeatable
    #[arg(long, value_name = "ROBOT")]
    without: Vec<RobotId>,

    /// What if it were decided by what was heard so many milliseconds after the opening
    #[arg(long, value_name = "MS,…", value_delimiter = ',')]
    until: Vec<u64>,

    /// Count with all values of these: rule, quorum, alpha, liars, until, robots (each left out once)
    #[arg(long, value_name = "WHAT,…", value_delimiter = ',')]
    sweep: Vec<Axis>,

    /// Say it all again on Zenoh, at the endpoints of --listen
    #[arg(long, conflicts_with_all = ["rule", "quorum", "alpha", "liars", "without", "until", "sweep"])]
    play: bool,

    /// How many times as fast; 0: as fast as possible
    #[arg(long, default_value_t = 1.0, value_name = "TIMES", requires = "play", value_parser = variants::speed)]
    speed: f64,

    /// Name of the swarm under which it is said [default: that of the recording, and `-replay`]
    #[arg(long = "as", value_name = "NAME", requires = "play")]
    name: Option<String>,

    /// Print JSON Lines, one object per line
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
///
/// # Errors
/// When the recording cannot be read or is damaged, or a decision is another one when it is drawn again.
pub fn run(args: &Args) -> Result<(), Failure> {
    if args.play {
        return play::run(args);
    }
    let mut run = Run::default();
    let condition = read(&mut open(&args.file)?, |recorded| run.add(&recorded))?;
    tell(args, &run, &condition)?;
    let config = configured(args, &run, &condition)?;
    let proof = prove(&run.showings, &config);
    let proven = told(args, &proof);
    table::all(args, &run, &config)?;
    proven?;
    match condition.damage.len() as u64 + condition.more_damage {
        0 => Ok(()),
        places => {
            Err(format!("{} is damaged at {}", args.file.display(), counted(places as usize, "place")).into())
        }
    }
}

fn open(path: &Path) -> Result<BufReader<File>, Failure> {
    Ok(BufReader::new(File::open(path).map_err(|error| format!("{}: {error}", path.display()))?))
}

/// What the recording is, and what is wrong with it.
fn tell(args: &Args, run: &Run, condition: &Condition) -> Result<(), Failure> {
    // As the recorder counts them.
    let of_swarm = run.messages.iter().filter(|(kind, _)| !kind.is_recorders()).map(|(_, count)| count);
    let words = format!(
        "{}: {}, {}, {}",
        args.file.display(),
        counted(of_swarm.sum::<u64>() as usize, "message"),
        counted(run.showings.len(), "round"),
        counted(run.robots().len(), "robot")
    );
    let object = json!({
        "event": "recording", "file": args.file, "messages": run.messages, "rounds": run.showings.len(),
        "robots": run.robots(), "about": condition.about, "end": condition.end, "torn": condition.torn,
        "damage": condition.damage, "strange": run.strange,
    });
    line(args.json, &object, &words)?;
    if args.json {
        return Ok(());
    }
    let mut remarks = condition.remarks();
    remarks.extend(missing(condition));
    if run.strange > 0 {
        remarks.push(format!(
            "{} of another form than recorders write were passed over",
            counted(run.strange as usize, "message")
        ));
    }
    remarks.iter().try_for_each(|remark| line(false, &json!(null), remark))
}

/// What the recorder said at its end that it lost.
fn missing(condition: &Condition) -> Option<String> {
    let number = |name: &str| condition.end.as_ref()?.get(name)?.parse::<u64>().ok();
    let parts = [("dropped", "dropped"), ("lost", "lost"), ("unattached_ms", "ms attached to no robot")];
    let lost =
        parts.iter().filter_map(|(name, words)| Some((number(name)?, words))).filter(|(count, _)| *count > 0);
    let lost: Vec<String> = lost.map(|(count, words)| format!("{count} {words}")).collect();
    (!lost.is_empty()).then(|| format!("the recorder missed some: {}", lost.join(", ")))
}

/// By what the robots decided: by the configuration given, else by what the recording says, else by the defaults and the quorum that
/// its decisions name. The rule is that of its decisions.
fn configured(args: &Args, run: &Run, condition: &Condition) -> Result<MindConfig, Failure> {
    let given = args.config.config.is_some() || !args.config.cfg.is_empty();
    let recorded = rounds_of(&condition.about);
    if recorded.is_none() && condition.about.contains_key(ROUNDS) {
        tracing::warn!("the recording names a configuration of rounds that this program does not understand");
    }
    let mut config = match (given, recorded) {
        (true, _) => args.config.load()?.rounds,
        (false, Some(recorded)) => recorded,
        (false, None) => {
            let quorum = run.quorum().unwrap_or(MindConfig::default().quorum);
            MindConfig { quorum, ..MindConfig::default() }
        }
    };
    if let Some(decision) = run.showings.iter().find_map(|showing| showing.decision()) {
        config.rule = decision.certificate.rule;
    }
    Ok(config)
}

/// What came of drawing the decisions again.
fn told(args: &Args, proof: &Proof) -> Result<(), Failure> {
    let all = proof.reproduced + proof.differences.len() as u64;
    let votes = format!(
        "{} of {} were recorded as they were cast",
        proof.heard,
        counted((proof.heard + proof.unheard) as usize, "vote")
    );
    let words = format!(
        "{} of {} reproduced bit for bit · {votes}",
        proof.reproduced,
        counted(all as usize, "decision")
    );
    line(args.json, &json!({"event": "proof", "proof": proof}), &words)?;
    if !args.json {
        proof
            .differences
            .iter()
            .try_for_each(|difference| line(false, &json!(null), &difference.to_string()))?;
    }
    match proof.differences.first() {
        None => Ok(()),
        Some(first) => Err(first.to_string().into()),
    }
}
