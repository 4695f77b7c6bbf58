//! `gestalt doctor`: what is wrong with this robot and its swarm, and how to mend it.

use std::path::PathBuf;

use serde_json::json;

use super::Failure;
use super::config_args::{ConfigArgs, SWARM, Setting};
#[cfg(feature = "opencv")]
use super::robot_args::{CameraArgs, IdentityArgs, ModelArgs};
use super::show::{counted, line};
use crate::config::{Config, ConfigError};
use crate::doctor::gather::{Subject, gather};
use crate::doctor::{Finding, Severity, robot, swarm};

/// Say what is wrong with a robot and its swarm, why it matters, and how to mend it. Exit status: 0 when nothing that is needed
/// fails, 1 otherwise
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt doctor robot.json5
  gestalt doctor --swarm demo -e tcp/192.168.1.5:7447")]
pub struct Args {
    /// The robot's configuration; without one, and without flags that describe a robot, only the swarm is looked at
    #[arg(value_name = "CONFIG", conflicts_with = "config")]
    file: Option<PathBuf>,

    #[command(flatten)]
    config: ConfigArgs,

    #[cfg(feature = "opencv")]
    #[command(flatten)]
    identity: IdentityArgs,

    #[cfg(feature = "opencv")]
    #[command(flatten)]
    camera: CameraArgs,

    #[cfg(feature = "opencv")]
    #[command(flatten)]
    model: ModelArgs,

    /// Print the findings as one JSON object
    #[arg(long)]
    json: bool,
}

impl Args {
    /// What the flags say of the robot itself.
    #[cfg(feature = "opencv")]
    fn settings(&self) -> Result<Vec<Setting>, String> {
        let camera = self.camera.settings().map_err(|error| error.to_string())?;
        Ok([self.identity.settings(), camera, self.model.settings()].concat())
    }

    #[cfg(not(feature = "opencv"))]
    fn settings(&self) -> Result<Vec<Setting>, String> {
        Ok(Vec::new())
    }

    fn subject(&self) -> Subject {
        let mut flags = self.config.clone();
        flags.config = flags.config.or_else(|| self.file.clone());
        let file = flags.config.as_ref().map(|path| path.display().to_string());
        let by_flags = || Some("the flags".to_owned());
        let words = |error: &ConfigError| error.to_string();
        let read = self.settings().and_then(|settings| {
            let describes = !settings.is_empty();
            let document = flags.document(settings).map_err(|error| words(&error))?;
            Ok((document, describes))
        });
        let (document, describes) = match read {
            Ok(read) => read,
            Err(cause) => {
                let file = file.or_else(by_flags);
                return Subject { file, unreadable: Some(cause), config: None, problems: Vec::new() };
            }
        };
        let is_named = document.says(SWARM);
        let (mut config, mut problems) = document.meaning_in_part::<Config>();
        // Who looks at a swarm alone is its client.
        if let Some(config) = config.as_mut().filter(|_| file.is_none() && !describes) {
            match config.trust.client_swarm(is_named.then_some(config.swarm.0.as_str())) {
                Ok(swarm) => config.swarm.0 = swarm.unwrap_or_else(|| config.swarm.0.clone()),
                Err(error) => {
                    let unreadable = Some(error.to_string());
                    return Subject { file: by_flags(), unreadable, config: None, problems: Vec::new() };
                }
            }
        }
        problems.extend(config.iter().flat_map(Config::problems));
        let problems: Vec<String> = problems.iter().map(words).collect();
        // What is wrong with flags is said, be there a robot or not.
        let file = if describes || !problems.is_empty() { file.or_else(by_flags) } else { file };
        Subject { file, unreadable: None, config, problems }
    }
}

/// Runs the verb.
///
/// # Errors
/// When anything that is needed fails: how much of it.
pub fn run(args: &Args) -> Result<(), Failure> {
    let subject = args.subject();
    let (about_robot, about_swarm) = super::runtime()?.block_on(gather(&subject));
    let mut findings = robot::findings(&about_robot);
    findings.extend(about_swarm.iter().flat_map(swarm::findings));
    let count = |severity| findings.iter().filter(|finding| finding.severity == severity).count();
    let (failures, warnings) = (count(Severity::Failure), count(Severity::Warning));
    let sum = format!("{}, {}", counted(failures, "failure"), counted(warnings, "warning"));
    let mut words: Vec<String> = findings.iter().map(in_words).collect();
    words.push(if failures + warnings == 0 { "all is well".to_owned() } else { sum.clone() });
    line(args.json, &json!({"healthy": failures == 0, "findings": findings}), &words.join("\n"))?;
    if failures == 0 { Ok(()) } else { Err(format!("{sum}; each names its fix").into()) }
}

/// A finding in words: one line, or three with why it matters and what to do.
fn in_words(finding: &Finding) -> String {
    let Finding { check, severity, what, why, fix } = finding;
    let what = super::clean(what);
    match severity {
        Severity::Fine => format!("✓ {check:13} {what}"),
        Severity::Warning => {
            format!("! {check:13} {what}\n{:15} why: {why}\n{:15} fix: {}", "", "", super::clean(fix))
        }
        Severity::Failure => {
            format!("✗ {check:13} {what}\n{:15} why: {why}\n{:15} fix: {}", "", "", super::clean(fix))
        }
    }
}
