//! Which ways to count are compared.

use std::collections::BTreeSet;
use std::time::Duration;

use gestalt_protocol::{FusionRule, RobotId};
use gestalt_strategies::{MindConfig, Quorum};
use gestalt_tape::{Run, WhatIf};

use super::super::Failure;
use super::Args;

/// The most ways that are compared at once.
const MOST: usize = 10_000;

/// Something of which all values are tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Axis {
    Rule,
    Quorum,
    Alpha,
    Liars,
    Until,
    Robots,
}

pub(super) fn rule(name: &str) -> Result<FusionRule, String> {
    let known = || FusionRule::ALL.map(|rule| rule.name().to_owned()).join(", ");
    FusionRule::ALL
        .into_iter()
        .find(|rule| rule.name() == name)
        .ok_or_else(|| format!("use one of {}", known()))
}

pub(super) fn quorum(text: &str) -> Result<Quorum, String> {
    match text {
        "majority" => Ok(Quorum::Majority),
        number => {
            number.parse().map(Quorum::Evidence).map_err(|_| "use majority, or a number of robots".to_owned())
        }
    }
}

pub(super) fn speed(text: &str) -> Result<f64, String> {
    let speed = text.parse().ok().filter(|speed: &f64| speed.is_finite() && *speed >= 0.0);
    speed.ok_or_else(|| "use 0 or a positive number".to_owned())
}

/// One way to count, and the configuration of robots that count so.
pub(super) struct Variant {
    pub what: WhatIf,
    pub config: MindConfig,
}

/// All combinations of what is asked for. Those that no robot could be configured to are left out of a sweep; a value that was asked for by name is an error
/// where nothing is left of it.
pub(super) fn variants(args: &Args, run: &Run, was: &MindConfig) -> Result<Vec<Variant>, Failure> {
    let robots = run.robots();
    let n = u32::try_from(robots.len()).unwrap_or(u32::MAX);
    let swept = |axis| args.sweep.contains(&axis);
    let rules = or(&args.rule, swept(Axis::Rule), || FusionRule::ALL.to_vec());
    let quorums = or(&args.quorum, swept(Axis::Quorum), || {
        [Quorum::Majority].into_iter().chain((1..=n).map(Quorum::Evidence)).collect()
    });
    let alphas = or(&args.alpha, swept(Axis::Alpha), || vec![0.001, 0.01, 0.05, 0.1, 0.2, 0.3, 0.4]);
    let liars = or(&args.liars, swept(Axis::Liars), || (0..=n.saturating_sub(1) / 2).collect());
    let untils = or(&args.until, swept(Axis::Until), || vec![100, 200, 300, 400, 600, 800, 1200, 2000, 5000]);
    let given: BTreeSet<RobotId> = args.without.iter().copied().collect();
    if let Some(nobody) = given.difference(&robots).next() {
        return Err(format!("--without {nobody}: there is no such robot in the recording").into());
    }
    let mut absent = vec![given.clone()];
    if swept(Axis::Robots) {
        let one_more = |robot: &RobotId| given.iter().chain([robot]).copied().collect();
        absent.extend(robots.iter().filter(|robot| !given.contains(robot)).map(one_more));
    }
    let count = [rules.len(), quorums.len(), alphas.len(), liars.len(), untils.len(), absent.len()];
    let count = count.iter().fold(1_usize, |all, each| all.saturating_mul(*each));
    if count > MOST {
        return Err(format!("{count} combinations, at most {MOST} are counted at once: sweep less").into());
    }
    let (mut variants, mut refused) = (Vec::with_capacity(count), Vec::new());
    for rule in &rules {
        for quorum in &quorums {
            for alpha in &alphas {
                for liars in &liars {
                    for until in &untils {
                        for without in &absent {
                            let (rule, quorum, alpha, liars) = (*rule, *quorum, *alpha, *liars);
                            let (until, without) = (until.map(Duration::from_millis), without.clone());
                            let what = WhatIf { rule, quorum, alpha, liars, without, until };
                            match what.config(was) {
                                Ok(config) => variants.push(Variant { what, config }),
                                Err(error) => refused.push((what, error)),
                            }
                        }
                    }
                }
            }
        }
    }
    let lost = refused.iter().find(|(what, _)| args.sweep.is_empty() || is_lost(args, what, &variants));
    if let Some((what, error)) = lost {
        return Err(format!("{what}: {error}").into());
    }
    // As it was is the first line of the table already.
    variants.retain(|variant| variant.what != WhatIf::default());
    Ok(variants)
}

/// Whether nothing is left of a value in it that was asked for by name.
fn is_lost(args: &Args, refused: &WhatIf, left: &[Variant]) -> bool {
    let is_left = |has: &dyn Fn(&WhatIf) -> bool| left.iter().any(|variant| has(&variant.what));
    !args.rule.is_empty() && !is_left(&|left| left.rule == refused.rule)
        || !args.quorum.is_empty() && !is_left(&|left| left.quorum == refused.quorum)
        || !args.alpha.is_empty() && !is_left(&|left| left.alpha == refused.alpha)
        || !args.liars.is_empty() && !is_left(&|left| left.liars == refused.liars)
}

/// The values asked for; all of them in a sweep; else nothing, which leaves it as it was.
fn or<T: Clone>(given: &[T], swept: bool, all: impl FnOnce() -> Vec<T>) -> Vec<Option<T>> {
    match (given, swept) {
        ([], true) => all().into_iter().map(Some).collect(),
        ([], false) => vec![None],
        (given, _) => given.iter().cloned().map(Some).collect(),
    }
}
