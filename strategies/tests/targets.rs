//! Robots with different processors come to the same decisions.

use std::path::Path;
use std::process::Command;

/// By how much the probabilities of one decision may differ, so that each robot finds those of the others: `gestalt_rounds::follows`.
const DECISIONS: f64 = 1e-9;

/// What the example answers when it is built for those features of a processor: names, and values.
fn answers(features: &str) -> Vec<(String, f64)> {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join(features.replace(['+', ','], "_"));
    let built = Command::new(cargo)
        .args(["run", "--quiet", "--offline", "--example", "answers", "--manifest-path"])
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"))
        .env("CARGO_TARGET_DIR", target)
        .env("CARGO_INCREMENTAL", "0")
        .env("RUSTFLAGS", format!("-C target-cpu=x86-64 -C target-feature={features}"))
        .output()
        .unwrap();
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    let text = String::from_utf8(built.stdout).unwrap();
    let answer =
        |line: &str| line.split_once(' ').map(|(name, value)| (name.to_owned(), value.parse().unwrap()));
    text.lines().map(|line| answer(line).unwrap()).collect()
}

#[test]
fn processors_with_and_without_wide_vectors_give_the_same_decisions() {
    if std::env::var_os("GESTALT_LONG").is_none() {
        println!("skipped: builds everything twice; set GESTALT_LONG");
        return;
    }
    if !(cfg!(target_arch = "x86_64")
        && std::fs::read_to_string("/proc/cpuinfo").is_ok_and(|cpu| cpu.contains("avx2")))
    {
        println!("skipped: this processor has no AVX2");
        return;
    }
    let (plain, wide) = (answers("-avx2,-fma"), answers("+avx2,+fma"));
    assert!(
        plain.len() > 1600 && plain.iter().any(|(name, _)| name.starts_with("decision")),
        "{}",
        plain.len()
    );
    assert_eq!(plain.len(), wide.len());
    let mut greatest = std::collections::BTreeMap::<String, f64>::new();
    for ((name, a), (other, b)) in plain.iter().zip(&wide) {
        assert_eq!(name, other, "another decision");
        let kind = name.split(':').next().unwrap_or_default().to_owned();
        let difference = greatest.entry(kind).or_default();
        *difference = difference.max((a - b).abs());
    }
    println!("greatest differences: {greatest:?}");
    assert!(greatest.values().all(|difference| *difference <= DECISIONS), "{greatest:?}");
}
