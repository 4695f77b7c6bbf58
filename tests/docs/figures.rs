//! Figures of the documentation that a command prints in seconds: they are what it prints today.

use std::fs;

use crate::stage::{Stage, root};

/// Rules as the command names them, and as the documentation does.
const RULES: [(&str, &str); 4] = [
    ("log_pool", "log-opinion pool"),
    ("confidence_weighted", "confidence-weighted pool"),
    ("majority", "majority"),
    ("mean_probability", "mean of probabilities"),
];

pub fn those_of_the_rules_of_fusion_are_what_is_printed() {
    let ran = Stage::new(98).run("gestalt emulate configs/emulation/fusion.json5");
    let printed = String::from_utf8_lossy(&ran.stdout).into_owned();
    assert!(ran.status.success(), "{printed}{}", String::from_utf8_lossy(&ran.stderr));
    let results = fs::read_to_string(root().join("docs/results.md")).unwrap();
    for (rule, title) in RULES {
        let line = printed.lines().find(|line| line.starts_with(rule)).expect("a line of each rule");
        let fields: Vec<&str> = line.split("  ").map(str::trim).filter(|field| !field.is_empty()).collect();
        let right = fields.iter().find(|field| field.ends_with(']')).expect("the share that is right");
        let time = fields.iter().find(|field| field.contains('±')).expect("the time to decide");
        let row = results.lines().find(|row| row.starts_with(&format!("| {title} |"))).expect("a row of it");
        let (share, interval) = right.split_once(' ').expect("a share and its interval");
        let other = 100.0 - share.parse::<f64>().expect("a share");
        let printed = format!("| {title} | {share} % {interval} | {other:.1} % | {time} ms |");
        assert!(row.starts_with(&printed), "{row} is printed as {printed}");
    }
    let single =
        printed.lines().find_map(|line| line.split_once("one robot is right in ")?.1.split_once(" %"));
    let (single, _) = single.expect("how often one robot is right");
    assert!(results.contains(&format!("one frame of one robot right in {single} %")), "{single}");
    let readme = fs::read_to_string(root().join("README.md")).unwrap();
    let (share, _) = single.split_once(" ±").expect("a share and its interval");
    let rounded: f64 = share.parse().expect("a share");
    assert!(readme.contains(&format!("one frame of one robot is right in {rounded:.0} %")), "{single}");
}
