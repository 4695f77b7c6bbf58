//! What happens to three robots: what they see, what the network does, and what a stranger says.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{Envelope, Instruction, Message, RobotId, RoundId};
use gestalt_strategies::{Input, Instructed};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::robot;
use super::world::{ROBOTS, Said, World};
use crate::robot::{COMPONENTS, frame, space};
use crate::values;

/// The most events of one input.
const MOST: usize = 400;

/// Reads events from bytes; what is missing at the end is 0.
pub struct Events<'a> {
    bytes: &'a [u8],
    left: usize,
}

impl<'a> Events<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, left: MOST }
    }

    fn next(&mut self) -> Option<u8> {
        self.left = self.left.checked_sub(1)?;
        let (first, rest) = self.bytes.split_first()?;
        self.bytes = rest;
        Some(*first)
    }

    fn byte(&mut self) -> u8 {
        let first = self.bytes.split_off_first();
        first.copied().unwrap_or_default()
    }

    fn place(&mut self) -> usize {
        usize::from(self.byte())
    }

    /// One of the honest robots.
    fn robot(&mut self) -> usize {
        self.place() % ROBOTS
    }

    /// Chance, as two bytes choose it: so that a few bytes are a whole message.
    fn chance(&mut self) -> ChaCha8Rng {
        ChaCha8Rng::seed_from_u64(u64::from(u16::from_le_bytes([self.byte(), self.byte()])))
    }

    fn take(&mut self, length: usize) -> &'a [u8] {
        let (taken, rest) = self.bytes.split_at(length.min(self.bytes.len()));
        self.bytes = rest;
        taken
    }
}

/// The next event; `None` after the last.
pub fn event(world: &mut World, events: &mut Events<'_>) -> Option<()> {
    let ms = |ms: u64| Duration::from_millis(ms);
    match events.next()? % 24 {
        // What robots see.
        0 | 1 => {
            let (robot, class, sure) = (events.robot(), events.byte(), events.byte());
            world.input(robot, frame(class.into(), f32::from(sure) / 255.0, sure ^ class));
        }
        2 => {
            let (class, sure) = (events.byte(), events.byte());
            (0..ROBOTS)
                .for_each(|robot| world.input(robot, frame(class.into(), f32::from(sure) / 255.0, sure)));
        }
        3 => world.input(events.robot(), Input::Open),
        4 => {
            let (robot, what) = (events.robot(), events.byte());
            let input = match what % 4 {
                0 => Input::Shown(world.now.saturating_sub(ms(u64::from(what) * 10))),
                1 => Input::Left,
                other => Input::Blind(other == 2),
            };
            world.input(robot, input);
        }
        // What the network does.
        PASS => world.pass(ms(1 + 10 * u64::from(events.byte())), true),
        6 => world.pass(ms(1 + 10 * u64::from(events.byte())), false),
        7 => world.arrive(events.place()),
        8 => world.lose(events.place()),
        9 => world.repeat(events.place()),
        10 => world.arrive_all(),
        11 => {
            let (one, other) = (events.robot(), events.place());
            match other / 2 % ROBOTS {
                // Nobody has a link with itself.
                itself if itself == one => world.restart(one, other & 1 == 0),
                another => world.cut(one, another, other & 1 == 1),
            }
        }
        12 => {
            let (robot, who) = (events.robot(), events.byte());
            let robots: BTreeSet<RobotId> =
                (0..7).filter(|bit| who >> bit & 1 == 1).map(|bit| RobotId(bit + 1)).collect();
            world.mislead(
                robot,
                if who & 128 == 0 { Input::Alive(Arc::new(robots)) } else { Input::Neighbours(robots) },
            );
        }
        13 => {
            let (robot, which) = (events.robot(), events.place());
            if let Some(said) = world.recall(which) {
                world.hear(robot, said);
            }
        }
        // What people say.
        14 => {
            let (to, mut chance) = (events.place(), events.chance());
            let (by, at) = (values::instructor(&mut chance), world.now.as_millis() as u64);
            let instruction = about(values::instruction(&mut chance), round(world, to));
            // To one or two of them, or to all.
            for robot in (0..ROBOTS).filter(|robot| to & 3 == 3 || to >> robot & 1 == 1) {
                let by = by.clone();
                world.input(
                    robot,
                    Input::Instructed(Instructed { by, at, instruction: instruction.clone(), said: None }),
                );
            }
        }
        // What a stranger says, in any name.
        15 => {
            let (to, mut chance) = (events.robot(), events.chance());
            world.hear(to, Said::Message(values::envelope(&mut chance)));
        }
        16 => {
            let (to, length) = (events.robot(), events.place());
            if let Ok(envelope) = Envelope::decode(events.take(length)) {
                world.hear(to, Said::Message(envelope));
            }
        }
        17 => vote(world, events),
        18 => knowledge(world, events),
        19 => many(world, events),
        20 => holding(world, events),
        21 => altered(world, events),
        22 => {
            let (to, mut chance) = (events.robot(), events.chance());
            world.hear(to, Said::Announced(values::announcement(&mut chance)));
        }
        _ => {
            let (to, by, at) = (events.robot(), values::instructor(&mut events.chance()), events.byte());
            world.hear(to, Said::Answered(by, at.into(), robot(to + 1)));
        }
    }
    Some(())
}

