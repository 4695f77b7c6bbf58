//! The package of Debian, made of the program that these tests were built with.

use std::process::{Command, Output};

use crate::unit::root;

fn done(command: &mut Command) -> Output {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let (said, complained) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{command:?}: {}\n{said}\n{complained}", output.status);
    output
}

fn text(output: Output) -> String {
    String::from_utf8(output.stdout).expect("text")
}

pub fn the_package_is_whole_and_lintian_finds_no_error() {
    let folder = tempfile::tempdir().unwrap();
    let mut make = Command::new(root().join("packaging/deb.sh"));
    make.env("XZ_LEVEL", "0");
    let package = text(done(make.arg(env!("CARGO_BIN_EXE_test-gestalt")).arg(folder.path())));
    let package = package.trim();

    let field =
        |name: &str| text(done(Command::new("dpkg-deb").args(["-f", package, name]))).trim().to_owned();
    assert_eq!(field("Package"), "gestalt");
    assert_eq!(field("Version"), concat!(env!("CARGO_PKG_VERSION"), "-1"));
    let depends = field("Depends");
    for needed in ["libc6", "libopencv-core", "libopencv-videoio", "adduser"] {
        assert!(depends.contains(needed), "{needed} is missing in {depends}");
    }

    let listed = text(done(Command::new("dpkg-deb").args(["-c", package])));
    for path in [
        "./usr/bin/gestalt",
        "./lib/systemd/system/gestalt@.service",
        "./lib/systemd/system/gestalt-center@.service",
        "./usr/share/man/man1/gestalt-peer.1.gz",
        "./usr/share/bash-completion/completions/gestalt",
        "./usr/share/doc/gestalt/copyright",
        "./usr/share/doc/gestalt/install.md",
        "./usr/share/doc/gestalt/cameras.md",
        "./usr/share/doc/gestalt/examples/footbot.json5",
        "./usr/share/doc/gestalt/examples/template.json5",
    ] {
        assert!(listed.lines().any(|line| line.ends_with(path)), "{path} is missing in\n{listed}");
    }
    // Root's, all of it.
    assert!(listed.lines().all(|line| line.contains(" root/root ")), "{listed}");

    let tree = folder.path().join("tree");
    done(Command::new("dpkg-deb").arg("-x").arg(package).arg(&tree));
    let version = text(done(Command::new(tree.join("usr/bin/gestalt")).arg("--version")));
    assert_eq!(version.trim(), format!("gestalt {}", env!("CARGO_PKG_VERSION")));

    let judged =
        Command::new("lintian").args(["--fail-on", "error", "--allow-root", package]).output().unwrap();
    let (found, complained) =
        (String::from_utf8_lossy(&judged.stdout), String::from_utf8_lossy(&judged.stderr));
    assert!(judged.status.success(), "{found}\n{complained}");
    println!("{}", found.trim());
}
