//! What convicts whoever gives it: never what honest robots give, always what a liar makes of that.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{ClassId, Decision, Envelope, FusionRule, Message, Pool, RobotId};
use gestalt_rounds::fusion::Fusion;
use gestalt_rounds::{
    Classify, ClassifyError, Follow, Fuse, Input, Judgement, Life, Observation, Output, Quorum, Rounds,
    RoundsConfig, Vocabulary, follows, is_refuted,
};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Takes the features for the probabilities, the last of which is that of "unknown".
#[derive(Debug)]
struct Verbatim {
    vocabulary: Vocabulary,
    tells: bool,
}

impl Verbatim {
    fn new(classes: usize, tells: bool) -> Arc<Self> {
        let vocabulary = Vocabulary::new((0..classes).map(|class| class.to_string())).unwrap();
        Arc::new(Self { vocabulary, tells })
    }
}

impl Classify for Verbatim {
    fn vocabulary(&self) -> &Vocabulary {
        &self.vocabulary
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        Ok(self.judge(features)?.probabilities)
    }

    fn judge(&self, features: &[f32]) -> Result<Judgement, ClassifyError> {
        let (unknown, of_classes) = features.split_last().unwrap();
        let probabilities = of_classes.iter().map(|p| f64::from(*p)).collect();
        let unknown = self.tells.then_some(f64::from(*unknown));
        Ok(Judgement { probabilities, unknown, view: None })
    }
}

/// A user's own rule: one robot, one vote, whatever the others make of it.
#[derive(Debug)]
struct Eldest;

impl Fuse for Eldest {
    fn rule(&self) -> FusionRule {
        FusionRule::Other("eldest".parse().unwrap())
    }

    fn fuse(&self, _: f64, classes: usize, votes: &[&[f32]]) -> Option<Fusion> {
        let (place, _) = votes.first()?.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
        let mut probabilities = vec![0.0; classes];
        probabilities[place] = 1.0;
        Some(Fusion { probabilities, top: ClassId(place as u32), margin: 2.0 })
    }
}

/// A robot that has learned how alike all are.
struct Learned(Option<Pool>);

impl Follow for Learned {
    fn pool(&mut self) -> Option<Pool> {
        self.0
    }
}

fn config(rng: &mut impl Rng) -> RoundsConfig {
    loop {
        let rule = FusionRule::ALL[rng.random_range(0..FusionRule::ALL.len())];
        let config = RoundsConfig {
            rule,
            alpha: rng.random_bool(0.5).then(|| rng.random_range(0.01..0.5)),
            quorum: match rng.random_bool(0.6) {
                true => Quorum::Majority,
                false => Quorum::Evidence(rng.random_range(1..6)),
            },
            liars: if rng.random_bool(0.6) { 0 } else { rng.random_range(1..3) },
            committee: [72, 0, rng.random_range(1..5)][rng.random_range(0..3)],
            clip: [6.0, rng.random_range(0.5..30.0)][rng.random_range(0..2)],
            ..RoundsConfig::default()
        };
        if config.validate().is_ok() {
            return config;
        }
    }
}

/// A swarm of honest robots with a network that loses, delays and cuts.
struct Swarm {
    rng: ChaCha8Rng,
    robots: Vec<Rounds>,
    learned: Vec<Learned>,
    /// What is on its way: when, to whom, what.
    due: Vec<(Duration, usize, Input)>,
    given: Vec<Decision>,
    cut: BTreeSet<usize>,
}

