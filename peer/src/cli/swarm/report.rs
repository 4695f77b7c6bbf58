//! What the rounds gave: the score, and the learning curve.

use std::collections::BTreeMap;
use std::path::Path;

use gestalt_protocol::RobotId;
use gestalt_strategies::Proportion;
use serde_json::json;

use super::super::Failure;
use super::super::show::{counted, line};
use super::Args;
use crate::config::{Config, LearnFrom};
use crate::swarm::{Score, Tally, curve};

/// Says all that there is to say of the rounds so far: nothing when there were none.
pub(super) fn all(args: &Args, configs: &[Config], tally: &Tally) -> Result<(), Failure> {
    let score = tally.score();
    if score.rounds == 0 && score.missed == 0 {
        return Ok(());
    }
    let drawn = args.curve.as_ref().map_or(Ok(()), |path| draw_curve(args, path, configs.len(), tally));
    say_score(args, configs, &score).and(drawn)
}

fn draw_curve(args: &Args, path: &Path, robots: usize, tally: &Tally) -> Result<(), Failure> {
    let from = match args.learn {
        Some(LearnFrom::Model) => "starting from a trained model",
        _ => "starting from nothing",
    };
    let svg = curve::svg(tally, &format!("Learning curve: {robots} robots {from}"))?;
    gestalt_draw::write(&svg, path)?;
    let (single, swarm) = curve::latest(tally);
    line(
        args.json,
        &json!({"event": "curve", "file": path, "rounds": tally.history()}),
        &format!(
            "learning curve: {} · last {} rounds: single robot {:.0} %, swarm {:.0} %",
            path.display(),
            curve::WINDOW.min(tally.history().len()),
            100.0 * single,
            100.0 * swarm
        ),
    )
}

fn say_score(args: &Args, configs: &[Config], score: &Score) -> Result<(), Failure> {
    let percent = |p: &Option<Proportion>| match p {
        Some(p) => format!("{:.1} % [{:.1}, {:.1}]", 100.0 * p.value, 100.0 * p.low, 100.0 * p.high),
        None => "n/a".to_owned(),
    };
    let each: BTreeMap<RobotId, String> =
        configs.iter().map(|config| (config.robot.id, config.name())).collect();
    let each: Vec<String> = score
        .robots
        .iter()
        .filter_map(|(robot, accuracy)| Some(format!("{} {:.0} %", each.get(robot)?, 100.0 * accuracy)))
        .collect();
    let missed = if score.missed == 0 { String::new() } else { format!(" · missed {}", score.missed) };
    line(
        args.json,
        &json!({"event": "score", "score": score}),
        &format!(
            "accuracy over {}: single robot {} · swarm {}\nthe swarm decided {} of them{missed}, rightly {}\nper robot: {}",
            counted(score.rounds as usize, "round"),
            percent(&score.single),
            percent(&score.swarm),
            score.rounds - score.undecided,
            percent(&score.decided),
            each.join(", ")
        ),
    )
}
