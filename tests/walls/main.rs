//! The walls of the house, as far as a compiler does not keep them: which crate may know of which, that no files import each
//! other in a circle, that files stay readable, and that a name means one thing in a crate.

mod circles;
mod exceptions;
mod sources;

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use sources::{CRATES, Source, sources};

/// The packages a package is built with, itself included, as its users get them: without its tests, with its default features.
fn built_with(package: &str) -> BTreeSet<String> {
    tree_of(package, &["-e", "normal"])
}

fn tree_of(package: &str, more: &[&str]) -> BTreeSet<String> {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let words = ["tree", "--offline", "--prefix", "none", "-f", "{p}", "-p"];
    let mut tree = Command::new(cargo);
    let tree =
        tree.args(words).arg(package).args(more).current_dir(sources::root()).output().expect("cargo runs");
    assert!(tree.status.success(), "{}", String::from_utf8_lossy(&tree.stderr));
    let listed = String::from_utf8(tree.stdout).expect("names of packages");
    listed.lines().filter_map(|line| Some(line.split(' ').next()?.to_owned())).collect()
}

#[track_caller]
fn knows_none(package: &str, others: &[&str]) {
    let built = built_with(package);
    assert!(built.contains(package), "the tree of {package} is empty");
    // The crates of a family stand and fall together: `zenoh` is `zenoh-protocol` as well.
    let of = |name: &str, other: &str| {
        name == other || name.strip_prefix(other).is_some_and(|rest| rest.starts_with('-'))
    };
    let found: Vec<_> = built.iter().filter(|name| others.iter().any(|other| of(name, other))).collect();
    assert!(found.is_empty(), "{package} is built with {found:?}");
}

#[test]
fn decisions_are_made_without_learning_and_without_a_network() {
    knows_none("gestalt-protocol", &["nalgebra", "linfa", "ndarray", "zenoh", "tokio", "opencv", "clap"]);
    knows_none("gestalt-rounds", &["nalgebra", "linfa", "ndarray", "zenoh", "tokio", "opencv", "clap"]);
}

#[test]
fn the_mind_knows_no_host() {
    knows_none("gestalt-strategies", &["linfa", "zenoh", "tokio", "opencv", "clap"]);
}

/// Cargo leaves a patch out, with no more than a warning, when Zenoh asks for another version than the patched one.
#[test]
fn sealed_links_are_the_mended_ones() {
    let text = std::fs::read_to_string(sources::root().join("Cargo.lock")).unwrap();
    let mut packages =
        text.split("[[package]]").filter(|package| package.contains("name = \"zenoh-link-tls\""));
    let (Some(mended), None) = (packages.next(), packages.next()) else {
        panic!("one zenoh-link-tls: else peer/link/zenoh-link-tls/README.md says what is to be done")
    };
    assert!(!mended.contains("source ="), "the published one races: {mended}");
}

#[test]
fn trust_is_judged_without_a_network_and_without_a_mind() {
    let minds = ["gestalt-strategies", "gestalt-rounds", "gestalt-svm"];
    knows_none("gestalt-trust", &minds);
    knows_none(
        "gestalt-trust",
        &["nalgebra", "linfa", "ndarray", "zenoh", "tokio", "opencv", "clap", "redb"],
    );
}

#[test]
fn a_controller_links_without_opencv_and_without_a_command_line() {
    knows_none("gestalt-link", &["linfa", "opencv", "clap"]);
    knows_none("gestalt-examples", &["linfa", "opencv", "clap"]);
}

#[test]
fn swarms_are_emulated_without_a_network_and_without_eyes() {
    knows_none("gestalt-lab", &["zenoh", "opencv", "clap", "tokio"]);
}

#[test]
fn other_languages_get_the_mind_without_a_network_and_without_eyes() {
    for binding in ["gestalt-mind", "gestalt-c", "gestalt-python"] {
        knows_none(binding, &["linfa", "zenoh", "opencv", "clap", "tokio"]);
    }
}

#[test]
fn recordings_are_written_and_read_without_a_network_and_without_eyes() {
    knows_none("gestalt-tape", &["zenoh", "opencv", "clap", "tokio", "zstd-sys", "lz4-sys"]);
}

#[test]
fn only_eyes_and_who_uses_them_need_opencv() {
    let seeing: Vec<&str> =
        CRATES.iter().map(|(package, _)| *package).filter(|p| built_with(p).contains("opencv")).collect();
    assert_eq!(seeing, ["gestalt-vision", "gestalt-peer", "gestalt-tests"]);
}

#[test]
fn without_opencv_the_program_needs_rust_alone() {
    let built = tree_of("gestalt-peer", &["--no-default-features", "-e", "normal,build"]);
    assert!(built.contains("gestalt-tape") && built.contains("gestalt-desk"), "{built:?}");
    // What looks for a library of the system, or reads its headers, while building; and crates that link one.
    let searching = [
        "opencv",
        "opencv-binding-generator",
        "bindgen",
        "clang",
        "clang-sys",
        "cmake",
        "pkg-config",
        "vcpkg",
    ];
    let found: Vec<_> = searching.into_iter().filter(|name| built.contains(*name)).collect();
    assert!(found.is_empty(), "the program without OpenCV is built with {found:?}");
    // These two name the system's interface, and link nothing.
    let harmless = ["dirs-sys", "linux-raw-sys"];
    let linking: Vec<_> =
        built.iter().filter(|name| name.ends_with("-sys") && !harmless.contains(&name.as_str())).collect();
    assert!(linking.is_empty(), "the program without OpenCV links {linking:?}");
}

