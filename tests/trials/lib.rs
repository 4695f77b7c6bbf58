//! Tests that need something of the machine they run on.
//!
//! A test that cannot run here must not pass: it is *ignored*, by name and with the reason. And tests that mostly wait need
//! not wait one after the other. So such test binaries have `harness = false` and a table of [`Trial`]s as their `main`; they
//! understand the arguments of any other test binary (`cargo test -p gestalt-tests --test swarm line`).
//!
//! - [`Need`]: what a trial needs of the machine. With `GESTALT_REQUIRE=namespaces,queues,mount,browser,data` a machine without it fails.
//! - [`Load`]: how much of the processor it takes, so that what waits runs side by side and what computes does not disturb it.
//! - [`run_in_real_time`]: trials whose clock is the machine's, each in a process of its own. One that fails is tried once more,
//!   alone, and both are told.

mod apart;
mod attempts;
mod load;
mod needs;

use std::collections::BTreeMap;
use std::process::ExitCode;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use libtest_mimic::{Arguments, Conclusion, Failed};

use attempts::Attempts;
pub use load::Load;
use load::Room;
pub use needs::{Need, axe, data, python};

/// One test of the table.
pub struct Trial {
    name: String,
    load: Load,
    needs: Vec<Need>,
    run: Box<dyn Fn() + Send>,
}

impl Trial {
    /// A test of that name, which passes unless it panics.
    #[must_use]
    pub fn new(name: &str, load: Load, needs: &[Need], run: impl Fn() + Send + 'static) -> Self {
        Self { name: name.to_owned(), load, needs: needs.to_vec(), run: Box::new(run) }
    }
}

/// A table of [`Trial`]s, one a line: `[Load, needs…] module::function`, with `.await` after an asynchronous one. A trial is
/// named by its path.
///
/// ```text
/// trials![
///     [Waits, Namespaces] line::the_eighth_in_a_line_decides,
///     [Works] cameras::a_camera_that_hangs_keeps_nobody.await,
/// ]
/// ```
#[macro_export]
macro_rules! trials {
    (@call $($path:ident)::+) => { || $($path)::+() };
    (@call $($path:ident)::+ . $await:ident) => { || $crate::block_on($($path)::+()) };
    ($([$load:ident $(, $need:ident)*] $first:ident $(:: $second:ident)? $(. $await:ident)?),* $(,)?) => {
        vec![$($crate::Trial::new(
            concat!(stringify!($first) $(, "::", stringify!($second))?),
            $crate::Load::$load,
            &[$($crate::Need::$need),*],
            $crate::trials!(@call $first $(:: $second)? $(. $await)?),
        )),*]
    };
}

/// Runs an asynchronous trial on threads of its own; what it leaves behind ends with it.
///
/// # Panics
/// When it does, and when there are no threads.
pub fn block_on(trial: impl Future<Output = ()>) {
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build();
    runtime.expect("threads for the trial").block_on(trial);
}

/// How long the slowest trial may take before it counts as stuck: several times what it takes on a busy machine. With
/// `GESTALT_LONG` set, trials run for as long as they are told to.
const STUCK: Duration = Duration::from_secs(400);

/// How many of the slowest trials are listed.
const LISTED: usize = 10;

/// When each trial that runs has begun, how long each that ended has taken, what those failed with that failed, and what those that
/// passed at a second attempt first failed with.
#[derive(Default)]
struct Clock {
    running: BTreeMap<String, Instant>,
    took: Vec<(Duration, String)>,
    failed: Vec<(String, String)>,
    flaky: Vec<(String, String)>,
}

/// Runs the trials as the command line says, and says which were skipped, why, and which took longest.
#[must_use]
pub fn run(trials: Vec<Trial>) -> ExitCode {
    run_with(trials, false, Attempts::One)
}

/// As [`run`], for trials with deadlines in real time, robots and sessions of their own. Each runs in a process of its own
/// (`--trial NAME` is that one alone, in this process), and what it prints is shown if it fails, or with `--nocapture`.
///
/// A machine that did not run a robot for seconds fails them as a fault of the robot does; so what fails beside others is tried
/// once more with nothing beside it. What then passes is listed as `flaky`, with what it first failed with: it wants to be looked
/// at. With `GESTALT_STRICT` set there is no second attempt.
#[must_use]
pub fn run_in_real_time(trials: Vec<Trial>) -> ExitCode {
    if let Some(name) = apart::ordered() {
        let Some(trial) = trials.into_iter().find(|trial| trial.name == name) else {
            eprintln!("no trial is named {name}");
            return ExitCode::FAILURE;
        };
        return apart::be(|| here(&trial.run));
    }
    let strict = std::env::var_os("GESTALT_STRICT").is_some();
    run_with(trials, true, if strict { Attempts::One } else { Attempts::Two })
}