impl Swarm {
    /// Of one configuration, or of as many as robots: then they refuse each other's decisions, and are honest all the same.
    fn new(seed: u64, of_one: bool) -> (Self, RoundsConfig) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let config = config(&mut rng);
        let count = rng.random_range(1..12);
        let classes = rng.random_range(2..7);
        let own_rule = rng.random_bool(0.1);
        let (some_tell, loner) = (rng.random_bool(0.5), rng.random_bool(0.1));
        let robots = (0..count).map(|id| {
            let config = if of_one { config.clone() } else { self::config(&mut rng) };
            let life = Life { boot: 1, nonce: rng.random() };
            let mut rounds = Rounds::new(RobotId(id), life, config).unwrap();
            if own_rule {
                rounds = rounds.fused_by(Arc::new(Eldest));
            }
            let classes = if loner && id == 1 { classes + 1 } else { classes };
            rounds.handle(
                Duration::ZERO,
                Input::Learned(Verbatim::new(classes, some_tell && rng.random_bool(0.7))),
            );
            rounds
        });
        let robots: Vec<Rounds> = robots.collect();
        let config = robots[0].config().clone();
        let pool = |rng: &mut ChaCha8Rng| Pool {
            likeness: f64::from(rng.random_range(0..=20)) / 20.0,
            temperature: f64::from(rng.random_range(50..300)) / 100.0,
            rounds: 9,
        };
        // Not all have heard of the same lessons.
        let learned = robots.iter().map(|_| Learned(rng.random_bool(0.5).then(|| pool(&mut rng)))).collect();
        let mut swarm =
            Self { rng, robots, learned, due: Vec::new(), given: Vec::new(), cut: BTreeSet::new() };
        for robot in 0..swarm.robots.len() {
            swarm.tell(Duration::ZERO, robot, Input::Alive(Arc::new((0..count).map(RobotId).collect())));
            let near = (0..count).filter(|other| other.abs_diff(robot as u32) <= 2);
            swarm.tell(Duration::ZERO, robot, Input::Neighbours(near.map(RobotId).collect()));
        }
        (swarm, config)
    }

    fn tell(&mut self, now: Duration, to: usize, input: Input) {
        for output in self.robots[to].handle_with(now, input, &mut self.learned[to]) {
            match output {
                Output::Broadcast(envelope) => self.broadcast(now, to, &Input::Received(envelope)),
                Output::Announce(announcement) => {
                    self.given.push(announcement.decision.clone());
                    self.broadcast(now, to, &Input::Announced(announcement));
                }
                Output::Tell(other, envelope) => {
                    if let Envelope { message: Message::Give(give), .. } = &envelope {
                        self.given.extend(give.decision.clone());
                    }
                    self.send(now, to, other.0 as usize, Input::Received(envelope));
                }
                Output::Hold(_) | Output::Opened(_) | Output::Closed(_) => {}
            }
        }
    }

    fn broadcast(&mut self, now: Duration, from: usize, input: &Input) {
        for other in (0..self.robots.len()).filter(|other| *other != from) {
            self.send(now, from, other, input.clone());
        }
    }

    fn send(&mut self, now: Duration, from: usize, to: usize, input: Input) {
        let apart = self.cut.contains(&from) != self.cut.contains(&to);
        if !apart && self.rng.random_bool(0.8) {
            let delay = Duration::from_millis(self.rng.random_range(1..120));
            self.due.push((now + delay, to, input));
        }
    }

    /// One round, and what may happen in the midst of it.
    fn play(&mut self, began: Duration) {
        let count = self.robots.len();
        let listed = classes(&self.robots[0]);
        let shown = self.rng.random_range(0..listed);
        let sure = self.rng.random_range(0.3..1.0);
        let event = (self.rng.random_range(0..6), self.rng.random_range(100..3000));
        self.tell(began, 0, Input::Open);
        for step in 0..350 {
            let now = began + Duration::from_millis(step * 20);
            if step == event.1 / 20 {
                let some: BTreeSet<usize> = (0..count).filter(|_| self.rng.random_bool(0.3)).collect();
                let them = || some.iter().map(|robot| RobotId(*robot as u32)).collect();
                let alive =
                    (0..count as u32).map(RobotId).filter(|robot| !some.contains(&(robot.0 as usize)));
                let alive: BTreeSet<RobotId> = alive.collect();
                for robot in 0..count {
                    match event.0 {
                        0 => self.tell(now, robot, Input::Expelled(them())),
                        1 => self.tell(now, robot, Input::Alive(Arc::new(alive.clone()))),
                        2 => self.tell(now, robot, Input::Left),
                        _ => {}
                    }
                }
                self.cut = if event.0 == 3 { some } else { BTreeSet::new() };
            }
            let (arrives, rest) = std::mem::take(&mut self.due).into_iter().partition(|(at, ..)| *at <= now);
            self.due = rest;
            let arrives: Vec<_> = arrives;
            for (_, to, input) in arrives {
                self.tell(now, to, input);
            }
            for robot in 0..count {
                if step % 10 == robot as u64 % 10 && self.rng.random_bool(0.7) {
                    let input = self.frame(classes(&self.robots[robot]), shown, sure);
                    self.tell(now, robot, input);
                }
                if self.robots[robot].next_wake().is_some_and(|wake| wake <= now) {
                    self.tell(now, robot, Input::Tick);
                }
            }
        }
    }

    fn frame(&mut self, classes: usize, shown: usize, sure: f32) -> Input {
        let mut p: Vec<f32> = (0..classes).map(|_| self.rng.random_range(0.0..1.0 - sure + 0.01)).collect();
        p[shown] += sure * self.rng.random_range(0.2..1.0);
        // Some were never taught the last gesture.
        let unknown = self.rng.random_range(0.0..0.3);
        if self.rng.random_bool(0.2) {
            p[classes - 1] = unknown;
        }
        let sum: f32 = p.iter().sum();
        let features = p.iter().map(|p| p / sum).chain([unknown]).collect();
        Input::Observed(Observation { features, quality: 1.0 })
    }
}

