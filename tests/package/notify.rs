//! A robot as a service of `Type=notify`: a socket of systemd's kind, and the program as a process.

use std::os::unix::net::UnixDatagram;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// The program as a service.
struct Service {
    socket: UnixDatagram,
    child: Option<Child>,
    _folder: tempfile::TempDir,
}

const WATCHDOG: Duration = Duration::from_secs(2);

fn robot() -> Command {
    let mut robot = Command::new(env!("CARGO_BIN_EXE_test-gestalt"));
    robot.args([
        "peer",
        "--id",
        "3",
        "--swarm",
        "served",
        "--no-multicast-scouting",
        "-l",
        "tcp/127.0.0.1:0",
    ]);
    robot.stdout(Stdio::null()).stderr(Stdio::piped());
    robot
}

impl Service {
    fn start() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notify");
        let socket = UnixDatagram::bind(&path).unwrap();
        let mut robot = robot();
        robot.env("NOTIFY_SOCKET", &path).env("WATCHDOG_USEC", WATCHDOG.as_micros().to_string());
        Self { socket, child: Some(robot.spawn().unwrap()), _folder: folder }
    }

    /// The next datagram, `None` if there is none within that time.
    fn hears(&self, within: Duration) -> Option<String> {
        self.socket.set_read_timeout(Some(within)).unwrap();
        let mut datagram = [0; 1024];
        let length = self.socket.recv(&mut datagram).ok()?;
        Some(String::from_utf8(datagram[..length].to_vec()).unwrap())
    }

    fn signal(&self, name: &str) {
        let process = self.child.as_ref().unwrap().id().to_string();
        assert!(Command::new("kill").args(["-s", name, &process]).status().unwrap().success());
    }

    fn ended(mut self) -> Output {
        self.child.take().unwrap().wait_with_output().unwrap()
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        if let Some(child) = &mut self.child {
            // It may have ended by itself.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

const PATIENCE: Duration = Duration::from_secs(60);

pub fn a_robot_says_that_it_is_ready_that_it_lives_and_that_it_ends() {
    let service = Service::start();
    let ready = service.hears(PATIENCE).expect("it says that it is ready");
    assert!(ready.starts_with("READY=1\nSTATUS=robot 3 of swarm served listens on tcp/"), "{ready}");
    assert_eq!(ready.lines().count(), 2, "{ready}");
    let began = Instant::now();
    for _ in 0..4 {
        assert_eq!(service.hears(PATIENCE).as_deref(), Some("WATCHDOG=1\n"));
    }
    // At once, and then at half the time it is given: late words of a busy machine are not judged, too many are.
    assert!(began.elapsed() > WATCHDOG, "four words within {:?}", began.elapsed());
    service.signal("TERM");
    let last = std::iter::from_fn(|| service.hears(PATIENCE)).find(|word| word != "WATCHDOG=1\n");
    assert_eq!(last.as_deref(), Some("STOPPING=1\n"));
    let output = service.ended();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

pub fn a_robot_that_hangs_says_nothing() {
    let service = Service::start();
    service.hears(PATIENCE).expect("it says that it is ready");
    service.signal("STOP");
    // What it had said before.
    while service.hears(Duration::from_millis(100)).is_some() {}
    assert_eq!(service.hears(2 * WATCHDOG), None);
    service.signal("CONT");
    assert_eq!(service.hears(PATIENCE).as_deref(), Some("WATCHDOG=1\n"));
}

pub fn an_address_that_is_none_keeps_it_from_starting() {
    for (variable, value, named) in [
        ("NOTIFY_SOCKET", "relative", "begins with /"),
        ("NOTIFY_SOCKET", "/nowhere/notify", "cannot reach the service manager"),
    ] {
        let output = robot().env(variable, value).spawn().unwrap().wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && said.contains(named), "{said}");
    }
}
