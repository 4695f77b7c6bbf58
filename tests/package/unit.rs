//! The units of systemd: of a robot, and of a fusion centre.

use std::path::{Path, PathBuf};
use std::process::Command;

use clap::Parser;

/// Both, by the name before the `@`.
const UNITS: [&str; 2] = ["gestalt", "gestalt-center"];

pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().expect("the project has a folder")
}

fn text_of(unit: &str) -> String {
    std::fs::read_to_string(root().join(format!("packaging/{unit}@.service"))).unwrap()
}

/// The values of a key of a unit.
fn values(unit: &str, key: &str) -> Vec<String> {
    let begins = format!("{key}=");
    text_of(unit).lines().filter_map(|line| line.strip_prefix(&begins)).map(str::to_owned).collect()
}

pub fn the_units_start_the_program_as_its_command_line_wants_it() {
    for unit in UNITS {
        let [start] = values(unit, "ExecStart").try_into().expect("one command");
        let words = start.replace("%i", "front");
        let words: Vec<&str> = words.split_whitespace().collect();
        assert_eq!(words[0], "/usr/bin/gestalt");
        let command = gestalt_peer::cli::Command::try_parse_from(&words);
        assert!(command.is_ok(), "{start}: {command:?}");
        // What it waits for is what the program reads.
        let [asserted] = values(unit, "AssertPathExists").try_into().expect("one file");
        assert!(start.ends_with(&asserted), "{start} and {asserted}");
    }
    assert_eq!(values("gestalt", "Type"), ["notify"]);
    assert_eq!(values("gestalt", "NotifyAccess"), ["main"]);
    assert_eq!(values("gestalt-center", "Type"), ["exec"], "it says nothing to systemd");
}

pub fn the_folder_of_robots_is_there_before_one_starts_as_the_units_have_it() {
    let script = std::fs::read_to_string(root().join("packaging/postinst")).unwrap();
    for unit in UNITS {
        let one = |key: &str| values(unit, key).pop().expect("one value");
        let (user, group, mode) = (one("User"), one("Group"), one("StateDirectoryMode"));
        let line = format!("install -d -o {user} -g {group} -m {mode} /var/lib/{}", one("StateDirectory"));
        assert!(script.contains(&line), "{line} is missing in\n{script}");
    }
}

pub fn systemd_takes_the_units_and_finds_them_hardened() {
    let folder = tempfile::tempdir().unwrap();
    for unit in UNITS {
        let path = folder.path().join(format!("{unit}@front.service"));
        // The program that systemd is to look for is the one that was built, the manual is not installed.
        let text = text_of(unit)
            .replace("/usr/bin/gestalt", env!("CARGO_BIN_EXE_test-gestalt"))
            .replace("man:gestalt-peer(1) ", "")
            .replace("man:gestalt-center(1) ", "");
        std::fs::write(&path, text).unwrap();
        let verified = Command::new("systemd-analyze").arg("verify").arg(&path).output().unwrap();
        let said = String::from_utf8_lossy(&verified.stderr);
        let ours: Vec<_> = said.lines().filter(|line| line.contains("gestalt")).collect();
        assert!(ours.is_empty(), "{ours:#?}");
        let judged = Command::new("systemd-analyze")
            .args(["security", "--offline=true", "--threshold=40"])
            .arg(&path)
            .output();
        let judged = judged.unwrap();
        let said = String::from_utf8_lossy(&judged.stdout);
        let level = said.lines().find(|line| line.contains("Overall exposure level")).unwrap_or_default();
        assert!(judged.status.success() && !level.is_empty(), "{unit}: {level}");
        println!("{}", level.trim());
    }
}