/// How many gestures are on a robot's own list.
fn classes(robot: &Rounds) -> usize {
    robot.classifier().map_or(2, |classifier| classifier.vocabulary().classes())
}

#[test]
fn no_honest_robot_ever_gives_what_convicts_it() {
    let (mut gestures, mut nothing, mut mixed) = (0, 0, 0);
    for seed in 0..1000 {
        let of_one = seed % 4 > 0;
        let (mut swarm, _) = Swarm::new(seed, of_one);
        for round in 0..2 {
            swarm.play(Duration::from_secs(1 + 8 * round));
        }
        for decision in &swarm.given {
            assert!(!is_refuted(decision), "seed {seed}: {decision:#?}");
            gestures += u32::from(decision.class.is_some());
            nothing += u32::from(decision.class.is_none());
            mixed += u32::from(!of_one);
        }
    }
    eprintln!("{gestures} decisions for a gesture, {nothing} for none; {mixed} in mixed swarms");
    assert!(gestures > 5000 && nothing > 1000 && mixed > 500, "{gestures}, {nothing}, {mixed}");
}

/// What a liar makes of a claim, and whether that convicts it wherever the rule is one of Gestalt's; elsewhere it may be refused.
type Lie = (&'static str, bool, fn(&mut Decision));

const LIES: [Lie; 16] = [
    ("another gesture", true, |d| {
        let classes: Vec<ClassId> = d.certificate.classes().collect();
        let place = d.class.and_then(|class| d.certificate.place(class));
        d.class = place.map(|place| classes[(place + 1) % classes.len()]);
    }),
    ("surer", true, |d| d.confidence += 0.01),
    ("less sure", true, |d| d.confidence *= 0.999),
    ("another probability", true, |d| {
        d.certificate.probabilities[0] = (d.certificate.probabilities[0] - 0.5).abs()
    }),
    ("unknown", true, |d| {
        d.certificate.unknown = Some(d.certificate.unknown.map_or(0.5, |p| (p - 0.5).abs()))
    }),
    ("another quorum", true, |d| d.certificate.quorum += d.certificate.votes.len() as u32 + 1),
    ("more robots", true, |d| {
        // Where their number says nothing of what is needed, it claims nothing.
        if d.certificate.terms.majority && [0, 72].contains(&d.certificate.terms.committee) {
            d.certificate.robots += 2 * d.certificate.reached() as u32 + 2;
        }
    }),
    ("another class of a vote", true, |d| {
        let listed = d.certificate.listed() as u32;
        let class = &mut d.certificate.votes[0].class;
        *class = ClassId((class.0 + 1) % listed);
    }),
    ("another weight", true, |d| d.certificate.votes[0].weight += 0.01),
    ("a vote laid aside", true, |d| {
        let aside = d.certificate.votes.remove(0).held();
        d.certificate.others.push(aside);
        d.certificate.others.sort_by_key(|held| held.robot);
    }),
    ("a vote of another round", true, |d| d.certificate.votes[0].vote.round.counter += 1),
    ("another rule", false, |d| {
        let other = |rule: &&FusionRule| **rule != d.certificate.rule;
        d.certificate.rule = *FusionRule::ALL.iter().find(other).unwrap();
    }),
    ("another pool", false, |d| {
        d.certificate.pool = Some(Pool { likeness: 0.95, temperature: 3.0, rounds: 1 });
    }),
    ("a vote changed", false, |d| d.certificate.votes[0].vote.evidence.iter_mut().for_each(|e| *e = -*e)),
    ("other terms", false, |d| (d.certificate.terms.alpha, d.certificate.terms.clip) = (0.4, 7.5)),
    ("another quorum's terms", false, |d| d.certificate.terms.majority ^= true),
];

#[test]
fn whoever_alters_a_claim_is_convicted_or_refused() {
    let mut convicted = [0; LIES.len()];
    let mut all = 0;
    for seed in 0..200 {
        let (mut swarm, config) = Swarm::new(seed, true);
        swarm.play(Duration::from_secs(1));
        let own = matches!(config.rule, FusionRule::Other(_));
        let rule: &dyn Fuse = if own { &Eldest } else { &config.rule };
        for decision in swarm.given.iter().filter(|decision| !decision.certificate.votes.is_empty()) {
            let robots = decision.certificate.robots;
            all += u32::from(!own);
            for (n, (what, convicts, lie)) in LIES.iter().enumerate() {
                let mut altered = decision.clone();
                lie(&mut altered);
                // What no robot may say is refused before anybody asks what it follows from.
                if altered == *decision || altered.check().is_err() {
                    continue;
                }
                let is_refuted = is_refuted(&altered);
                convicted[n] += u32::from(is_refuted);
                let refused = !follows(&altered, rule, &config, robots);
                assert!(is_refuted || refused, "seed {seed}: {what}: {altered:#?}");
                let convicts = *convicts && altered.class.is_some();
                assert!(is_refuted || own || !convicts, "seed {seed}: {what}: {altered:#?}");
            }
        }
    }
    let told: Vec<_> = LIES.iter().zip(convicted).map(|((what, ..), times)| (what, times)).collect();
    eprintln!("of {all} decisions: {told:?}");
    assert!(all > 500 && convicted.iter().all(|times| *times > all / 50), "of {all}: {told:?}");
}

#[test]
fn what_is_beside_the_votes_convicts_nobody() {
    let (mut swarm, _) = Swarm::new(1, true);
    swarm.play(Duration::from_secs(1));
    let decision = swarm.given.first().unwrap().clone();
    let mut vain = decision.clone();
    (vain.author, vain.is_final, vain.round.life) = (RobotId(77), !vain.is_final, 5);
    (vain.certificate.elapsed_ms, vain.round.opener) = (1, RobotId(9));
    // Nor does that a vote may never have been cast.
    vain.certificate.votes.iter_mut().for_each(|counted| counted.signature = None);
    assert!(vain != decision && !is_refuted(&vain));
}
