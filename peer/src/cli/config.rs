//! `gestalt config`: is this configuration one that a robot can start with?

use std::path::PathBuf;

use serde_json::json;

use super::Failure;
use super::show::{clean, counted, line};
use crate::config::{Config, ConfigError, Document, Override, TEMPLATE};

/// Print a commented configuration template, or check a file
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt config > robot.json5
  gestalt config --check robot.json5 --cfg rounds.deadline:8s")]
pub struct Args {
    /// Check this file, and the files that it names, and exit: 0 if a robot can start with it; without it, print the
    /// commented template
    #[arg(long, value_name = "FILE")]
    check: Option<PathBuf>,

    /// Override one key before checking: `rounds.deadline:8s` (repeatable)
    #[arg(long, value_name = "KEY:VALUE", requires = "check")]
    cfg: Vec<Override>,

    /// Print the result as JSON; without a file, the defaults without comments
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
///
/// # Errors
/// What is wrong with the file, by key.
pub fn run(args: &Args) -> Result<(), Failure> {
    let Some(path) = &args.check else {
        let defaults = || serde_json::to_string_pretty(&Config::default());
        return super::say(&if args.json { format!("{}\n", defaults()?) } else { TEMPLATE.to_owned() });
    };
    let mut document = Document::read(path)?;
    for change in &args.cfg {
        document.apply(change, Config::SECTIONS)?;
    }
    let (config, problems) = check(document);
    if let (Some(config), []) = (&config, problems.as_slice()) {
        let (id, name, swarm) = (config.robot.id, config.name(), &config.swarm.0);
        let words = format!("{}: OK: robot {id} \"{}\", swarm \"{swarm}\"", path.display(), clean(&name));
        return line(args.json, &json!({"file": path, "valid": true, "config": config}), &words);
    }
    let problems: Vec<String> = problems.iter().map(ToString::to_string).collect();
    let words: Vec<String> = problems.iter().map(|problem| clean(problem)).collect();
    line(args.json, &json!({"file": path, "valid": false, "problems": problems}), &words.join("\n"))?;
    Err(format!("{}: {}", path.display(), counted(problems.len(), "problem")).into())
}

#[cfg(feature = "opencv")]
fn check(document: Document) -> (Option<Config>, Vec<ConfigError>) {
    crate::config::check::problems(document)
}

/// Without cameras there is nothing to look into files with.
#[cfg(not(feature = "opencv"))]
fn check(document: Document) -> (Option<Config>, Vec<ConfigError>) {
    let (config, mut found) = document.meaning_in_part::<Config>();
    found.extend(config.iter().flat_map(Config::problems));
    (config, found)
}
