//! `fuzz`: tries inputs, says how many a second, and keeps those that fail.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;
use std::time::{Duration, Instant};

use gestalt_fuzz::{Fuzzer, Target, corpus, keep, passes, taken_in};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const USAGE: &str = "\
fuzz run TARGET [--runs N] [--seconds T] [--seed S]   tries N inputs, or as many as T seconds allow (10 s)
fuzz replay TARGET FILE...                            tries the inputs in these files
fuzz seed                                             writes the inputs of tests/fuzz/corpus that are generated
Targets: envelope, json, roster, proof, key, frame, inbox, mind, finals.";

/// Where inputs that fail are written.
const FAILURES: &str = "out/fuzz";

/// How many inputs of each target are generated for the corpus.
const SEEDS: u64 = 24;

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let done = match words.as_slice() {
        ["run", target, options @ ..] => run(target, options),
        ["replay", target, files @ ..] => replay(target, files),
        ["seed"] => seed().map(|()| true),
        _ => Err(USAGE.into()),
    };
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn run(target: &str, options: &[&str]) -> Result<bool, Box<dyn Error>> {
    let target: Target = target.parse()?;
    let (mut runs, mut time, mut seed) = (u64::MAX, None, 1);
    for option in options.chunks(2) {
        match option {
            ["--runs", number] => runs = value(number)?,
            ["--seconds", number] => time = Some(Duration::from_secs(value(number)?)),
            ["--seed", number] => seed = value(number)?,
            _ => return Err(USAGE.into()),
        }
    }
    let time = time.unwrap_or(if runs == u64::MAX { Duration::from_secs(10) } else { Duration::MAX });
    let known = corpus::read(&corpus::folder(target))?.into_iter().map(|(_, bytes)| bytes).collect();
    let mut fuzzer = Fuzzer::new(target, known, seed);
    let (began, mut tried) = (Instant::now(), 0_u64);
    // The clock costs more than an input.
    while tried < runs && (!tried.is_multiple_of(64) || began.elapsed() < time) {
        tried += 1;
        if let Err(input) = fuzzer.step() {
            let path = keep(Path::new(FAILURES), target, &input)?;
            eprintln!(
                "{target}: input {tried} of seed {seed} fails; again with: fuzz replay {target} {}",
                path.display()
            );
            return Ok(false);
        }
    }
    let seconds = began.elapsed().as_secs_f64();
    println!(
        "{target}: {tried} inputs of seed {seed} in {seconds:.1} s, {:.0} a second",
        tried as f64 / seconds
    );
    if taken_in() > 0 {
        println!("{target}: minds took in {} of what was said", taken_in());
    }
    Ok(true)
}

fn value<T: FromStr>(text: &str) -> Result<T, Box<dyn Error>> {
    text.parse().map_err(|_| format!("'{text}' is no number\n{USAGE}").into())
}

fn replay(target: &str, files: &[&str]) -> Result<bool, Box<dyn Error>> {
    let target: Target = target.parse()?;
    let mut all = true;
    for file in files {
        let passed = passes(target, &fs::read(file)?);
        println!("{target}: {file} {}", if passed { "passes" } else { "fails" });
        all &= passed;
    }
    Ok(all)
}

/// Overwrites what it wrote before; what fuzzers found stays.
fn seed() -> Result<(), Box<dyn Error>> {
    for target in Target::ALL.into_iter().filter(|target| target.corpus() == *target) {
        let folder: PathBuf = corpus::folder(target);
        fs::create_dir_all(&folder)?;
        for number in 0..SEEDS {
            let input = target.seed(&mut ChaCha8Rng::seed_from_u64(number));
            fs::write(folder.join(format!("seed-{number:02}")), input)?;
        }
    }
    Ok(())
}
