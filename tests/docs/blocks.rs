//! The shell blocks of the documentation.

use std::fmt::Write as _;

use crate::stage::{Stage, root};

/// Texts outside of `docs/`.
const TEXTS: [&str; 4] = ["README.md", "CONTRIBUTING.md", "SECURITY.md", "examples/simulator/README.md"];

/// Lines that cannot run here, by how they begin, and why.
const APART: [(&str, &str); 19] = [
    ("sudo ", "changes the system; packaging/installed.sh does it in one of its own"),
    ("gestalt config | sudo ", "likewise"),
    ("cd /var/lib/gestalt && sudo ", "likewise"),
    ("curl ", "installs Rust"),
    ("git clone ", "needs the reader's own copy"),
    ("CARGO_BUILD_JOBS=2 make deb", "builds for an hour on a Raspberry Pi"),
    ("cmake ", "is built by the simulator's own tests"),
    ("out/simulator/enki-swarm ", "is run by the simulator's own tests"),
    ("ARGOS_PLUGIN_PATH=", "needs ARGoS"),
    ("make demo ", "builds and runs the program for a minute"),
    ("make test ", "is what runs this"),
    ("pip install eclipse-zenoh", "needs PyPI"),
    ("gestalt capture --gesture", "needs a camera"),
    ("gestalt teach new --vocabulary rescue --shows", "asks a person for forty rounds"),
    ("gestalt watch --web", "serves until it is stopped"),
    ("gestalt watch --foxglove", "serves until it is stopped"),
    ("gestalt record run.mcap -e", "records the reader's own swarm until it is stopped"),
    ("gestalt replay run.mcap --play", "plays to the reader's own clients"),
    ("python3 examples/subscribe.py", "needs the package of the line before, and listens for ever"),
];

/// A block of shell.
struct Block {
    place: String,
    lines: Vec<String>,
}

impl Block {
    /// What it stands in.
    fn text(&self) -> &str {
        self.place.split(':').next().unwrap_or_default()
    }
}

/// All of `docs/`, in the order of their names.
fn guides() -> Vec<String> {
    let names = std::fs::read_dir(root().join("docs")).unwrap().map(|entry| entry.unwrap().file_name());
    let mut guides: Vec<String> = names
        .map(|name| format!("docs/{}", name.to_string_lossy()))
        .filter(|text| text.ends_with(".md"))
        .collect();
    guides.sort();
    guides
}

fn blocks() -> Vec<Block> {
    let mut found = Vec::new();
    for text in TEXTS.map(str::to_owned).into_iter().chain(guides()) {
        let content =
            std::fs::read_to_string(root().join(&text)).unwrap_or_else(|error| panic!("{text}: {error}"));
        let mut open: Option<Block> = None;
        for (number, line) in content.lines().enumerate() {
            match (&mut open, line.trim()) {
                (None, "```sh" | "```bash" | "```shell" | "```console") => {
                    open = Some(Block { place: format!("{text}:{}", number + 1), lines: Vec::new() });
                }
                (Some(_), "```") => found.extend(open.take()),
                (Some(block), _) => block.lines.push(line.to_owned()),
                (None, _) => {}
            }
        }
        assert!(open.is_none(), "{text}: a block does not end");
    }
    found
}

fn is_apart(line: &str) -> bool {
    APART.iter().any(|(begins, _)| line.trim_start().starts_with(begins))
}

pub fn what_is_not_run_is_still_there() {
    let blocks = blocks();
    let lines: Vec<&String> = blocks.iter().flat_map(|block| &block.lines).collect();
    for (begins, why) in APART {
        assert!(lines.iter().any(|line| line.starts_with(begins)), "take it off the list: {begins} ({why})");
    }
}

pub fn those_of_the_readme_run_as_they_are_written() {
    run(|text| text == "README.md", 5);
}

pub fn those_of_the_guides_run_as_they_are_written() {
    run(|text| text.starts_with("docs/") && text != "docs/results.md", 5);
}

pub fn all_others_run_as_they_are_written() {
    run(|text| text != "README.md" && (!text.starts_with("docs/") || text == "docs/results.md"), 1);
}

/// Runs the blocks of such texts, of which there are so many at least.
fn run(is_such: impl Fn(&str) -> bool, least: usize) {
    let mut failed = String::new();
    let blocks: Vec<(u32, Block)> = (0..).zip(blocks()).filter(|(_, block)| is_such(block.text())).collect();
    assert!(blocks.len() >= least, "{} blocks", blocks.len());
    for (number, block) in &blocks {
        let lines: Vec<&str> =
            block.lines.iter().map(String::as_str).filter(|line| !is_apart(line)).collect();
        let lines = lines.join("\n");
        if lines.trim().is_empty() {
            println!("{}: not run", block.place);
            continue;
        }
        let stage = Stage::new(*number);
        set(&stage, &lines);
        // What stands for something of the reader's own.
        let lines = lines.replace("CENTRE:7447", &format!("127.0.0.1:{}", stage.port()));
        let ran = stage.run(&lines);
        if !ran.status.success() {
            let (said, told) = (String::from_utf8_lossy(&ran.stdout), String::from_utf8_lossy(&ran.stderr));
            let _ = write!(failed, "\n{}: {}\n{lines}\n{said}{told}", block.place, ran.status);
        }
    }
    assert!(failed.is_empty(), "{failed}");
}

/// What a block speaks of is there.
fn set(stage: &Stage, lines: &str) {
    for (name, seed) in [("DIR", 1), ("OTHER", 100)] {
        if lines.contains(name) {
            stage.dataset(name, seed);
        }
    }
    if lines.contains("decision.json") {
        let ran = stage.run("gestalt swarm --robots footbot:3 --rounds 1 --swarm demo --keys keys --json");
        let told = String::from_utf8_lossy(&ran.stdout).into_owned();
        let told = told.lines().filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok());
        let decision =
            told.filter(|told| told["event"] == "decision").map(|told| told["decision"].clone()).next();
        std::fs::write(stage.path("decision.json"), decision.expect("a decision").to_string()).unwrap();
    }
}
