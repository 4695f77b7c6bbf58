//! What a trial needs of the machine, and whether this one has it.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

/// Something that not every machine has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// The right to make network namespaces and to enter them: root, and `ip` of iproute2.
    Namespaces,
    /// A kernel whose links can be made slow or deaf: `tc` of iproute2 with `tbf` and `bfifo`, in a namespace.
    Queues,
    /// The right to mount a file system: root, outside most containers.
    Mount,
    /// Chromium, to see a page as people do.
    Browser,
    /// Recordings and photographs, which are not part of the project: see [`data`].
    Data,
    /// The simulator Enki (libenki-dev), a C++ compiler and CMake.
    Enki,
    /// Valgrind.
    Valgrind,
    /// `systemd-analyze`, which needs no running systemd.
    Systemd,
    /// What makes and judges a Debian package: dpkg-dev, lintian, binutils.
    Debian,
    /// ROS 1 for Python, its master, and Zenoh for Python.
    Rospy,
    /// ROS 2 for Python, and Zenoh for Python.
    Rclpy,
    /// Zenoh for Python alone (eclipse-zenoh).
    Zenoh,
    /// The accessibility checker axe-core, which judges a page in a browser: see [`axe`].
    Axe,
    /// What reads metrics: Python's `prometheus_client`, by its own parser of OpenMetrics, and Prometheus' `promtool`.
    Prometheus,
    /// A Python that has `websockets`.
    Websockets,
    /// A Python that has `cryptography`, which examples/verify.py checks signatures with.
    Cryptography,
}

/// The checker's one file, `axe.min.js`, of the npm package axe-core: what `GESTALT_AXE` names.
#[must_use]
pub fn axe() -> Option<PathBuf> {
    std::env::var_os("GESTALT_AXE").map(PathBuf::from)
}

/// The folder of real recordings: `GESTALT_DATA`, or `../shared/data` beside the workspace.
#[must_use]
pub fn data() -> PathBuf {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    std::env::var_os("GESTALT_DATA").map_or_else(beside, PathBuf::from)
}

impl Need {
    /// What rospy's examples import.
    pub const ROSPY: &[&str] = &["rospy", "std_msgs", "zenoh"];
    /// What rclpy's examples import.
    pub const RCLPY: &[&str] = &["rclpy", "std_msgs", "zenoh"];
    /// What all other examples of clients import.
    pub const ZENOH: &[&str] = &["zenoh"];
    /// What the independent verifier imports.
    pub const CRYPTOGRAPHY: &[&str] = &["cryptography"];

    const ALL: [Self; 16] = [
        Self::Namespaces,
        Self::Queues,
        Self::Mount,
        Self::Browser,
        Self::Data,
        Self::Enki,
        Self::Valgrind,
        Self::Systemd,
        Self::Debian,
        Self::Rospy,
        Self::Rclpy,
        Self::Zenoh,
        Self::Axe,
        Self::Prometheus,
        Self::Websockets,
        Self::Cryptography,
    ];

    /// Its name in `GESTALT_REQUIRE`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Namespaces => "namespaces",
            Self::Queues => "queues",
            Self::Mount => "mount",
            Self::Browser => "browser",
            Self::Data => "data",
            Self::Enki => "enki",
            Self::Valgrind => "valgrind",
            Self::Systemd => "systemd",
            Self::Debian => "debian",
            Self::Rospy => "rospy",
            Self::Rclpy => "rclpy",
            Self::Zenoh => "zenoh",
            Self::Axe => "axe",
            Self::Prometheus => "prometheus",
            Self::Websockets => "websockets",
            Self::Cryptography => "cryptography",
        }
    }

    /// Why this machine does not have it; `None` when it does. Tried once.
    pub(crate) fn missing(self) -> Option<String> {
        static TRIED: [OnceLock<Option<String>>; Need::ALL.len()] =
            [const { OnceLock::new() }; Need::ALL.len()];
        TRIED[self as usize].get_or_init(|| self.attempt().err()).clone()
    }

    fn attempt(self) -> Result<(), String> {
        match self {
            Self::Namespaces => in_a_namespace(&["true"], "network namespaces (root and iproute2)"),
            Self::Queues => {
                let queue = "tc qdisc replace dev lo root";
                let slow = format!("{queue} tbf rate 64000bit burst 2000 limit 8000");
                let deaf = format!("{queue} bfifo limit 1");
                in_a_namespace(
                    &[&slow, &deaf],
                    "tc of iproute2, tbf and bfifo in the kernel, and network namespaces",
                )
            }
            Self::Mount => mount(),
            Self::Browser if done("chromium", &["--version"]) => Ok(()),
            Self::Browser => Err("needs a browser (chromium)".to_owned()),
            Self::Data if data().is_dir() => Ok(()),
            Self::Data => {
                Err("needs photographs and recordings (GESTALT_DATA names their folder)".to_owned())
            }
            Self::Enki => enki(),
            Self::Valgrind if done("valgrind", &["--version"]) => Ok(()),
            Self::Valgrind => Err("needs valgrind".to_owned()),
            Self::Systemd if done("systemd-analyze", &["--version"]) => Ok(()),
            Self::Systemd => Err("needs systemd-analyze (systemd)".to_owned()),
            Self::Debian => {
                let tools = ["dpkg-deb", "dpkg-shlibdeps", "lintian", "strip"];
                let missing = tools.into_iter().find(|tool| !done(tool, &["--version"]));
                missing.map_or(Ok(()), |tool| Err(format!("needs {tool} (dpkg-dev, lintian, binutils)")))
            }
            Self::Rospy if done("rosmaster", &["--help"]) => imports(Self::ROSPY),
            Self::Rospy => Err("needs rosmaster (python3-rosmaster)".to_owned()),
            Self::Rclpy => imports(Self::RCLPY),
            Self::Zenoh => imports(Self::ZENOH),
            Self::Axe if !done("chromium", &["--version"]) => Err("needs a browser (chromium)".to_owned()),
            Self::Axe if axe().is_some_and(|file| file.is_file()) => Ok(()),
            Self::Axe => {
                Err("needs axe-core (npm install axe-core; GESTALT_AXE names its axe.min.js)".to_owned())
            }
            Self::Prometheus => {
                if python(&["prometheus_client"]).is_some() && done("promtool", &["--version"]) {
                    Ok(())
                } else {
                    Err("needs promtool and a parser (prometheus, python3-prometheus-client)".to_owned())
                }
            }
            Self::Websockets => imports(&["websockets"]),
            Self::Cryptography => imports(Self::CRYPTOGRAPHY),
        }
    }
}

