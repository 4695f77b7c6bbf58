//! What systemd is told: that a robot has started, that it still runs, and that it is about to end.
//!
//! The protocol of sd_notify(3): datagrams of `KEY=VALUE` lines to the socket that `NOTIFY_SOCKET` names. With `Type=notify` whatever
//! waits for the robot waits until it listens; with `WatchdogSec=` one that hangs is started anew.

use std::ffi::OsString;
use std::io;
use std::time::Duration;

use thiserror::Error;

/// Why a service manager cannot be told anything.
#[derive(Debug, Error)]
pub enum ServiceManagerError {
    /// Neither a path nor an abstract name.
    #[error(
        "NOTIFY_SOCKET is {0:?}: it must be a path that begins with / or an abstract name that begins with @; unset it where no service manager is"
    )]
    Address(OsString),
    /// The socket.
    #[error("cannot reach the service manager at {address:?}: {cause}; unset NOTIFY_SOCKET where none is")]
    Socket {
        /// What `NOTIFY_SOCKET` says.
        address: OsString,
        /// What the operating system says.
        cause: io::Error,
    },
    /// A period that is no number of microseconds.
    #[error(
        "WATCHDOG_USEC is {0:?}: it must be a number of microseconds above 0, as WatchdogSec= of the unit sets it"
    )]
    Watchdog(OsString),
}

/// What a service manager says to the programs it starts, by the names of its environment variables.
#[derive(Clone, Debug, Default)]
pub struct ServiceEnvironment {
    /// `NOTIFY_SOCKET`.
    pub notify_socket: Option<OsString>,
    /// `WATCHDOG_USEC`.
    pub watchdog_usec: Option<OsString>,
    /// `WATCHDOG_PID`.
    pub watchdog_pid: Option<OsString>,
}

impl ServiceEnvironment {
    /// This process's.
    #[must_use]
    pub fn read() -> Self {
        Self {
            notify_socket: std::env::var_os("NOTIFY_SOCKET"),
            watchdog_usec: std::env::var_os("WATCHDOG_USEC"),
            watchdog_pid: std::env::var_os("WATCHDOG_PID"),
        }
    }
}

/// The service manager of this process, if there is one.
#[derive(Debug, Default)]
pub struct ServiceManager {
    socket: Option<Socket>,
    watchdog: Option<Duration>,
}

impl ServiceManager {
    /// The one that an environment names, for the process with that number.
    ///
    /// # Errors
    /// See [`ServiceManagerError`]: a manager that waits for a word and hears none would end the robot.
    pub fn new(environment: &ServiceEnvironment, process: u32) -> Result<Self, ServiceManagerError> {
        let Some(address) = environment.notify_socket.as_ref().filter(|address| !address.is_empty()) else {
            return Ok(Self::default());
        };
        let socket = Socket::connect(address)?;
        // A watchdog meant for another process, which started this one, is not ours to feed.
        let ours =
            environment.watchdog_pid.as_ref().is_none_or(|pid| pid.to_str() == Some(&process.to_string()));
        let watchdog = match environment.watchdog_usec.as_ref().filter(|_| ours) {
            None => None,
            Some(usec) => match usec.to_str().map(str::parse) {
                Some(Ok(micros @ 1..)) => Some(Duration::from_micros(micros)),
                _ => return Err(ServiceManagerError::Watchdog(usec.clone())),
            },
        };
        Ok(Self { socket: Some(socket), watchdog })
    }

    /// Whether there is one, which starts the program again when it ends with an error.
    #[must_use]
    pub fn is_there(&self) -> bool {
        self.socket.is_some()
    }

    /// How often it wants to hear that the robot still runs: at half the time after which it gives it up, as sd_watchdog_enabled(3)
    /// recommends. `None` where nobody waits for that.
    #[must_use]
    pub fn watchdog_period(&self) -> Option<Duration> {
        self.watchdog.map(|after| after / 2)
    }

    /// The robot has started; `status` is one line for people.
    pub fn ready(&self, status: &str) {
        self.tell(&format!("READY=1\nSTATUS={}\n", one_line(status)));
    }

    /// The robot still runs.
    pub fn alive(&self) {
        self.tell("WATCHDOG=1\n");
    }

    /// The robot is about to end, and wants the time that takes.
    pub fn stopping(&self) {
        self.tell("STOPPING=1\n");
    }

    /// A manager that is gone or takes nothing is no reason for a robot to stop.
    fn tell(&self, message: &str) {
        if let Some(socket) = &self.socket
            && let Err(error) = socket.send(message.as_bytes())
        {
            tracing::warn!("the service manager does not hear: {error}");
        }
    }
}

/// A line break would begin another variable.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(unix)]
#[derive(Debug)]
struct Socket(std::os::unix::net::UnixDatagram);