/// The round that a robot is in, or one that nobody knows.
fn round(world: &World, which: usize) -> RoundId {
    let known = world.robots()[which % ROBOTS].mind().round();
    known.unwrap_or(RoundId { counter: 1, opener: RobotId(1), life: 1 })
}

/// The same word about that round.
fn about(instruction: Instruction, round: RoundId) -> Instruction {
    match instruction {
        Instruction::Open => Instruction::Open,
        Instruction::Was { class, .. } => Instruction::Was { round, class },
        Instruction::Right { of, .. } => Instruction::Right { round, of },
        Instruction::Wrong { of, .. } => Instruction::Wrong { round, of },
        Instruction::Retract { .. } => Instruction::Retract { round },
        Instruction::New { label, .. } => Instruction::New { label, round: Some(round) },
        named @ (Instruction::Same { .. } | Instruction::Retire { .. } | Instruction::Restore { .. }) => {
            named
        }
    }
}

fn say(world: &mut World, to: usize, author: RobotId, message: Message, chance: &mut impl Rng) {
    let stamp = values::stamp(chance);
    world.hear(to, Said::Message(Envelope { author, stamp, message, signature: None }));
}

/// A vote in somebody's name, under a signature of nobody's, in the round that is open.
fn vote(world: &mut World, events: &mut Events<'_>) {
    let (to, mut chance) = (events.robot(), events.chance());
    let vote = values::vote(&mut chance, round(world, to), 3);
    let (author, signature) = (values::robot(&mut chance), Some(values::signature(&mut chance)));
    let stamp = values::stamp(&mut chance);
    world.hear(to, Said::Message(Envelope { author, stamp, message: Message::Vote(vote), signature }));
}

/// Questions, samples and lessons, which nobody signs.
fn knowledge(world: &mut World, events: &mut Events<'_>) {
    let (to, kind, mut chance) = (events.robot(), events.byte(), events.chance());
    let chance = &mut chance;
    let message = match kind % 4 {
        0 => values::have(chance),
        1 => values::know(chance),
        2 => {
            let id = values::sample_id(
                values::robot(chance),
                values::number(chance),
                values::number(chance).max(1),
            );
            values::samples(space().id(), vec![values::sample(chance, id, COMPONENTS)])
        }
        _ => values::lessons(vec![values::lesson(chance, round(world, to))]),
    };
    say(world, to, robot(usize::from(kind >> 2)), message, chance);
}

/// As much of something as fits in a message.
fn many(world: &mut World, events: &mut Events<'_>) {
    let (to, kind, mut chance) = (events.robot(), events.byte(), events.chance());
    let chance = &mut chance;
    let (first, most) = (values::number(chance), 1 + u32::from(kind >> 2) * 4);
    let message = match kind % 4 {
        0 => {
            let sample = |number| {
                let id = values::sample_id(RobotId(90), first, number);
                values::sample(chance, id, COMPONENTS)
            };
            let samples = (1..=most).map(sample).collect();
            values::samples(space().id(), samples)
        }
        1 => {
            let sample = |author| {
                let id = values::sample_id(RobotId(author), first, 1);
                values::sample(chance, id, COMPONENTS)
            };
            let samples = (100..100 + most).map(sample).collect();
            values::samples(space().id(), samples)
        }
        2 => {
            let current = round(world, to);
            let of = |life| RoundId { counter: current.counter.saturating_add(life % 8), life, ..current };
            let lessons = (0..most).map(|life| values::lesson(chance, of(life))).collect();
            values::lessons(lessons)
        }
        _ => {
            let robots = (0..most * 8).map(RobotId).collect();
            return world.mislead(to, Input::Alive(Arc::new(robots)));
        }
    };
    say(world, to, robot(to + 1), message, chance);
}

/// What a robot does not hold.
fn holding(world: &mut World, events: &mut Events<'_>) {
    let (to, mut chance) = (events.robot(), events.chance());
    let mut holding = values::holding(&mut chance);
    holding.round = round(world, to);
    let (author, signature) = (values::robot(&mut chance), Some(values::signature(&mut chance)));
    let (stamp, message) = (values::stamp(&mut chance), Message::Holding(holding));
    world.hear(to, Said::Message(Envelope { author, stamp, message, signature }));
}

