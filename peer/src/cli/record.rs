//! `gestalt record`: a running swarm into a file.

use std::path::{Path, PathBuf};
use std::pin::pin;
use std::time::{Duration, Instant};

use gestalt_tape::{Kind, Ledger};
use serde_json::json;

use super::config_args::ConfigArgs;
use super::show::{counted, line};
use super::watch::nobody;
use super::{Failure, interrupted};
use crate::recording::{Recording, RecordingPlan};

/// Record a running swarm into an MCAP file, which Foxglove, Rerun, PlotJuggler and `gestalt replay` open
///
/// Votes, samples, decisions, feedback, answers, statuses and robots that come and go. Ends at Ctrl-C. A recorder that is too slow
/// holds up nobody: what it drops is counted, said, and written into the file.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt record run.mcap -e tcp/192.168.1.5:7447
  gestalt record run.mcap -c configs/footbot.json5 --for 10m --frames")]
pub struct Args {
    /// New file to write
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,

    #[command(flatten)]
    config: ConfigArgs,

    /// Stop after this long
    #[arg(long = "for", value_name = "DURATION", value_parser = super::duration)]
    time: Option<Duration>,

    /// Stop after this many decisions
    #[arg(long, value_name = "N")]
    rounds: Option<u64>,

    /// Record the pictures that robots stream, too
    #[arg(long)]
    frames: bool,

    /// Print JSON Lines, one object per line
    #[arg(long)]
    json: bool,
}

/// How often it is looked whether the recording is over.
const LOOK: Duration = Duration::from_millis(100);

/// Runs the verb.
///
/// # Errors
/// When no robot is reached or heard of, the file is there already, or the disk takes no more.
pub fn run(args: &Args) -> Result<(), Failure> {
    let (swarm, link) = args.config.client()?;
    // Without a file or a flag that says so, the rounds of the swarm's robots are not known here.
    let says = args.config.config.is_some() || !args.config.cfg.is_empty();
    let rounds = if says { Some(args.config.load()?.rounds) } else { None };
    super::runtime()?.block_on(async {
        let plan = RecordingPlan {
            swarm: &swarm,
            link: &link,
            file: &args.file,
            rounds: rounds.as_ref(),
            frames: args.frames,
        };
        let recording = Recording::start(plan).await?;
        let words = format!("recording swarm \"{swarm}\" into {}; Ctrl-C ends it", args.file.display());
        line(args.json, &json!({"event": "recording", "swarm": swarm, "file": args.file}), &words)?;
        let began = Instant::now();
        let mut interrupted = pin!(interrupted());
        loop {
            let over = args.time.is_some_and(|time| began.elapsed() >= time)
                || args.rounds.is_some_and(|rounds| decisions(&recording.ledger()) >= rounds);
            if over || recording.has_failed() {
                break;
            }
            tokio::select! {
                () = &mut interrupted => break,
                () = tokio::time::sleep(LOOK) => {}
            }
        }
        let ledger = recording.finish().await?;
        keep_heard(&args.file, &ledger, &swarm, link.credentials.is_some())?;
        report(args.json, &args.file, &ledger)
    })
}

/// As [`check_heard`], and a recording of nobody goes again: it would keep the next one from its name.
fn keep_heard(file: &Path, ledger: &Ledger, swarm: &str, is_sealed: bool) -> Result<(), Failure> {
    check_heard(ledger, swarm, is_sealed).inspect_err(|_| {
        let _ = std::fs::remove_file(file);
    })
}

/// Whether anybody was heard of: robots say that they are there, though nothing happens.
fn check_heard(ledger: &Ledger, swarm: &str, is_sealed: bool) -> Result<(), Failure> {
    if Ledger::total(&ledger.received) == 0 { Err(nobody(swarm, is_sealed).into()) } else { Ok(()) }
}

fn decisions(ledger: &Ledger) -> u64 {
    ledger.received.get(&Kind::Decision).copied().unwrap_or_default()
}

/// Says what a recording came to.
pub(super) fn report(as_json: bool, file: &Path, ledger: &Ledger) -> Result<(), Failure> {
    let words = format!(
        "recorded: {} · {}, {} of them, {:.1} MB · {}",
        file.display(),
        counted(Ledger::total(&ledger.written) as usize, "message"),
        counted(ledger.written.get(&Kind::Decision).copied().unwrap_or_default() as usize, "decision"),
        ledger.bytes as f64 / 1e6,
        ledger.missing().unwrap_or_else(|| "nothing was lost".to_owned())
    );
    line(as_json, &json!({"event": "recorded", "file": file, "ledger": ledger}), &words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_of_nothing_is_an_error_that_says_why() {
        let mut ledger = Ledger::default();
        let of =
            |ledger: &Ledger, is_sealed| check_heard(ledger, "demo", is_sealed).map_err(|no| no.to_string());
        assert!(of(&ledger, false).is_err_and(|no| no.contains("\"demo\"") && !no.contains("roster")));
        assert!(of(&ledger, true).is_err_and(|no| no.contains("not on the roster any more")));
        ledger.received.insert(Kind::Decision, 1);
        assert_eq!(of(&ledger, true), Ok(()));
    }

    #[test]
    fn a_recording_of_nobody_leaves_its_name_free() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("run.mcap");
        let mut ledger = Ledger::default();
        std::fs::write(&file, "a recording").unwrap();
        assert!(keep_heard(&file, &ledger, "demo", false).is_err() && !file.exists());
        std::fs::write(&file, "a recording").unwrap();
        ledger.received.insert(Kind::Status, 1);
        assert!(keep_heard(&file, &ledger, "demo", false).is_ok() && file.exists());
    }
}
