//! `gestalt config`: is this configuration one that a robot can start with?

use std::path::PathBuf;

use serde_json::json;

use super::Failure;
use super::show::line;
use crate::config::Config;

/// Checks a robot's configuration, or prints the default one.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The file to check; without it, every key with its default is printed
    #[arg(long, value_name = "FILE")]
    check: Option<PathBuf>,

    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
///
/// # Errors
/// What is wrong with the file, by key.
pub fn run(args: &Args) -> Result<(), Failure> {
    let Some(path) = &args.check else {
        return super::say(&format!("{}\n", serde_json::to_string_pretty(&Config::default())?));
    };
    let config = Config::read(path)?;
    let words = format!("{}: fit for {} of swarm '{}'", path.display(), config.name(), config.swarm.0);
    line(args.json, &json!({"file": path, "valid": true, "config": config}), &words)
}