fn run_with(trials: Vec<Trial>, apart: bool, attempts: Attempts) -> ExitCode {
    let required = match needs::required(std::env::var("GESTALT_REQUIRE").ok().as_deref()) {
        Ok(required) => required,
        Err(error) => {
            eprintln!("GESTALT_REQUIRE: {error}");
            return ExitCode::FAILURE;
        }
    };
    let mut arguments = Arguments::from_args();
    let room = Arc::new(Room::of_this_machine());
    arguments.test_threads.get_or_insert(room.places());
    let clock = Arc::new(Mutex::new(Clock::default()));
    let patience = std::env::var_os("GESTALT_LONG").is_none().then_some(STUCK);
    let shown = arguments.nocapture;
    let mut skipped = Vec::new();
    let listed = trials.into_iter().map(|trial| {
        let missing = trial.needs.iter().find_map(|need| Some((*need, need.missing()?)));
        let ignored = missing.as_ref().is_some_and(|(need, _)| !required.contains(need));
        if let (true, Some((_, reason))) = (ignored, &missing) {
            skipped.push(format!("skipped: {}: {reason}", trial.name));
        }
        let (name, room, clock) = (trial.name.clone(), room.clone(), clock.clone());
        libtest_mimic::Trial::test(trial.name, move || {
            if let Some((need, reason)) = missing {
                return Err(Failed::from(format!("GESTALT_REQUIRE names {}: {reason}", need.name())));
            }
            let ended = attempts.make(|is_alone| {
                if is_alone {
                    eprintln!("second attempt, alone: {name}");
                }
                let load = if is_alone { Load::Alone } else { trial.load };
                attempt(&name, &room, load, &clock, || {
                    if apart { apart::run(&name, patience, shown) } else { here(&trial.run) }
                })
            });
            let mut clock = lock(&clock);
            match ended {
                Ok(flaky) => clock.flaky.extend(flaky.map(|cause| (name.clone(), cause))),
                Err(cause) => {
                    clock.failed.push((name.clone(), cause.clone()));
                    return Err(Failed::from(cause));
                }
            }
            Ok(())
        })
        .with_ignored_flag(ignored)
    });
    let listed = listed.collect();
    if let (false, false, Some(patience)) = (arguments.list, apart, patience) {
        let clock = clock.clone();
        std::thread::spawn(move || end_what_is_stuck(&clock, patience));
    }
    let conclusion = libtest_mimic::run(&arguments, listed);
    if !arguments.list {
        report(&lock(&clock), &skipped, &conclusion);
    }
    conclusion.exit_code()
}

/// Makes an attempt at a trial in its place, and writes down how long it took.
fn attempt(
    name: &str,
    room: &Room,
    load: Load,
    clock: &Mutex<Clock>,
    run: impl FnOnce() -> Result<(), String>,
) -> Result<(), String> {
    let _place = room.take(load);
    let began = Instant::now();
    lock(clock).running.insert(name.to_owned(), began);
    let ended = run();
    let mut clock = lock(clock);
    clock.running.remove(name);
    clock.took.push((began.elapsed(), name.to_owned()));
    ended
}

/// Runs a trial in this process; what it panicked with.
fn here(run: &dyn Fn()) -> Result<(), String> {
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(run)).map_err(|panic| words(&*panic))
}

fn lock(clock: &Mutex<Clock>) -> std::sync::MutexGuard<'_, Clock> {
    clock.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What a panic said.
fn words(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("panicked").to_owned()
}

/// A test that hangs would keep all others from being told: it ends the process, by name.
fn end_what_is_stuck(clock: &Mutex<Clock>, patience: Duration) {
    loop {
        std::thread::sleep(Duration::from_secs(1));
        let stuck = |(_, began): &(&String, &Instant)| began.elapsed() > patience;
        if let Some((name, _)) = lock(clock).running.iter().find(stuck) {
            eprintln!("stuck: {name} has not ended within {patience:?}");
            std::process::exit(101);
        }
    }
}

fn report(clock: &Clock, skipped: &[String], conclusion: &Conclusion) {
    let mut slowest: Vec<_> = clock.took.iter().collect();
    slowest.sort_by_key(|(took, _)| std::cmp::Reverse(*took));
    for (took, name) in slowest.into_iter().take(LISTED) {
        println!("{:7.1} s  {name}", took.as_secs_f64());
    }
    let first = |cause: &str| cause.lines().next().unwrap_or_default().to_owned();
    for (name, cause) in &clock.flaky {
        println!("flaky: {name}: passed alone, after it failed with: {}", first(cause));
    }
    for (name, cause) in &clock.failed {
        println!("failed: {name}: {}", first(cause));
    }
    if conclusion.num_ignored > 0 {
        skipped.iter().for_each(|line| println!("{line}"));
    }
}
