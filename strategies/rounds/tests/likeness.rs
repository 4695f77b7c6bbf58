//! A pool that learns how alike its robots are: does its confidence mean what it says, and do all find the same?
//!
//! `cargo test -p gestalt-rounds --test likeness -- --nocapture` prints the figures.

use gestalt_protocol::{
    Certificate, ClassId, CountedVote, Decision, FusionRule, Pool, RobotId, RoundId, Stamp, Terms,
    VocabularyId, Vote,
};
use gestalt_rounds::{CorrelatedPool, Fuse, RoundsConfig, Testimony, Weights, fit, follows};

const CLASSES: usize = 6;
const CLIP: f64 = 6.0;

/// SplitMix64, and normal numbers by Box and Muller.
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let (u, v) = (self.next(), self.next());
        (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }
}

/// What robots say of a gesture: exact posteriors of class scores, part of whose noise is the same for all.
fn votes(robots: usize, alike: f64, signal: f64, shown: usize, chance: &mut Chance) -> Vec<Vec<f32>> {
    let common: Vec<f64> = (0..CLASSES).map(|_| chance.normal()).collect();
    let vote = |_| {
        let score = |(k, common): (usize, &f64)| {
            let noise = alike.sqrt() * common + (1.0 - alike).sqrt() * chance.normal();
            signal * (noise + if k == shown { signal } else { 0.0 })
        };
        let logs: Vec<f64> = common.iter().enumerate().map(score).collect();
        let mean = logs.iter().sum::<f64>() / CLASSES as f64;
        logs.into_iter().map(|log| (log - mean).clamp(-CLIP, CLIP) as f32).collect()
    };
    (0..robots).map(vote).collect()
}

fn decision(evidence: &[Vec<f32>], rule: &dyn Fuse) -> Decision {
    let round = RoundId { counter: 1, opener: RobotId(0), life: 0 };
    let rows: Vec<&[f32]> = evidence.iter().map(Vec::as_slice).collect();
    let fusion = rule.fuse(CLIP, CLASSES, &rows).unwrap();
    let vote = |(robot, evidence): (usize, &Vec<f32>)| CountedVote {
        robot: RobotId(robot as u32),
        stamp: Stamp { boot: 1, sequence: 1 },
        class: fusion.top,
        weight: 1.0,
        vote: Vote {
            round,
            vocabulary: VocabularyId(1),
            evidence: evidence.clone(),
            looks: 1.0,
            unknown: None,
            named: vec![],
        },
        signature: None,
    };
    Decision {
        round,
        class: Some(fusion.top),
        confidence: fusion.greatest(),
        author: RobotId(0),
        is_final: false,
        certificate: Certificate {
            vocabulary: VocabularyId(1),
            rule: rule.rule(),
            pool: rule.pool(),
            votes: evidence.iter().enumerate().map(vote).collect(),
            probabilities: fusion.probabilities,
            unknown: None,
            others: Vec::new(),
            robots: evidence.len() as u32,
            quorum: evidence.len() as u32 / 2 + 1,
            elapsed_ms: 300,
            named: vec![],
            terms: Terms::default(),
        },
    }
}

/// What a rule is told of how sure it was: confidence, and whether it was right.
#[derive(Default)]
struct Told(Vec<(f64, bool)>);

impl Told {
    /// The expected calibration error of the decisions for which it was sure enough, in ten bins.
    fn error(&self) -> f64 {
        let mut bins = [(0.0_f64, 0.0_f64); 10];
        self.0.iter().for_each(|(p, right)| {
            let bin = &mut bins[((p * 10.0) as usize).min(9)];
            *bin = (bin.0 + p, bin.1 + f64::from(u8::from(*right)));
        });
        bins.iter().map(|(p, right)| (p - right).abs()).sum::<f64>() / self.0.len().max(1) as f64
    }

    fn of_at_least(&self, confidence: f64) -> (usize, usize) {
        let sure = self.0.iter().filter(|(p, _)| *p >= confidence);
        (sure.clone().filter(|(_, right)| !right).count(), sure.count())
    }
}

/// All rounds of twenty seeds, by the log pool and by one that learns from each round what it was.
fn compared(robots: usize, alike: f64, signal: f64) -> (Told, Told, Pool) {
    let (mut independent, mut fitted) = (Told::default(), Told::default());
    let mut last = Pool::PRIOR;
    for seed in 0..20 {
        let mut chance = Chance(seed);
        let mut rounds: Vec<Weights> = Vec::new();
        for _ in 0..60 {
            let shown = (chance.next() * CLASSES as f64) as usize;
            let evidence = votes(robots, alike, signal, shown, &mut chance);
            last = fit(rounds.iter());
            let by_pool = decision(&evidence, &CorrelatedPool(last));
            for (told, decision) in [
                (&mut independent, decision(&evidence, &FusionRule::LogPool)),
                (&mut fitted, by_pool.clone()),
            ] {
                told.0.push((decision.confidence, decision.class == Some(ClassId(shown as u32))));
            }
            rounds.extend(Testimony::of(&by_pool, CLIP).unwrap().weigh(&|class| class.index() == shown));
        }
    }
    (independent, fitted, last)
}

