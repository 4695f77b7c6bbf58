//! What is said, and when it arrives.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use gestalt_protocol::{Answer, Decision, Envelope, Keys, Message, RobotId, Topic};
use gestalt_strategies::{Input, Mind, Output};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::plan::Plan;
use super::port::Parcel;
use super::robot::{Account, Robot, is_vote};
use super::shown::Shown;
use super::world::{SWARM, key, roster};
use crate::attack::Setting;
use crate::trust::{Channels, Roster, answer};

/// What is to happen.
#[derive(Debug)]
pub(super) enum Due {
    /// A message arrives at a robot.
    Arrive(usize, Parcel),
    /// A robot's camera takes a frame, if that is still the camera that was begun so many times.
    Frame(usize, u64),
}

/// A swarm of honest robots, and an adversary.
#[derive(Debug)]
pub struct Swarm {
    pub(super) plan: Plan,
    pub(super) roster: Roster,
    /// Whether the adversary keeps silent.
    pub(super) peace: bool,
    pub(super) now: Duration,
    pub(super) robots: Vec<Robot>,
    pub(super) tokens: BTreeSet<RobotId>,
    /// Robots between which and the others nothing arrives.
    pub(super) cut: BTreeSet<RobotId>,
    /// Which gesture is shown.
    pub(super) gesture: Option<u32>,
    pub(super) shown: Vec<Shown>,
    pub(super) announced: Vec<(Duration, RobotId, Decision)>,
    pub(super) answers: Vec<Answer>,
    /// All that was said so far.
    pub(super) air: Vec<Parcel>,
    pub(super) silent: u64,
    /// How many of its messages and tokens reached a robot.
    pub(super) uttered: u64,
    /// The count of the last word of an instructor.
    pub(super) said: u64,
    /// How often the adversary spoke as a neighbour does.
    pub(super) whispered: u32,
    /// Those of the liars that are enrolled, to the robots.
    pub(super) channels: BTreeMap<u32, Channels>,
    /// How long a message takes, by sender and receiver.
    delays: Vec<Vec<Duration>>,
    queue: BTreeMap<(Duration, u64), Due>,
    queued: u64,
    pub(super) keys: Keys,
}