#[test]
fn no_two_files_import_each_other_in_a_circle() {
    let found: BTreeSet<Vec<String>> =
        CRATES.iter().flat_map(|(_, folder)| circles::circles(folder)).collect();
    let is_part =
        |circle: &[String], known: &[&str]| circle.iter().all(|file| known.contains(&file.as_str()));
    let new: Vec<_> = found
        .iter()
        .filter(|circle| !exceptions::CIRCLES.iter().any(|(known, _)| is_part(circle, known)))
        .collect();
    assert!(new.is_empty(), "files that import each other: {new:#?}");
    let gone =
        exceptions::CIRCLES.iter().filter(|(known, _)| !found.iter().any(|circle| is_part(circle, known)));
    let gone: Vec<_> = gone.collect();
    assert!(gone.is_empty(), "no circles any more, take them off the list: {gone:#?}");
}

#[test]
fn files_stay_readable() {
    const MOST: usize = 450;
    const MEDIAN: usize = 140;
    let all: Vec<Source> = CRATES.iter().flat_map(|(_, folder)| sources(folder)).collect();
    let mut lines: Vec<usize> = all.iter().map(|source| source.text.lines().count()).collect();
    let long: Vec<_> = all.iter().zip(&lines).filter(|(_, lines)| **lines > MOST).collect();
    let long: BTreeMap<_, _> =
        long.into_iter().map(|(source, lines)| (source.path.as_str(), *lines)).collect();
    let known: BTreeMap<_, _> = exceptions::LONG.iter().copied().collect();
    let longer = |(path, lines): &(&&str, &usize)| known.get(*path).is_none_or(|most| *lines > most);
    let new: Vec<_> = long.iter().filter(longer).collect();
    assert!(new.is_empty(), "files with more than {MOST} lines: {new:#?}");
    let gone: Vec<_> = known.keys().filter(|path| !long.contains_key(*path)).collect();
    assert!(gone.is_empty(), "short enough, take them off the list: {gone:?}");
    lines.sort_unstable();
    assert!(lines.len() > 100 && lines[lines.len() / 2] <= MEDIAN, "median {}", lines[lines.len() / 2]);
}

#[test]
fn a_public_name_means_one_thing_in_a_crate() {
    let mut twice: BTreeMap<(String, String), Vec<String>> = BTreeMap::new();
    for (package, folder) in CRATES {
        let mut declared: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for source in sources(folder).iter().filter(|source| !source.is_test()) {
            for name in source.code().lines().filter_map(declared_type) {
                declared.entry(name.to_owned()).or_default().push(source.path.clone());
            }
        }
        declared.retain(|_, files| files.len() > 1);
        twice.extend(declared.into_iter().map(|(name, files)| ((package.to_owned(), name), files)));
    }
    let known: BTreeSet<_> =
        exceptions::NAMES.iter().map(|(package, name)| ((*package).to_owned(), (*name).to_owned())).collect();
    let new: Vec<_> = twice.iter().filter(|(name, _)| !known.contains(name)).collect();
    assert!(new.is_empty(), "one name, several types: {new:#?}");
    let gone: Vec<_> = known.iter().filter(|name| !twice.contains_key(name)).collect();
    assert!(gone.is_empty(), "one thing each, take them off the list: {gone:?}");
}

/// The name in `pub struct Name`, at the outermost level of a file.
fn declared_type(line: &str) -> Option<&str> {
    let rest = line.strip_prefix("pub ")?;
    let rest = ["struct ", "enum ", "trait ", "type "].iter().find_map(|kind| rest.strip_prefix(kind))?;
    rest.split(|c: char| !c.is_alphanumeric() && c != '_').next()
}

/// The crates that others may depend on, with their manifests.
fn published() -> Vec<(&'static str, String)> {
    let manifest = |folder: &str| {
        let path = sources::root().join(folder);
        let path = path.ancestors().map(|folder| folder.join("Cargo.toml")).find(|path| path.is_file());
        std::fs::read_to_string(path.expect("a manifest")).expect("a manifest is text")
    };
    let all = CRATES.iter().map(|(package, folder)| (*package, manifest(folder)));
    all.filter(|(_, manifest)| !manifest.contains("publish = false")).collect()
}

#[test]
fn every_published_crate_packs_with_its_licences_and_says_what_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let mut package = Command::new(cargo);
    // Of no lock file: what is patched here has never been fetched from the registry, and is not looked up offline.
    package.args(["package", "--no-verify", "--allow-dirty", "--offline", "--exclude-lockfile"]);
    package.arg("--target-dir").arg(folder.path());
    let published = published();
    assert!(published.len() >= 15, "{} crates", published.len());
    for (name, manifest) in &published {
        package.args(["-p", name]);
        let description = manifest.lines().find_map(|line| line.strip_prefix("description = "));
        assert!(description.is_some_and(|text| text.len() > 20), "{name} has no description");
        for field in ["license.workspace = true", "readme.workspace = true", "keywords = [", "categories = ["]
        {
            assert!(manifest.contains(field), "{name} lacks {field}");
        }
    }
    let packed = package.current_dir(sources::root()).output().expect("cargo runs");
    let said = String::from_utf8_lossy(&packed.stderr);
    assert!(packed.status.success(), "{said}");
    for (name, _) in &published {
        let file = folder.path().join(format!("package/{name}-{}.crate", env!("CARGO_PKG_VERSION")));
        let listed = Command::new("tar").arg("-tzf").arg(&file).output().expect("tar runs");
        let listed = String::from_utf8(listed.stdout).expect("names of files");
        for needed in ["LICENSE-MIT", "LICENSE-APACHE", "README.md", "Cargo.toml"] {
            assert!(
                listed.lines().any(|line| line.ends_with(&format!("/{needed}"))),
                "{name} lacks {needed}"
            );
        }
    }
}
