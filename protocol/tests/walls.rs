//! The walls between the pure crates, as cargo itself sees them: what a crate pulls in is what its users compile.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

/// The names of all crates that a member of this workspace depends on, at whatever distance; it is among them.
fn needs(member: &str, features: &[&str]) -> BTreeSet<String> {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let output = Command::new(env!("CARGO"))
        .args(["tree", "-p", member, "-e", "normal", "--prefix", "none", "--offline", "--format", "{p}"])
        .args(features.iter().flat_map(|feature| ["--features", feature]))
        .current_dir(workspace)
        .output()
        .expect("cargo runs this test, so it can be run");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let listed = String::from_utf8(output.stdout).expect("names of crates are ASCII");
    let names = listed.lines().filter_map(|line| line.split_whitespace().next());
    let names: BTreeSet<String> = names.map(str::to_owned).collect();
    assert!(names.contains(member), "{names:?}");
    names
}

/// The body, and the tools of a command line.
const OUTSIDE: [&str; 7] = ["zenoh", "opencv", "tokio", "clap", "redb", "mio", "ed25519-dalek"];
const LINEAR_ALGEBRA: [&str; 2] = ["nalgebra", "matrixmultiply"];
const OFFLINE: [&str; 3] = ["linfa", "linfa-svm", "ndarray"];
const CHANCE: [&str; 3] = ["rand", "rand_core", "getrandom"];

fn assert_without(member: &str, banned: &[&[&str]]) {
    let names = needs(member, &[]);
    for name in banned.iter().copied().flatten() {
        assert!(
            !names.contains(*name),
            "{member} pulls in {name}; `cargo tree -p {member} -i {name}` says how"
        );
    }
}

#[test]
fn what_robots_say_needs_nothing_but_its_encodings() {
    assert_without("gestalt-protocol", &[&OUTSIDE, &LINEAR_ALGEBRA, &OFFLINE, &CHANCE]);
}

#[test]
fn deciding_needs_no_learning_no_linear_algebra_and_no_chance() {
    assert_without(
        "gestalt-rounds",
        &[&OUTSIDE, &LINEAR_ALGEBRA, &OFFLINE, &CHANCE, &["gestalt-svm", "gestalt-strategies"]],
    );
}

#[test]
fn classifying_needs_no_body_and_learning_on_the_spot_no_second_solver() {
    assert_without("gestalt-svm", &[&OUTSIDE, &OFFLINE, &["gestalt-strategies"]]);
}

#[test]
fn a_mind_needs_no_body_and_the_offline_trainer_only_when_asked_for_it() {
    assert_without("gestalt-strategies", &[&OUTSIDE, &OFFLINE]);
    let offline = needs("gestalt-strategies", &["offline"]);
    assert!(OFFLINE.iter().all(|name| offline.contains(*name)), "{offline:?}");
}