impl Swarm {
    /// A swarm that has just started.
    pub fn new(plan: &Plan, seed: u64, peace: bool) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let members = plan.honest + plan.liars;
        let roster = roster(members);
        let delay = |rng: &mut ChaCha8Rng| Duration::from_micros(rng.random_range(500..5000));
        let delays = (0..plan.honest).map(|_| (0..plan.honest).map(|_| delay(&mut rng)).collect()).collect();
        let sealed = (plan.setting == Setting::Sealed).then_some(&roster);
        let liars = plan.honest + 1..=members;
        let channels = |liar| Channels::new(RobotId(liar), key(liar), roster.swarm_id());
        let channels = liars.map(|liar| (liar, channels(liar))).collect();
        let robots = (1..=plan.honest).map(|id| Robot::new(RobotId(id), plan, sealed, seed)).collect();
        let mut swarm = Self {
            plan: plan.clone(),
            robots,
            peace,
            now: Duration::ZERO,
            tokens: (1..=members).map(RobotId).collect(),
            cut: BTreeSet::new(),
            gesture: None,
            shown: Vec::new(),
            announced: Vec::new(),
            answers: Vec::new(),
            air: Vec::new(),
            silent: 0,
            uttered: 0,
            said: 0,
            whispered: 0,
            channels,
            delays,
            queue: BTreeMap::new(),
            queued: 0,
            keys: Keys::new(SWARM).expect("a name"),
            roster,
        };
        (0..swarm.robots.len()).for_each(|i| swarm.introduce(i));
        swarm.pass(Duration::from_millis(100));
        swarm
    }

    /// Who is linked to a robot: those beside it on a ring, and every liar.
    pub(super) fn neighbours(&self, i: usize) -> BTreeSet<RobotId> {
        let n = self.plan.honest;
        let me = i as u32;
        let ring = [(me + 1) % n + 1, (me + n - 1) % n + 1];
        let liars = n + 1..=n + self.plan.liars;
        ring.into_iter().chain(liars).map(RobotId).filter(|robot| robot.0 != me + 1).collect()
    }

    pub(super) fn introduce(&mut self, i: usize) {
        let neighbours = self.neighbours(i);
        for input in self.robots[i].introduction(&self.tokens, &neighbours) {
            self.tell(i, input);
        }
    }

    /// Lets time pass.
    pub fn pass(&mut self, time: Duration) {
        let end = self.now + time;
        loop {
            let event = self.queue.first_key_value().map(|((at, _), _)| *at);
            let woken = self.robots.iter().enumerate().filter_map(|(i, robot)| Some((robot.wake?, i))).min();
            let wakes_first = woken.is_some_and(|(wake, _)| event.is_none_or(|event| wake < event));
            if let (true, Some((wake, i))) = (wakes_first, woken) {
                if wake > end {
                    break;
                }
                self.now = self.now.max(wake);
                self.tell(i, Input::Tick);
            } else {
                if event.is_none_or(|event| event > end) {
                    break;
                }
                let Some(((at, _), due)) = self.queue.pop_first() else { break };
                self.now = self.now.max(at);
                match due {
                    Due::Arrive(i, parcel) => self.arrive(i, &parcel),
                    Due::Frame(i, looks) => self.frame(i, looks),
                }
            }
        }
        self.now = end;
    }

    pub(super) fn at(&mut self, at: Duration, due: Due) {
        self.queued += 1;
        self.queue.insert((at, self.queued), due);
    }

    pub(super) fn arrive(&mut self, i: usize, parcel: &Parcel) {
        let now = self.now;
        let heard = self.robots[i].port.take(now, parcel);
        let fallen = self.robots[i].port.fallen();
        heard.into_iter().chain(fallen).for_each(|input| self.heed(i, input));
        let robot = &mut self.robots[i];
        robot.port.note_contradictions(robot.mind.take_contradictions());
        let fallen = robot.port.fallen();
        fallen.into_iter().for_each(|input| self.heed(i, input));
        for evidence in self.robots[i].port.untold(now) {
            self.broadcast(i, &Topic::Evidence, evidence);
        }
    }

    /// Tells a mind what arrived; by a new roster it believes others.
    fn heed(&mut self, i: usize, input: Input) {
        let is_new_roster = matches!(input, Input::Expelled(_));
        self.tell(i, input);
        let believer = self.robots[i].port.believer().filter(|_| is_new_roster);
        if let Some(believer) = believer {
            self.tell(i, Input::Believe(believer));
        }
    }

    /// Gives a mind an input and carries out what it wants done.
    pub(super) fn tell(&mut self, i: usize, input: Input) {
        let mut inputs = VecDeque::from([input]);
        while let Some(input) = inputs.pop_front() {
            for output in self.robots[i].mind.handle(self.now, input) {
                self.robots[i].note(self.now, &output);
                if let Output::Remember { revision, changes } = output {
                    self.robots[i].write(changes);
                    inputs.push_back(Input::Remembered(revision));
                } else {
                    self.carry_out(i, output);
                }
            }
        }
        self.robots[i].wake = self.robots[i].mind.next_wake();
    }

    fn carry_out(&mut self, i: usize, output: Output) {
        let me = self.robots[i].id;
        match output {
            Output::Broadcast(envelope) => {
                let bytes = envelope.encode();
                if is_vote(&envelope) {
                    self.robots[i].port.said(bytes.clone());
                }
                let topic = match envelope.message {
                    Message::Samples(_) => Topic::Sample(me),
                    Message::Holding(_) => Topic::RobotDecision(me),
                    _ => Topic::Vote(me),
                };
                self.broadcast(i, &topic, bytes);
            }
            Output::Tell(to, envelope) => self.send(i, to, &envelope),
            Output::Announce(announcement) => {
                self.broadcast(i, &Topic::Decision, json(&announcement));
                self.announced.push((self.now, me, announcement.decision));
            }
            Output::Ask(question) => self.broadcast(i, &Topic::Question, json(&question)),
            Output::Answer(by, answer) => {
                let bytes = json(&answer);
                let sign =
                    || answer::sign(&key(me.0), &self.roster.swarm_id(), me, &by, &bytes).as_bytes().to_vec();
                let attachment = (self.plan.setting == Setting::Sealed).then(sign);
                let key = self.keys.key(&Topic::Answer(by));
                self.publish(i, Parcel { key, bytes, attachment, at: self.time() });
                self.answers.push(answer);
            }
            Output::Opened(_) => {
                let robot = &mut self.robots[i];
                (robot.looking, robot.looks) = (true, robot.looks + 1);
                let first = self.now + Duration::from_millis(60 + 15 * u64::from(me.0));
                let looks = self.robots[i].looks;
                self.at(first, Due::Frame(i, looks));
            }
            Output::Closed(_) => self.robots[i].looking = false,
            Output::Hold(_) | Output::Train(_) | Output::Remember { .. } => {}
        }
    }

    fn broadcast(&mut self, i: usize, topic: &Topic, bytes: Vec<u8>) {
        self.publish(i, Parcel { key: self.keys.key(topic), bytes, attachment: None, at: self.time() });
    }

    fn publish(&mut self, i: usize, parcel: Parcel) {
        (0..self.robots.len()).filter(|j| *j != i).for_each(|j| self.carry(i, j, parcel.clone()));
        self.air.push(parcel);
    }

    fn send(&mut self, i: usize, to: RobotId, envelope: &Envelope) {
        let (key, bytes) = (self.keys.key(&Topic::Repair(to)), envelope.encode());
        let attachment = self.robots[i].port.tag(to, &bytes);
        let parcel = Parcel { key, bytes, attachment, at: self.time() };
        if let Some(j) = self.robots.iter().position(|robot| robot.id == to) {
            self.carry(i, j, parcel.clone());
        }
        self.air.push(parcel);
    }

    fn carry(&mut self, from: usize, to: usize, parcel: Parcel) {
        let apart = |i: usize| self.cut.contains(&self.robots[i].id);
        if apart(from) == apart(to) {
            let arrives = self.now + self.delays[from][to];
            self.at(arrives, Due::Arrive(to, parcel));
        }
    }

    /// The swarm's own time.
    pub(super) fn time(&self) -> u64 {
        self.now.as_nanos() as u64
    }

    /// The time that has passed.
    pub fn now(&self) -> Duration {
        self.now
    }

    /// The mind of that robot.
    pub fn mind(&self, robot: u32) -> &Mind {
        &self.robots[robot as usize - 1].mind
    }

    /// The minds of all honest robots.
    pub fn minds(&self) -> impl Iterator<Item = &Mind> {
        self.robots.iter().map(|robot| &robot.mind)
    }

    /// What each robot said and knows.
    pub fn accounts(&self) -> Vec<Account> {
        self.robots.iter().map(Robot::account).collect()
    }

    /// What was refused, by counter.
    pub fn refused(&self) -> BTreeMap<String, u64> {
        let mut all = BTreeMap::new();
        for (counter, times) in self.robots.iter().flat_map(Robot::refused) {
            *all.entry(counter).or_default() += times;
        }
        all
    }
}

pub(super) fn json(value: &impl serde::Serialize) -> Vec<u8> {
    serde_json::to_vec(value).expect("what robots say is JSON")
}