/// Something that was said, with another of the values that nobody signs.
fn altered(world: &mut World, events: &mut Events<'_>) {
    let (to, which, what, mut chance) = (events.robot(), events.place(), events.byte(), events.chance());
    let number = values::number(&mut chance);
    let Some(mut said) = world.recall(which) else { return };
    match &mut said {
        Said::Announced(announcement) => {
            let decision = &mut announcement.decision;
            let certificate = &mut decision.certificate;
            match what % 9 {
                8 => announcement.announcer = RobotId(number),
                0 => decision.author = RobotId(number),
                1 => decision.is_final ^= true,
                2 => decision.class = Some(values::class(&mut chance)),
                3 => decision.round = values::round(&mut chance),
                4 => certificate.robots = number,
                5 => certificate.elapsed_ms = number,
                6 => drop(certificate.votes.pop()),
                _ => certificate.quorum = number,
            }
        }
        Said::Message(envelope) => match what % 4 {
            0 => envelope.author = RobotId(number),
            1 => envelope.stamp = values::stamp(&mut chance),
            2 => envelope.message = values::message(&mut chance),
            _ => envelope.signature = None,
        },
        Said::Asked(question) => match what % 4 {
            0 => question.robot = RobotId(number),
            1 => question.round = values::round(&mut chance),
            2 => question.signature = None,
            _ => *question = values::question(&mut chance),
        },
        Said::Answered(_, at, _) => *at = number.into(),
    }
    world.hear(to, said);
}

/// A gesture is shown, seen and taught, and a few things happen meanwhile; or robots that see different ones hear each other late; or
/// a stranger says what it can of them, and nothing is late.
pub fn seed(rng: &mut impl Rng) -> Vec<u8> {
    let mut events = Vec::new();
    for _ in 0..rng.random_range(1..4) {
        events.extend([3, rng.random(), PASS, 1]);
        match rng.random_range(0..3) {
            0 => (0..rng.random_range(1..8)).for_each(|_| happens(rng, &mut events)),
            1 => contested(rng, &mut events),
            _ => slandered(rng, &mut events),
        }
        events.extend([PASS, 255, 14, 3 | rng.random::<u8>() << 2, rng.random(), rng.random(), PASS, 200]);
    }
    events
}

/// Time passes, and messages arrive.
const PASS: u8 = 5;

fn happens(rng: &mut impl Rng, events: &mut Vec<u8>) {
    match rng.random_range(0..4) {
        0 => events.extend([2, rng.random_range(0..3), rng.random_range(128..255), PASS, 26]),
        1 => events.extend([0, rng.random(), rng.random_range(0..3), rng.random_range(128..255)]),
        2 => events.extend([PASS, rng.random()]),
        _ => events.extend(rng.random::<[u8; 5]>()),
    }
}

/// Each robot sees what it sees; what they say of it arrives one by one, late or never.
fn contested(rng: &mut impl Rng, events: &mut Vec<u8>) {
    for robot in 0..ROBOTS as u8 {
        events.extend([0, robot, rng.random_range(0..2), rng.random_range(150..255)]);
    }
    for _ in 0..rng.random_range(8..60) {
        match rng.random_range(0..12) {
            0..5 => events.extend([7, rng.random_range(0..8)]),
            5..8 => events.extend([6, rng.random_range(0..40)]),
            8 => events.extend([PASS, rng.random_range(0..30)]),
            9 => events.extend([8, rng.random_range(0..8)]),
            10 => events.extend([11, rng.random(), rng.random()]),
            _ => events.extend([0, rng.random(), rng.random_range(0..2), rng.random_range(150..255)]),
        }
    }
}

/// Robots see different gestures, and a stranger says what they hold, and again what they said, with a little change.
fn slandered(rng: &mut impl Rng, events: &mut Vec<u8>) {
    for _ in 0..rng.random_range(8..60) {
        match rng.random_range(0..8) {
            0 | 1 => events.extend([0, rng.random(), rng.random_range(0..2), rng.random_range(150..255)]),
            2 | 3 => events.extend([PASS, rng.random_range(0..40)]),
            4 => events.extend([13, rng.random(), rng.random()]),
            5 => events.extend([20, rng.random(), rng.random(), rng.random()]),
            6 => events.extend([21, rng.random(), rng.random(), rng.random(), rng.random(), rng.random()]),
            _ => events.extend([17, rng.random(), rng.random(), rng.random()]),
        }
    }
}
