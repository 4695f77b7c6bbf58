//! Robots that lie in league: whatever they do, a swarm that expects so many announces no other gesture than the one shown as final.
//!
//! `GESTALT_LONG=1 cargo test -p gestalt-lab --test liars -- --nocapture` runs 50 rounds of 20 seeds each and prints the table.

use std::num::NonZero;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

use gestalt_lab::emulation::{Lies, Report, Scenario, run};
use gestalt_protocol::FusionRule;

const MANNERS: [Lies; 3] = [Lies::Choosing, Lies::TwoFaced, Lies::Together];

/// A swarm of `robots` that see well, of which `liars` lie, and which expects `expected` of them.
#[derive(Clone, Copy, Debug)]
struct Case {
    rule: FusionRule,
    robots: usize,
    liars: usize,
    expected: u32,
    lies: Lies,
}

impl Case {
    fn scenario(self, rounds: u32) -> Scenario {
        // The liars come first: the spokesrobot is one of them.
        let text = "{
            robots: [
                { name: 'liar', count: 1, lies: 'together' },
                { name: 'robot', count: 1, view: { fps: 4, signal: 4, persistence: 0.5 } },
            ],
            topology: 'random',
            link: { latency: '2ms', jitter: '5ms', loss: 0.02 },
        }";
        let mut scenario = Scenario::parse(text, "liars").unwrap();
        scenario.robots[0].count = self.liars;
        scenario.robots[0].lies = Some(self.lies);
        scenario.robots[1].count = self.robots - self.liars;
        scenario.rounds = rounds;
        scenario.mind.rule = self.rule;
        scenario.mind.liars = self.expected;
        scenario
    }
}

/// Of all rounds of some seeds: how many there were, and in how many the right gesture was announced as final, another one was, a decision
/// for another could be drawn from what had been said, and one was held at the end.
#[derive(Clone, Copy, Debug, Default)]
struct Outcome {
    rounds: u64,
    right: u64,
    wrong: u64,
    forged: u64,
    held: u64,
}

impl Outcome {
    fn and(self, report: &Report) -> Self {
        Self {
            rounds: self.rounds + report.finally_right.trials,
            right: self.right + report.finally_right.hits,
            wrong: self.wrong + report.finally_wrong.hits,
            forged: self.forged + report.forged.hits,
            held: self.held + report.wrong.hits,
        }
    }
}

fn outcome(case: Case, seeds: u64, rounds: u32) -> Outcome {
    let scenario = case.scenario(rounds);
    (0..seeds).fold(Outcome::default(), |sum, seed| sum.and(&run(&scenario, seed).unwrap()))
}

/// Tells each case with its outcome as soon as that is there; runs on all cores.
fn outcomes(cases: &[Case], seeds: u64, rounds: u32, tell: impl Fn(Case, Outcome) + Sync) {
    let next = AtomicUsize::new(0);
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(1, NonZero::get) {
            scope.spawn(|| {
                while let Some(case) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
                    tell(*case, outcome(*case, seeds, rounds));
                }
            });
        }
    });
}

fn cases(sizes: &[usize], liars: impl Fn(usize) -> Vec<usize>) -> Vec<Case> {
    let mut cases = Vec::new();
    for lies in MANNERS {
        for rule in FusionRule::ALL {
            for &robots in sizes {
                for f in liars(robots) {
                    cases.push(Case { rule, robots, liars: f, expected: f as u32, lies });
                }
            }
        }
    }
    cases
}

#[test]
fn with_liars_expected_nothing_wrong_is_final_and_most_rounds_are_decided() {
    let cases = cases(&[4, 8, 12], |robots| vec![robots / 4]);
    outcomes(&cases, 2, 8, |case, outcome| {
        assert_eq!((outcome.wrong, outcome.held), (0, 0), "{case:?}: {outcome:?}");
        assert!(3 * outcome.right >= 2 * outcome.rounds, "{case:?}: {outcome:?}");
    });
}

#[test]
fn liars_that_nobody_expects_succeed() {
    let case = Case { rule: FusionRule::LogPool, robots: 4, liars: 1, expected: 0, lies: Lies::Choosing };
    let outcome = outcome(case, 2, 8);
    assert!(outcome.forged > 0, "{outcome:?}");
}

#[test]
fn the_table_of_liars() {
    if std::env::var_os("GESTALT_LONG").is_none() {
        println!("skipped: takes minutes; set GESTALT_LONG");
        return;
    }
    let expected = cases(&[4, 8, 12, 20], |robots| (1..=robots / 4).collect());
    println!(
        "| rule | n | f | they lie | rounds | `liars: f`: right | wrong | held | forged | `liars: 0`: right | wrong | held | forged |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    let all_true = AtomicBool::new(true);
    let (seeds, rounds) = (20, 50);
    outcomes(&expected, seeds, rounds, |case, with| {
        let without = outcome(Case { expected: 0, ..case }, seeds, rounds);
        let told = |of: Outcome| {
            let right = 100.0 * of.right as f64 / of.rounds as f64;
            format!("{right:.1} % | {} | {} | {}", of.wrong, of.held, of.forged)
        };
        let Case { rule, robots, liars, lies, .. } = case;
        println!(
            "| {rule} | {robots} | {liars} | {lies:?} | {} | {} | {} |",
            with.rounds,
            told(with),
            told(without)
        );
        all_true.fetch_and(with.wrong == 0, Ordering::Relaxed);
    });
    assert!(all_true.into_inner(), "liars had their way");
}
