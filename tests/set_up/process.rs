//! Robots as processes, each killed when it is dropped.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use serde_json::Value;

type Told = Arc<(Mutex<Vec<Value>>, Condvar)>;

/// A running `test-robot`.
pub struct Process {
    child: Child,
    stdin: ChildStdin,
    told: Told,
    teller: Option<JoinHandle<()>>,
}

impl Process {
    /// Starts `binary`, in a network namespace if one is named.
    ///
    /// # Panics
    /// When it cannot be started.
    #[must_use]
    pub fn start(binary: &Path, namespace: Option<&str>, orders: &Value) -> Self {
        let mut command = match namespace {
            None => Command::new(binary),
            Some(namespace) => {
                let mut command = Command::new("ip");
                command.args(["netns", "exec", namespace]).arg(binary);
                command
            }
        };
        // As its service runs it.
        Self::run(command.env("MALLOC_ARENA_MAX", "2").arg(orders.to_string()))
    }

    /// Runs a program that prints a line of JSON for whatever happens; each gets the time at which it was read, `at_ms`
    /// since 1970, if it has none.
    ///
    /// # Panics
    /// When it cannot be started.
    #[must_use]
    pub fn run(command: &mut Command) -> Self {
        let mut child =
            command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("the robot's process starts");
        let stdin = child.stdin.take().expect("stdin is piped");
        let stdout = child.stdout.take().expect("stdout is piped");
        let told = Told::default();
        let teller = told.clone();
        let teller = std::thread::spawn(move || {
            for line in BufReader::new(stdout).lines().map_while(Result::ok) {
                let Ok(mut value) = serde_json::from_str::<Value>(&line) else { continue };
                if value["at_ms"].is_null() {
                    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
                    value["at_ms"] = u64::try_from(now.as_millis()).unwrap_or(u64::MAX).into();
                }
                teller.0.lock().unwrap_or_else(PoisonError::into_inner).push(value);
                teller.1.notify_all();
            }
        });
        Self { child, stdin, told, teller: Some(teller) }
    }

    /// Gives an order: `open`, `status`, `quit`.
    pub fn order(&mut self, order: &str) {
        // A robot that was killed takes no orders.
        let _ = writeln!(self.stdin, "{order}");
    }

    /// Everything it has told so far.
    #[must_use]
    pub fn told(&self) -> Vec<Value> {
        self.told.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The same, and forgets it: of what is told for hours somebody has to keep no more than needed.
    pub fn take_told(&self) -> Vec<Value> {
        std::mem::take(&mut self.told.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Waits until what it has told, all of it, gives `pick` a value.
    pub fn wait<T>(&self, patience: Duration, mut pick: impl FnMut(&[Value]) -> Option<T>) -> Option<T> {
        let deadline = Instant::now() + patience;
        let mut told = self.told.0.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            if let Some(found) = pick(&told) {
                return Some(found);
            }
            let left = deadline.checked_duration_since(Instant::now())?;
            told = self.told.1.wait_timeout(told, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// The decision it holds for that round, whole, once that round is over.
    pub fn decision(&self, round: u64, patience: Duration) -> Option<Value> {
        self.wait(patience, |told| {
            let of = |event: &'static str| {
                told.iter().rev().find(move |t| t["event"] == event && t["round"] == round)
            };
            let taking_part = of("opened").is_some();
            let over = !taking_part || of("closed").is_some();
            Some(of("held").filter(|_| over)?["decision"].clone())
        })
    }

    /// Everything it told before it was killed, to the last line.
    #[must_use]
    pub fn told_to_the_end(&mut self) -> Vec<Value> {
        self.kill();
        if let Some(teller) = self.teller.take() {
            // It ends with the pipe, which ends with the process.
            let _ = teller.join();
        }
        self.told()
    }

    /// The number by which the system knows it.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// How it has ended, if it has.
    pub fn ended(&mut self) -> Option<ExitStatus> {
        self.child.try_wait().ok().flatten()
    }

    /// Sends it a signal, such as `STOP` or `CONT`.
    ///
    /// # Panics
    /// When there is no `kill`.
    pub fn signal(&self, name: &str) {
        let kill = Command::new("kill").arg(format!("-{name}")).arg(self.child.id().to_string()).status();
        assert!(kill.is_ok_and(|status| status.success()), "kill -{name}");
    }

    /// Kills it at once, as `kill -9` does.
    pub fn kill(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}