#[cfg(unix)]
impl Socket {
    fn connect(address: &OsString) -> Result<Self, ServiceManagerError> {
        let place = place(address).ok_or_else(|| ServiceManagerError::Address(address.clone()))?;
        let connect = |place: &std::os::unix::net::SocketAddr| {
            let socket = std::os::unix::net::UnixDatagram::unbound()?;
            socket.connect_addr(place)?;
            // A manager that reads nothing must not stop a robot.
            socket.set_nonblocking(true)?;
            Ok(Self(socket))
        };
        place
            .and_then(|place| connect(&place))
            .map_err(|cause| ServiceManagerError::Socket { address: address.clone(), cause })
    }

    fn send(&self, message: &[u8]) -> io::Result<()> {
        self.0.send(message).map(drop)
    }
}

/// Where a socket is: a file, or a name that begins with a zero byte, which is written as `@`. `None` for what is neither.
#[cfg(unix)]
fn place(address: &OsString) -> Option<io::Result<std::os::unix::net::SocketAddr>> {
    use std::os::unix::ffi::OsStrExt;
    use std::os::unix::net::SocketAddr;

    match address.as_bytes() {
        [b'/', ..] => Some(SocketAddr::from_pathname(address)),
        #[cfg(target_os = "linux")]
        [b'@', name @ ..] => {
            use std::os::linux::net::SocketAddrExt;
            Some(SocketAddr::from_abstract_name(name))
        }
        _ => None,
    }
}

#[cfg(not(unix))]
#[derive(Debug)]
struct Socket;

#[cfg(not(unix))]
impl Socket {
    fn connect(address: &OsString) -> Result<Self, ServiceManagerError> {
        Err(ServiceManagerError::Address(address.clone()))
    }

    fn send(&self, _: &[u8]) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::net::UnixDatagram;

    use super::*;

    fn manager(
        socket: &str,
        usec: Option<&str>,
        pid: Option<&str>,
    ) -> Result<ServiceManager, ServiceManagerError> {
        let environment = ServiceEnvironment {
            notify_socket: Some(socket.into()),
            watchdog_usec: usec.map(Into::into),
            watchdog_pid: pid.map(Into::into),
        };
        ServiceManager::new(&environment, 77)
    }

    fn heard(socket: &UnixDatagram) -> String {
        let mut datagram = [0; 1024];
        let length = socket.recv(&mut datagram).unwrap();
        String::from_utf8(datagram[..length].to_vec()).unwrap()
    }

    #[test]
    fn each_word_is_a_datagram_of_its_own() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notify");
        let systemd = UnixDatagram::bind(&path).unwrap();
        systemd.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
        let manager = manager(path.to_str().unwrap(), Some("3000000"), Some("77")).unwrap();
        manager.ready("listens on\ntcp/[::]:7447 READY=0");
        manager.alive();
        manager.stopping();
        let words = [(); 3].map(|()| heard(&systemd));
        assert_eq!(
            words,
            ["READY=1\nSTATUS=listens on tcp/[::]:7447 READY=0\n", "WATCHDOG=1\n", "STOPPING=1\n"]
        );
        assert_eq!(manager.watchdog_period(), Some(Duration::from_millis(1500)));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_name_that_begins_with_an_at_sign_is_abstract() {
        use std::os::linux::net::SocketAddrExt;
        use std::os::unix::net::SocketAddr;

        let name = format!("gestalt-notify-{}", std::process::id());
        let systemd = UnixDatagram::bind_addr(&SocketAddr::from_abstract_name(&name).unwrap()).unwrap();
        manager(&format!("@{name}"), None, None).unwrap().alive();
        systemd.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
        assert_eq!(heard(&systemd), "WATCHDOG=1\n");
    }

    #[test]
    fn without_a_manager_nothing_is_said_and_nothing_fails() {
        for socket in [None, Some("".into())] {
            let environment = ServiceEnvironment { notify_socket: socket, ..ServiceEnvironment::default() };
            let manager = ServiceManager::new(&environment, 77).unwrap();
            manager.ready("");
            assert_eq!(manager.watchdog_period(), None);
        }
    }

    #[test]
    fn what_cannot_be_is_named_with_its_variable() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notify");
        let _systemd = UnixDatagram::bind(&path).unwrap();
        let path = path.to_str().unwrap();
        let refused = |socket: &str, usec| manager(socket, usec, None).unwrap_err().to_string();
        assert!(refused("notify", None).contains("NOTIFY_SOCKET is \"notify\""));
        assert!(refused(&format!("{path}.gone"), None).contains("cannot reach the service manager"));
        for usec in ["0", "-1", "5s", "99999999999999999999999"] {
            assert!(refused(path, Some(usec)).contains("WATCHDOG_USEC"), "{usec}");
        }
        // Another process's watchdog is no concern of ours, whatever it says.
        assert_eq!(manager(path, Some("5s"), Some("76")).unwrap().watchdog_period(), None);
    }

    #[test]
    fn a_manager_that_reads_nothing_or_is_gone_stops_no_robot() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notify");
        let systemd = UnixDatagram::bind(&path).unwrap();
        let manager = manager(path.to_str().unwrap(), None, None).unwrap();
        (0..10_000).for_each(|_| manager.alive());
        drop(systemd);
        manager.stopping();
    }
}