#[test]
fn confidence_means_what_it_says_whatever_robots_have_in_common() {
    println!("robots alike | log pool: error, wrong of >= .99 | correlated pool | fitted last");
    let (mut wrong, mut sure) = (0, 0);
    for (robots, alike) in [(2, 0.5), (5, 0.0), (5, 0.5), (10, 0.0), (10, 0.5), (10, 0.9), (30, 0.5)] {
        let (independent, fitted, last) = compared(robots, alike, 1.5);
        let (a, b) = (independent.of_at_least(0.99), fitted.of_at_least(0.99));
        println!(
            "{robots:>6} {alike:>5} | {:.3}, {} of {} | {:.3}, {} of {} | {last:?}",
            independent.error(),
            a.0,
            a.1,
            fitted.error(),
            b.0,
            b.1
        );
        assert!(fitted.error() <= 0.05, "{robots} robots, alike {alike}: {}", fitted.error());
        (wrong, sure) = (wrong + b.0, sure + b.1);
        // One in fifty would be as good as hoped for; half alike robots come to three to four in a hundred.
        assert!(b.0 as f64 <= 0.05 * b.1 as f64 + 1.0, "{robots} robots, alike {alike}: {b:?}");
        if alike >= 0.5 && robots >= 5 {
            assert!(fitted.error() < independent.error() / 2.0, "{robots} robots, alike {alike}");
        }
        // The likeliest gesture is the same for both.
        let right = |told: &Told| told.0.iter().filter(|(_, right)| *right).count();
        assert_eq!(right(&independent), right(&fitted));
    }
    println!("correlated pool, all of these: {wrong} of {sure} said with >= .99 are wrong");
    assert!(wrong * 50 <= sure, "{wrong} of {sure}");
}

#[test]
fn rounds_without_a_mistake_are_no_proof_of_certainty() {
    let mut chance = Chance(9);
    let easy: Vec<Weights> = (0..20)
        .map(|_| {
            let evidence = votes(5, 0.5, 4.0, 2, &mut chance);
            let testimony = Testimony::of(&decision(&evidence, &FusionRule::LogPool), CLIP).unwrap();
            testimony.weigh(&|class| class.index() == 2).unwrap()
        })
        .collect();
    let pool = fit(easy.iter());
    assert!(pool.temperature > 0.6 && pool.likeness > 0.25, "{pool:?}");
    assert_eq!((pool.rounds, fit([].iter())), (20, Pool::PRIOR));
}

#[test]
fn a_certificate_is_checked_by_the_pool_that_it_names() {
    let mut chance = Chance(3);
    let evidence = votes(5, 0.5, 3.0, 1, &mut chance);
    let config = RoundsConfig { rule: FusionRule::CorrelatedPool, ..RoundsConfig::default() };
    let follows_from =
        |decision: &Decision, config: &RoundsConfig| follows(decision, &config.rule, config, 5);
    let pool = Pool { likeness: 0.3, temperature: 0.82, rounds: 12 };
    let fitted = decision(&evidence, &CorrelatedPool(pool));
    let prior = decision(&evidence, &FusionRule::CorrelatedPool);
    assert!(follows_from(&fitted, &config) && follows_from(&prior, &config));

    let said = |pool: Option<Pool>| {
        let certificate = Certificate { pool, ..fitted.certificate.clone() };
        follows_from(&Decision { certificate, ..fitted.clone() }, &config)
    };
    assert!(!said(None), "without a pool there is nothing to compute");
    assert!(!said(Some(Pool { likeness: 0.35, ..pool })), "another likeness gives other probabilities");
    assert!(!said(Some(Pool { temperature: 0.0, ..pool })) && !said(Some(Pool { likeness: -1.0, ..pool })));
    let other_rule = RoundsConfig { rule: FusionRule::LogPool, ..RoundsConfig::default() };
    assert!(!follows_from(&fitted, &other_rule));
    // Where liars are expected nobody's word on what robots have in common counts.
    let wary = RoundsConfig { liars: 1, ..config };
    let by_wary = |decision: &Decision| {
        let (terms, quorum) = (wary.terms(), wary.needs(5));
        let certificate = Certificate { terms, quorum, ..decision.certificate.clone() };
        Decision { certificate, ..decision.clone() }
    };
    assert!(!follows_from(&by_wary(&fitted), &wary), "a liar may have chosen it");
    assert!(follows_from(&by_wary(&prior), &wary) || prior.confidence < 0.99);
    assert!(!follows_from(&prior, &wary), "it is one of robots that expect no liar");
}
