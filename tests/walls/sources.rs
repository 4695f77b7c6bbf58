//! The project's source files, as text.

use std::path::{Path, PathBuf};

/// Every package and the folder of its sources, seen from the root.
pub const CRATES: [(&str, &str); 22] = [
    ("gestalt-protocol", "protocol/src"),
    ("gestalt-rounds", "strategies/rounds/src"),
    ("gestalt-svm", "strategies/svm/src"),
    ("gestalt-strategies", "strategies/src"),
    ("gestalt-link", "peer/link/src"),
    ("gestalt-tape", "peer/tape/src"),
    ("gestalt-trust", "peer/trust/src"),
    ("gestalt-vision", "peer/vision/src"),
    ("gestalt-desk", "peer/desk/src"),
    ("gestalt-ros", "peer/ros/src"),
    ("gestalt-draw", "peer/draw/src"),
    ("gestalt-file", "peer/file/src"),
    ("gestalt-lab", "peer/lab/src"),
    ("gestalt-peer", "peer/src"),
    ("gestalt-mind", "bindings/mind/src"),
    ("gestalt-c", "bindings/c/src"),
    ("gestalt-python", "bindings/python/src"),
    ("gestalt-attack", "tests/attack/src"),
    ("gestalt-fuzz", "tests/fuzz/src"),
    ("gestalt-trials", "tests/trials"),
    ("gestalt-tests", "tests/swarm"),
    ("gestalt-examples", "examples"),
];

/// One file.
pub struct Source {
    /// Where it is, seen from the root.
    pub path: String,
    /// All of it.
    pub text: String,
}

/// The root of the workspace.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// All files of a folder, by path.
pub fn sources(folder: &str) -> Vec<Source> {
    let mut found = Vec::new();
    let mut folders = vec![root().join(folder)];
    while let Some(folder) = folders.pop() {
        let entries =
            std::fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
        for path in entries.map(|entry| entry.expect("an entry").path()) {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let text = std::fs::read_to_string(&path).expect("a source file is text");
                let path = path.strip_prefix(root()).expect("below the root").display().to_string();
                found.push(Source { path, text });
            }
        }
    }
    found.sort_by(|a, b| a.path.cmp(&b.path));
    found
}

impl Source {
    /// Whether it is compiled for tests alone.
    pub fn is_test(&self) -> bool {
        self.path.split('/').skip(1).any(|part| matches!(part.trim_end_matches(".rs"), "tests" | "testing"))
    }

    /// The code in it: without comments, and without its tests, which come last.
    pub fn code(&self) -> String {
        let before_tests = self.text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        let code = before_tests.lines().map(|line| line.split("//").next().unwrap_or_default());
        code.collect::<Vec<_>>().join("\n")
    }
}
