//! Rules of your own for sharing, forgetting and fusing, tried on an emulated swarm against those that come with Gestalt.
//!
//! ```text
//! cargo run -p gestalt-examples --example own_rules
//! ```
//!
//! What works here is put into a robot by the same types: `LearningSetup::rules` and `Mind::fused_by`; and into an experiment
//! over many seeds by `gestalt_lab::experiment::conduct_by`.

use std::error::Error;
use std::sync::Arc;

use gestalt_lab::emulation::{Report, Rules, Scenario, Trace, run, run_by};
use gestalt_protocol::{ClassId, FusionRule};
use gestalt_strategies::fusion::Fusion;
use gestalt_strategies::sample::{HeldSamples, SetPart};
use gestalt_strategies::{Classify, Forgetting, Fuse, OwnRules, Selection};
use rand::Rng;

/// Shares the newest first: what is shown now is what the swarm talks about.
#[derive(Debug)]
struct Newest;

impl Selection for Newest {
    fn select(&mut self, samples: &HeldSamples, _: Option<&dyn Classify>, rng: &mut dyn Rng) -> Option<u64> {
        let class = samples.draw_personal_class(rng)?;
        samples.part_keys(SetPart::Personal, class).last().copied()
    }
}

/// The first impression counts: whatever comes when the set is full goes at once.
#[derive(Debug)]
struct FirstImpression;

impl Forgetting for FirstImpression {
    fn victim(&mut self, samples: &HeldSamples, _: &mut dyn Rng) -> Option<u64> {
        samples.iter().next_back().map(|newest| newest.key)
    }
}

/// Each robot has one vote for every class that it does not think unlikely.
#[derive(Debug)]
struct Approval;

impl Fuse for Approval {
    fn rule(&self) -> FusionRule {
        FusionRule::Other("approval".parse().expect("a short plain name"))
    }

    fn fuse(&self, _clip: f64, classes: usize, votes: &[&[f32]]) -> Option<Fusion> {
        let approving = |class: usize| votes.iter().filter(|vote| vote[class] >= 0.0).count() as f64;
        let approved: Vec<f64> = (0..classes).map(approving).collect();
        let all: f64 = approved.iter().sum();
        let mut order: Vec<usize> = (0..classes).collect();
        // Stable: of equals the smaller class.
        order.sort_by(|a, b| approved[*b].total_cmp(&approved[*a]));
        (all > 0.0).then(|| Fusion {
            probabilities: approved.iter().map(|n| n / all).collect(),
            top: ClassId(order[0] as u32),
            margin: approved[order[0]] - approved[order[1]],
        })
    }
}

fn own() -> Rules {
    let learning =
        OwnRules::default().selection(|| Box::new(Newest)).forgetting(|| Box::new(FirstImpression));
    Rules { learning, fusion: Some(Arc::new(Approval)) }
}

/// Eight robots with poor eyes, taught each of three gestures eight times; no robot keeps more than 40 samples.
fn scenario() -> Result<Scenario, Box<dyn Error>> {
    let text = "{
        robots: [{ name: 'robot', count: 8, view: { fps: 2, signal: 4, persistence: 0.5 } }],
        topology: 'ring', classes: 3, rounds: 24, order: 'in_turn',
        mind: { alpha: 0.45 },
        learning: { robots: { capacity: 40 } },
    }";
    Ok(Scenario::parse(text, "own_rules")?)
}

fn say(rules: &str, report: &Report) {
    let percent = |share: f64| format!("{:3.0} %", 100.0 * share);
    println!(
        "{rules:<16} decided rightly {}, wrongly {}; one frame of one robot is right in {}",
        percent(report.right.share),
        percent(report.wrong.share),
        percent(report.frames_right.share)
    );
}

fn main() -> Result<(), Box<dyn Error>> {
    let scenario = scenario()?;
    say("Gestalt's rules", &run(&scenario, 1)?);
    say("your own", &run_by(&scenario, 1, own(), Trace::none())?.0);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All that happens, as text.
    fn trace(rules: Rules) -> String {
        let mut bytes = Vec::new();
        let scenario = scenario().unwrap();
        let (_, written) = run_by(&scenario, 1, rules, Trace::to(&mut bytes)).unwrap();
        written.unwrap();
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn each_rule_of_ones_own_changes_what_a_swarm_does() {
        let usual = trace(Rules::default());
        assert_eq!(usual, trace(Rules::default()), "a seed fixes every byte");
        let selecting = OwnRules::default().selection(|| Box::new(Newest));
        let forgetting = OwnRules::default().forgetting(|| Box::new(FirstImpression));
        for (name, rules) in [
            ("selection", Rules { learning: selecting, fusion: None }),
            ("forgetting", Rules { learning: forgetting, fusion: None }),
            ("fusion", Rules { learning: OwnRules::default(), fusion: Some(Arc::new(Approval)) }),
        ] {
            assert_ne!(usual, trace(rules), "{name}");
        }
    }

    #[test]
    fn a_swarm_decides_by_rules_of_ones_own() {
        let (report, _) = run_by(&scenario().unwrap(), 1, own(), Trace::none()).unwrap();
        assert!(report.right.hits > 0 && report.undecided.hits < report.undecided.trials, "{report:?}");
        let samples = report.learned.unwrap().samples.mean;
        assert!(samples > 0.0 && samples <= 40.0, "{samples}");
        main().unwrap();
    }
}
