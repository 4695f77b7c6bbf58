//! Robots whose output goes where there is no room, as where a log has filled its disk.

use std::fs::File;
use std::io::Read;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use gestalt_protocol::ClassId;
use gestalt_tests::{config, start, unique};

const PATIENCE: Duration = Duration::from_secs(60);

/// A program that is killed when it is dropped.
struct Running(Child);

impl Running {
    /// Interrupts it, and waits for its end: how it ended, and what it said on stderr.
    async fn interrupted(mut self) -> (ExitStatus, String) {
        let interrupt = Command::new("kill").arg("-INT").arg(self.0.id().to_string()).status();
        assert!(interrupt.is_ok_and(|status| status.success()));
        let began = Instant::now();
        let ended = loop {
            if let Some(ended) = self.0.try_wait().unwrap() {
                break ended;
            }
            assert!(began.elapsed() < PATIENCE, "it does not end");
            tokio::time::sleep(Duration::from_millis(20)).await;
        };
        let mut said = String::new();
        self.0.stderr.take().unwrap().read_to_string(&mut said).unwrap();
        (ended, said)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

pub async fn a_full_disk_under_the_output_takes_no_robot_and_no_centre_out_of_its_swarm() {
    for verb in [&["peer"][..], &["center", "--model", "rendered"]] {
        let swarm = unique("unprinted");
        let mut other = start(config(1, &swarm, &[]), Some(ClassId(2))).await;
        let endpoint = other.robot.locators()[0].clone();
        let mut command = Command::new(env!("CARGO_BIN_EXE_test-gestalt"));
        command.args(verb).args(["--id", "2", "--swarm", &swarm, "-e", &endpoint, "-l", "tcp/127.0.0.1:0"]);
        command.args(["--no-multicast-scouting", "--json"]).env_remove("RUST_LOG");
        let full = File::options().write(true).open("/dev/full").expect("a device that has no room");
        let running = command.stdin(Stdio::null()).stdout(full).stderr(Stdio::piped()).spawn().unwrap();
        let mut running = Running(running);
        assert!(other.sees_alive(1, PATIENCE).await, "{verb:?} is there");
        for round in 1..=3 {
            other.robot.open_round();
            assert!(other.decision(round, PATIENCE).await.is_some(), "{verb:?}, round {round}");
            // Who asks again sooner is taken for a copy of the first request.
            tokio::time::sleep(Duration::from_millis(600)).await;
        }
        assert_eq!(running.0.try_wait().unwrap(), None, "{verb:?} goes on");
        let (ended, said) = running.interrupted().await;
        assert!(ended.success(), "{verb:?}: {ended}: {said}");
        assert_eq!(said.matches("cannot be printed").count(), 1, "once: {said}");
        other.stop().await;
    }
}
