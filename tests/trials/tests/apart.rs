//! What trials may do to their process and to the machine without harm to any other.

use std::path::PathBuf;
use std::process::{Command, ExitCode, Output, Stdio};
use std::time::{Duration, Instant};

/// Names the folder of notes, and makes this program a table of the bad trials.
const BAD: &str = "GESTALT_BAD_TRIALS";

fn main() -> ExitCode {
    if std::env::var_os(BAD).is_some() {
        return gestalt_trials::run_in_real_time(gestalt_trials::trials![
            [Waits] bad::aborts,
            [Waits] bad::leaves_a_process,
            [Waits] bad::passes,
            [Waits] bad::passes_the_second_time,
            [Waits] bad::waits_with_a_process,
        ]);
    }
    gestalt_trials::run(gestalt_trials::trials![
        [Works] one_that_ends_its_process_fails_by_name_and_no_other_with_it,
        [Works] what_one_leaves_behind_ends_with_it,
        [Works] what_fails_and_then_passes_alone_is_told_so,
        [Works] a_runner_that_is_killed_leaves_nothing,
    ])
}

/// What no trial should do.
mod bad {
    use std::path::Path;
    use std::process::Command;
    use std::time::Duration;

    pub fn aborts() {
        std::process::abort();
    }

    pub fn passes() {}

    #[expect(clippy::zombie_processes, reason = "to leave it is the point")]
    pub fn leaves_a_process() {
        let process = Command::new("sleep").arg("1000").spawn().unwrap();
        write("left", &process.id().to_string());
    }

    pub fn waits_with_a_process() {
        leaves_a_process();
        std::thread::sleep(Duration::from_secs(1000));
    }

    pub fn passes_the_second_time() {
        let again = notes().join("again").exists();
        write("again", "");
        assert!(again, "not yet\nand more");
    }

    fn notes() -> std::path::PathBuf {
        Path::new(&std::env::var_os(super::BAD).unwrap()).to_owned()
    }

    /// All of it or nothing.
    fn write(name: &str, text: &str) {
        std::fs::write(notes().join("new"), text).unwrap();
        std::fs::rename(notes().join("new"), notes().join(name)).unwrap();
    }
}

struct Runner(tempfile::TempDir);

impl Runner {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn of(&self, trials: &[&str]) -> Command {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(trials).arg("--exact").env(BAD, self.0.path()).env_remove("GESTALT_STRICT");
        command
    }

    /// Waits for the end of both of its pipes, too: nothing may hold them.
    fn run(&self, trial: &str) -> (Output, String) {
        let output = self.of(&[trial]).output().unwrap();
        let printed = String::from_utf8_lossy(&output.stdout).into_owned();
        (output, printed)
    }

    /// The process that a trial has left, once it has.
    fn left(&self) -> PathBuf {
        let note = self.0.path().join("left");
        soon(|| note.exists(), "the trial starts its process");
        PathBuf::from("/proc").join(std::fs::read_to_string(note).unwrap())
    }
}

fn soon(holds: impl Fn() -> bool, what: &str) {
    let began = Instant::now();
    while !holds() {
        assert!(began.elapsed() < Duration::from_secs(30), "{what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn one_that_ends_its_process_fails_by_name_and_no_other_with_it() {
    let output = Command::new(std::env::current_exe().unwrap())
        .args(["--skip", "process", "--skip", "second"])
        .env(BAD, tempfile::tempdir().unwrap().path())
        .output()
        .unwrap();
    let printed = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(101), "{printed}");
    assert!(printed.contains("1 passed; 1 failed"), "{printed}");
    assert!(printed.contains("failed: bad::aborts: its process ended with signal: 6"), "{printed}");
}

fn what_one_leaves_behind_ends_with_it() {
    let runner = Runner::new();
    let (output, printed) = runner.run("bad::leaves_a_process");
    assert!(output.status.success(), "{printed}");
    let left = runner.left();
    soon(|| !left.exists(), "what it left is ended");
}

fn what_fails_and_then_passes_alone_is_told_so() {
    let (output, printed) = Runner::new().run("bad::passes_the_second_time");
    assert!(output.status.success(), "{printed}");
    let told = "flaky: bad::passes_the_second_time: passed alone, after it failed with: not yet\n";
    assert!(printed.contains(told), "{printed}");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("and more"), "what it printed is shown: {said}");
}

fn a_runner_that_is_killed_leaves_nothing() {
    let runner = Runner::new();
    let mut running = runner.of(&["bad::waits_with_a_process"]).stdout(Stdio::null()).spawn().unwrap();
    let left = runner.left();
    assert!(left.exists());
    running.kill().unwrap();
    running.wait().unwrap();
    soon(|| !left.exists(), "it ends with the runner");
}
