//! A trial in a process of its own: whatever it does to its process ends with it, and no other trial is in it.
//!
//! What Zenoh keeps for all sessions of a process (its threads, above all) is then one trial's alone; a signal that ends the
//! process fails one trial; and one that hangs can be ended, with the robots it has started. What it prints goes to a file,
//! and is shown if it fails: a pipe would be held open by whatever it leaves behind.

use std::fs::File;
use std::io::{Read, Seek};
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitCode, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, getppid, kill_current_process_group, kill_process_group};

/// The first word of the command line of a process that is to run one trial, and to be it: `--trial NAME`. It is for debuggers
/// too.
const TRIAL: &str = "--trial";

/// Begins the line in which that process says what the trial failed with.
const FAILED: &str = "the trial failed: ";

/// How often one looks whether the other process is still there.
const LOOK: Duration = Duration::from_millis(20);

/// The trial this process is to be.
pub(crate) fn ordered() -> Option<String> {
    let mut words = std::env::args().skip(1);
    (words.next()? == TRIAL).then(|| words.next()).flatten()
}

/// Is it.
pub(crate) fn be(run: impl FnOnce() -> Result<(), String>) -> ExitCode {
    std::thread::spawn(|| end_with_the_parent(getppid()));
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(cause) => {
            eprintln!("{FAILED}{cause}");
            ExitCode::from(101)
        }
    }
}

/// A runner that is killed ends no trial; without this it and its robots would stay.
fn end_with_the_parent(parent: Option<Pid>) {
    while getppid() == parent {
        std::thread::sleep(LOOK);
    }
    // It ends the caller too.
    let _ = kill_current_process_group(Signal::KILL);
}

/// Runs the trial of that name in a process of its own for `patience` at most, and ends all that it leaves behind. With `shown`,
/// it prints where this process does.
///
/// # Errors
/// With what it failed with; what it printed is on stderr then.
pub(crate) fn run(name: &str, patience: Option<Duration>, shown: bool) -> Result<(), String> {
    let unable = |error: std::io::Error| format!("no process for the trial: {error}");
    let mut command = Command::new(std::env::current_exe().map_err(unable)?);
    command.args([TRIAL, name]).stdin(Stdio::null()).process_group(0);
    let mut printed = None;
    if !shown {
        let file = tempfile::tempfile().map_err(unable)?;
        command.stdout(file.try_clone().map_err(unable)?).stderr(file.try_clone().map_err(unable)?);
        printed = Some(file);
    }
    let mut child = command.spawn().map_err(unable)?;
    let group = Pid::from_child(&child);
    let ended = wait(&mut child, patience).map_err(unable)?;
    // Nobody is left in most groups.
    let _ = kill_process_group(group, Signal::KILL);
    if ended.is_none() {
        child.wait().map_err(unable)?;
    }
    let cause = match ended {
        Some(status) if status.success() => return Ok(()),
        Some(status) => format!("its process ended with {status}"),
        None => format!("stuck: not ended within {:?}", patience.unwrap_or_default()),
    };
    let printed = printed.map_or_else(String::new, read);
    eprint!("\n--- {name} printed:\n{printed}--- and no more: {cause}\n");
    let said = printed.rsplit_once(FAILED).map(|(_, said)| said.trim_end());
    Err(said.map_or(cause, str::to_owned))
}

fn wait(child: &mut Child, patience: Option<Duration>) -> std::io::Result<Option<ExitStatus>> {
    let began = Instant::now();
    loop {
        let ended = child.try_wait()?;
        if ended.is_some() || patience.is_some_and(|patience| began.elapsed() > patience) {
            return Ok(ended);
        }
        std::thread::sleep(LOOK);
    }
}

/// All that was written to it.
fn read(mut file: File) -> String {
    let mut bytes = Vec::new();
    // What cannot be read back is not worth another error.
    let _ = file.rewind().and_then(|()| file.read_to_end(&mut bytes));
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_has_not_ended_in_time_is_waited_for_no_longer() {
        let mut child = Command::new("sleep").arg("1000").spawn().unwrap();
        assert_eq!(wait(&mut child, Some(Duration::from_millis(50))).unwrap(), None);
        child.kill().unwrap();
        assert!(wait(&mut child, None).unwrap().is_some(), "killed, it has ended");
    }
}