/// Those that the text names, separated by commas.
pub(crate) fn required(text: Option<&str>) -> Result<Vec<Need>, String> {
    let names = text.unwrap_or_default().split(',').map(str::trim).filter(|name| !name.is_empty());
    let known = |name: &str| Need::ALL.into_iter().find(|need| need.name() == name);
    names
        .map(|name| {
            known(name).ok_or_else(|| format!("'{name}' is none of {}", Need::ALL.map(Need::name).join(", ")))
        })
        .collect()
}

fn done(program: &str, words: &[&str]) -> bool {
    let done = Command::new(program).args(words).stdout(Stdio::null()).stderr(Stdio::null()).status();
    done.is_ok_and(|status| status.success())
}

/// A Python that can import all of these: what `GESTALT_PYTHON` names, `python3`, or the system's.
#[must_use]
pub fn python(modules: &[&str]) -> Option<String> {
    let named = std::env::var("GESTALT_PYTHON").ok();
    let known = named.into_iter().chain(["python3", "/usr/bin/python3"].map(str::to_owned));
    let import = format!("import {}", modules.join(", "));
    known.into_iter().find(|python| done(python, &["-c", &import]))
}

fn imports(modules: &[&str]) -> Result<(), String> {
    let needs = || format!("needs a Python with {} (GESTALT_PYTHON names one)", modules.join(", "));
    python(modules).map(drop).ok_or_else(needs)
}

/// The simulator, and what builds a program for it.
fn enki() -> Result<(), String> {
    let header =
        ["/usr/include", "/usr/local/include"].map(|folder| Path::new(folder).join("enki/PhysicalEngine.h"));
    let programs = ["c++", "cmake"].iter().all(|program| done(program, &["--version"]));
    if programs && header.iter().any(|header| header.is_file()) {
        Ok(())
    } else {
        Err("needs the simulator Enki (libenki-dev, cmake and a C++ compiler)".to_owned())
    }
}

/// Whether those commands can be run in a network namespace: a chroot may let a process make one, and not enter it.
fn in_a_namespace(commands: &[&str], what: &str) -> Result<(), String> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let name = format!("gt{}n{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
    let made = done("ip", &["netns", "add", &name]);
    let run = |command: &&str| {
        let words: Vec<&str> = ["netns", "exec", &name].into_iter().chain(command.split(' ')).collect();
        done("ip", &words)
    };
    let all_run = made && commands.iter().all(run);
    if made {
        done("ip", &["netns", "del", &name]);
    }
    if all_run { Ok(()) } else { Err(format!("needs {what}")) }
}

fn mount() -> Result<(), String> {
    let folder = std::env::temp_dir().join(format!("gestalt-mount-{}", std::process::id()));
    let path = folder.display().to_string();
    let made = std::fs::create_dir(&folder).is_ok();
    let mounted = made && done("mount", &["-t", "tmpfs", "-o", "size=64k", "tmpfs", &path]);
    if mounted {
        done("umount", &[&path]);
    }
    // Left behind where it is still mounted; the test that needs it then says more.
    let _ = std::fs::remove_dir(&folder);
    if mounted { Ok(()) } else { Err("needs the right to mount a file system (root)".to_owned()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_required_is_named_exactly() {
        assert_eq!(required(None), Ok(vec![]));
        assert_eq!(required(Some("")), Ok(vec![]));
        assert_eq!(required(Some("mount, namespaces")), Ok(vec![Need::Mount, Need::Namespaces]));
        assert!(required(Some("mounts")).unwrap_err().contains("'mounts' is none of"));
    }
}
