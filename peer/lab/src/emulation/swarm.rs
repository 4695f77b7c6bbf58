//! Many minds in one thread: a queue of events, the robots, and what they want done.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{
    Answer, ClassId, Decision, Envelope, Gesture, Instruction, InstructorId, Message, RobotId,
};
use gestalt_strategies::{Classifier, Classify, Input, Instructed, Mind, MindConfig, Output};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::learning::{Feedback, Pupil, School};
use super::network::{Change, Kind, Network, Presence, Traffic};
use super::observer::Observer;
use super::record::Record;
use super::report::Learned;
use super::route::link;
use super::scenario::{Event, Order, Scenario};
use super::statistics::Mean;
use super::trace::{Happening, Trace};

/// What waits for a frozen robot, at most; what comes after is lost, as in a full buffer.
const WAITING: usize = 10_000;

/// Streams of the seed: one for the network, one for the course of events, and one for what each robot sees.
const NETWORK: u64 = u64::MAX;
const COURSE: u64 = u64::MAX - 1;
/// The first of those by which robots share and forget, one for each life of each robot.
const LEARNING: u64 = 1 << 63;

/// Who teaches.
const INSTRUCTOR: &str = "script";

/// What is to happen at some time.
enum Due {
    Show(u32),
    Fault(Event),
    Churn,
    Notice(Change),
    Wake(usize),
    /// The next frame of that robot, as long as it looks for the `n`th time.
    Frame(usize, u32),
    Arrive(usize, Parcel),
    /// One parcel on its way to many: when it arrives at whom, the next first.
    Spread(VecDeque<(Duration, usize)>, Parcel),
    /// The instructor speaks of that showing, through that robot if it is up.
    Teach(u32, usize),
    /// What that robot was to remember in that life, up to that revision, is on its disk.
    Remembered(usize, u32, u64),
}

/// What travels.
#[derive(Clone)]
enum Parcel {
    Said(Rc<Envelope>),
    Held(RobotId, Rc<Decision>),
    Announced(Rc<Decision>),
    Instructed(Rc<Instructed>),
    Answered(InstructorId, u64, RobotId),
}

struct Robot {
    id: RobotId,
    boot: u32,
    /// None while it is dead.
    mind: Option<Mind>,
    observer: Box<dyn Observer>,
    rng: ChaCha8Rng,
    wake: Option<Duration>,
    /// Whether it looks, and for the how-manyth time.
    looking: bool,
    looks: u32,
    waiting: VecDeque<Parcel>,
    /// None of a robot that does not learn.
    pupil: Option<Pupil>,
    knows: (BTreeSet<usize>, Vec<usize>),
}

/// A run of a scenario.
pub(super) struct Swarm<'a> {
    scenario: &'a Scenario,
    school: Option<Arc<School>>,
    seed: u64,
    now: Duration,
    queue: BTreeMap<(Duration, u64), Due>,
    queued: u64,
    network: Network,
    robots: Vec<Robot>,
    course: ChaCha8Rng,
    shown: ClassId,
    /// The gestures still to be shown before all have been.
    turn: Vec<ClassId>,
    record: Record,
    trace: Trace<'a>,
}

/// The generator of one stream of a seed.
fn stream(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream);
    rng
}

impl<'a> Swarm<'a> {
    pub fn new(
        scenario: &'a Scenario,
        seed: u64,
        observers: Vec<Box<dyn Observer>>,
        school: Option<Arc<School>>,
        trace: Trace<'a>,
    ) -> Self {
        let mut rng = stream(seed, NETWORK);
        let links = scenario.topology.links(observers.len(), &mut rng);
        let network = Network::new(observers.len(), links, scenario.link, rng);
        let robots: Vec<_> = (1..)
            .map(RobotId)
            .zip(observers)
            .map(|(id, observer)| Robot {
                id,
                boot: 0,
                mind: None,
                observer,
                rng: stream(seed, 0),
                wake: None,
                looking: false,
                looks: 0,
                waiting: VecDeque::new(),
                pupil: school.as_ref().map(|_| Pupil::default()),
                knows: Default::default(),
            })
            .collect();
        let record = Record::new(robots.len());
        let mut swarm = Self {
            scenario,
            school,
            seed,
            now: Duration::ZERO,
            queue: BTreeMap::new(),
            queued: 0,
            network,
            robots,
            course: stream(seed, COURSE),
            shown: ClassId(0),
            turn: Vec::new(),
            record,
            trace,
        };
        (0..swarm.robots.len()).for_each(|robot| swarm.start(robot));
        swarm.tell_who_is_there();
        (0..scenario.rounds).for_each(|n| swarm.at(scenario.showing_at(n), Due::Show(n)));
        scenario.faults.iter().for_each(|fault| swarm.at(fault.at, Due::Fault(fault.event)));
        if let Some(churn) = scenario.churn {
            swarm.at(churn.from, Due::Churn);
        }
        swarm
    }

    /// Lets everything happen that is due before that time.
    pub fn pass(&mut self, until: Duration) {
        while let Some(next) = self.queue.first_entry().filter(|next| next.key().0 < until) {
            let ((at, _), due) = next.remove_entry();
            self.now = at;
            self.happen(due);
        }
    }

    /// Runs to the end of the scenario: an interval after the last showing.
    pub fn run(mut self) -> (Record, Network, Option<Learned>, std::io::Result<()>) {
        let end = self.scenario.showing_at(self.scenario.rounds);
        self.pass(end + Duration::from_nanos(1));
        self.now = end;
        self.end_showing();
        let learned = self.school.is_some().then(|| self.summed_up());
        (self.record, self.network, learned, self.trace.finish())
    }

    pub fn mind(&self, i: usize) -> Option<&Mind> {
        self.robots[i].mind.as_ref()
    }

    pub fn traffic(&self, i: usize) -> Traffic {
        self.network.traffic[i]
    }

    /// What that robot judges by after learning from all it holds.
    pub fn learned(&mut self, i: usize) -> Option<Arc<Classifier>> {
        self.train(i);
        self.robots[i].pupil.as_ref()?.classifier().cloned()
    }

    fn summed_up(&self) -> Learned {
        let statuses = || self.network.up().filter_map(|i| self.robots[i].mind.as_ref()?.learned());
        let numbers = |parts: &[&[usize]]| parts.iter().flat_map(|part| part.iter()).sum::<usize>() as f64;
        let held: Vec<f64> = statuses().map(|s| numbers(&[&s.personal, &s.shared, &s.external])).collect();
        let common: Vec<f64> = statuses().map(|s| numbers(&[&s.shared, &s.external])).collect();
        let alike = statuses().map(|status| status.common).collect::<BTreeSet<_>>().len() <= 1;
        Learned { samples: Mean::of(&held), common: Mean::of(&common), alike }
    }

    fn happen(&mut self, due: Due) {
        match due {
            Due::Show(n) => self.show(n),
            Due::Fault(event) => self.fault(event),
            Due::Churn => self.churn(),
            Due::Notice(change) => {
                self.network.notice(change);
                self.tell_who_is_there();
            }
            Due::Wake(robot) => {
                if self.robots[robot].wake == Some(self.now) {
                    self.robots[robot].wake = None;
                    self.tell_mind(robot, Input::Tick);
                }
            }
            Due::Frame(robot, looks) => self.frame(robot, looks),
            Due::Arrive(robot, parcel) => self.arrive(robot, parcel),
            Due::Spread(arrivals, parcel) => self.spread(arrivals, parcel),
            Due::Teach(n, robot) => self.teach(n, robot),
            Due::Remembered(robot, boot, revision) => {
                if self.robots[robot].boot == boot {
                    self.tell_mind(robot, Input::Remembered(revision));
                }
            }
        }
    }

    fn at(&mut self, at: Duration, due: Due) {
        self.queue.insert((at, self.queued), due);
        self.queued += 1;
    }

    fn note(&mut self, happening: &Happening<'_>) {
        self.trace.write(self.now, happening);
    }

    /// Another gesture is shown to all; one of the robots that can notices it first.
    fn show(&mut self, n: u32) {
        self.end_showing();
        self.shown = self.draw_gesture();
        let luck = self.course.random::<u64>();
        for (i, robot) in self.robots.iter_mut().enumerate() {
            // A stream of its own for each showing and robot: all fusion rules are shown the same frames.
            robot.rng = stream(self.seed, (u64::from(n) << 32) | i as u64);
            robot.observer.show(self.shown, &mut robot.rng);
        }
        let up: Vec<usize> = self.network.up().collect();
        if up.is_empty() {
            return;
        }
        let opener = up[(luck % up.len() as u64) as usize];
        let happening = Happening::Shown { class: self.shown, opener: self.robots[opener].id };
        self.note(&happening);
        let before = self.robots[opener].mind.as_ref().and_then(Mind::round);
        self.tell_mind(opener, Input::Open);
        let after = self.robots[opener].mind.as_ref().and_then(Mind::round);
        // A robot that is still busy with the round before does not open another.
        let opened = after.filter(|round| Some(*round) != before);
        self.record.show(self.now, self.shown, opened.map(|round| round.counter));
        if let Some(teaching) = self.scenario.learning.as_ref().filter(|_| opened.is_some()) {
            self.at(self.now + teaching.after, Due::Teach(n, opener));
        }
    }

    fn draw_gesture(&mut self) -> ClassId {
        let classes = self.scenario.classes;
        match self.scenario.order {
            Order::Random => ClassId(self.course.random_range(0..classes as u64) as u8),
            Order::InTurn => {
                if self.turn.is_empty() {
                    self.turn = (0..classes).map(|class| ClassId(class as u8)).collect();
                    self.turn.shuffle(&mut self.course);
                }
                self.turn.pop().unwrap_or(ClassId(0))
            }
        }
    }

    /// The instructor, who stands at that robot, says what it was that was shown.
    fn teach(&mut self, n: u32, i: usize) {
        let Some(teaching) = &self.scenario.learning else { return };
        let mind = self.robots[i].mind.as_ref().filter(|_| self.network.presence(i) == Presence::Up);
        let Some((mind, round)) = mind.and_then(|mind| Some((mind, mind.round()?))) else { return };
        let instruction = match (teaching.feedback, mind.held().and_then(|held| held.class)) {
            (Feedback::Full, _) => Instruction::Was { round, class: Gesture::Class(self.shown) },
            (Feedback::Partial, Some(decided)) if decided == self.shown => Instruction::Right { round },
            (Feedback::Partial, Some(_)) => Instruction::Wrong { round },
            (Feedback::Partial, None) | (Feedback::None, _) => return,
        };
        let robot = self.robots[i].id;
        self.note(&Happening::Instruct { robot, instruction: &instruction });
        let by: InstructorId = INSTRUCTOR.parse().expect("it is a name");
        let bytes = json_bytes(&instruction);
        let instructed = Rc::new(Instructed { by, at: u64::from(n), instruction });
        self.broadcast(i, bytes, Kind::Words, &Parcel::Instructed(instructed.clone()));
        self.arrive(i, Parcel::Instructed(instructed));
    }

    /// Makes a robot's classifier follow its samples.
    fn train(&mut self, i: usize) {
        let up = self.network.presence(i) == Presence::Up;
        let Some(pupil) = self.robots[i].pupil.as_mut().filter(|_| up) else { return };
        if let Some(classifier) = pupil.learn() {
            let samples =
                self.robots[i].mind.as_ref().and_then(Mind::training_set).map_or(0, |set| set.len());
            self.note(&Happening::Learn { robot: self.robots[i].id, samples });
            self.tell_mind(i, Input::Learned(classifier));
        }
    }

    fn end_showing(&mut self) {
        let up: Vec<usize> = self.network.up().collect();
        self.record.end_showing(self.now, &up);
    }

    fn fault(&mut self, event: Event) {
        self.note(&Happening::Fault { event: &event });
        let index = |robot: RobotId| robot.0 as usize - 1;
        match event {
            Event::Cut(a, b) => self.change_link(link(index(a), index(b)), false),
            Event::Heal(a, b) => self.change_link(link(index(a), index(b)), true),
            Event::Kill(robot) => {
                let i = index(robot);
                self.robots[i].mind = None;
                self.robots[i].waiting.clear();
                self.robots[i].pupil.iter_mut().for_each(Pupil::stop);
                self.record.forget(i);
                self.change_presence(i, Presence::Down);
            }
            Event::Restart(robot) if self.network.presence(index(robot)) == Presence::Down => {
                self.change_presence(index(robot), Presence::Up);
                self.start(index(robot));
            }
            Event::Freeze(robot) if self.network.presence(index(robot)) == Presence::Up => {
                self.change_presence(index(robot), Presence::Frozen);
            }
            Event::Thaw(robot) if self.network.presence(index(robot)) == Presence::Frozen => {
                self.change_presence(index(robot), Presence::Up);
                self.thaw(index(robot));
            }
            Event::Restart(_) | Event::Freeze(_) | Event::Thaw(_) => {}
        }
    }

    fn change_link(&mut self, link: super::route::Link, up: bool) {
        if self.network.set_link(link, up) {
            self.at(self.now + self.scenario.link.detection, Due::Notice(Change::Link(link, up)));
        }
    }

    fn change_presence(&mut self, robot: usize, presence: Presence) {
        self.network.set_presence(robot, presence);
        let change = Change::Robot(robot, presence == Presence::Up);
        self.at(self.now + self.scenario.link.detection, Due::Notice(change));
    }

    fn churn(&mut self) {
        let Some(churn) = self.scenario.churn else { return };
        let changed: Vec<_> = if self.now >= churn.until {
            self.network.cut_links().into_iter().map(|link| (link, true)).collect()
        } else {
            self.at(self.now + churn.period, Due::Churn);
            self.network.flip_any_link().into_iter().collect()
        };
        for ((a, b), up) in changed {
            let (robot_a, robot_b) = (self.robots[a].id, self.robots[b].id);
            let event = if up { Event::Heal(robot_a, robot_b) } else { Event::Cut(robot_a, robot_b) };
            self.note(&Happening::Fault { event: &event });
            self.network.set_link((a, b), up);
            self.at(self.now + self.scenario.link.detection, Due::Notice(Change::Link((a, b), up)));
        }
    }

    fn start(&mut self, i: usize) {
        let robot = &mut self.robots[i];
        robot.boot += 1;
        robot.looking = false;
        robot.knows = Default::default();
        let config: MindConfig = self.scenario.mind.clone();
        let classifier: Option<Arc<dyn Classify>> =
            match (&mut robot.pupil, &self.school, &self.scenario.learning) {
                (Some(pupil), Some(school), Some(teaching)) => {
                    let life = LEARNING | u64::from(robot.boot) << 32 | i as u64;
                    let rng = stream(self.seed, life);
                    let me = (robot.id, robot.boot);
                    robot.mind = Some(pupil.start(me, config, school, &teaching.robots, rng));
                    pupil.classifier().map(|classifier| classifier.clone() as Arc<dyn Classify>)
                }
                _ => {
                    robot.mind = Mind::new(robot.id, robot.boot, config).ok();
                    robot.observer.classifier()
                }
            };
        match classifier {
            Some(classifier) => self.tell_mind(i, Input::Learned(classifier)),
            // What it remembers is to be trained.
            None if self.school.is_some() => self.tell_mind(i, Input::Tick),
            None => {}
        }
    }

    fn thaw(&mut self, i: usize) {
        for parcel in std::mem::take(&mut self.robots[i].waiting) {
            self.arrive(i, parcel);
        }
        let remembered = self.robots[i].pupil.as_ref().map(|pupil| pupil.remembered);
        self.tell_mind(i, remembered.map_or(Input::Tick, Input::Remembered));
        self.tell_who_is_there();
    }

    /// Tells every robot who is alive and who its neighbours are, where that has changed.
    fn tell_who_is_there(&mut self) {
        for i in 0..self.robots.len() {
            if self.network.presence(i) != Presence::Up {
                continue;
            }
            let now = (self.network.reachable(i), self.network.neighbours(i));
            let before = std::mem::replace(&mut self.robots[i].knows, now.clone());
            let ids =
                |robots: &mut dyn Iterator<Item = usize>| robots.map(|i| RobotId(i as u32 + 1)).collect();
            if before.0 != now.0 {
                self.tell_mind(i, Input::Alive(ids(&mut now.0.into_iter())));
            }
            if before.1 != now.1 {
                self.tell_mind(i, Input::Neighbours(ids(&mut now.1.into_iter())));
            }
        }
    }

    fn frame(&mut self, i: usize, looks: u32) {
        let looks_still = |robot: &Robot| robot.looking && robot.looks == looks;
        if !looks_still(&self.robots[i]) {
            return;
        }
        // A robot that learns does so before it looks again, not sooner: nobody asks before.
        self.train(i);
        let robot = &mut self.robots[i];
        let next = self.now + Duration::from_secs_f64(robot.observer.period());
        if self.network.presence(i) == Presence::Up
            && let Some(observation) = robot.observer.frame(&mut robot.rng)
        {
            let classifier: Option<Arc<dyn Classify>> = match &robot.pupil {
                Some(pupil) => pupil.classifier().map(|classifier| classifier.clone() as Arc<dyn Classify>),
                None => robot.observer.classifier(),
            };
            if let Some(p) = classifier.and_then(|c| c.probabilities(&observation.features).ok()) {
                self.record.frame(&p, self.shown);
            }
            self.tell_mind(i, Input::Observed(observation));
        }
        self.at(next, Due::Frame(i, looks));
    }

    /// Lets a parcel arrive where it is due, and waits for the rest: of a broadcast to a thousand robots one event is
    /// queued, not a thousand.
    fn spread(&mut self, mut arrivals: VecDeque<(Duration, usize)>, parcel: Parcel) {
        while let Some((at, to)) = arrivals.pop_front() {
            if at > self.now {
                arrivals.push_front((at, to));
                return self.at(at, Due::Spread(arrivals, parcel));
            }
            self.arrive(to, parcel.clone());
        }
    }

    fn arrive(&mut self, i: usize, parcel: Parcel) {
        match self.network.presence(i) {
            Presence::Down => {}
            Presence::Frozen => {
                let waiting = &mut self.robots[i].waiting;
                if waiting.len() < WAITING {
                    waiting.push_back(parcel);
                }
            }
            Presence::Up => {
                let input = match parcel {
                    Parcel::Said(envelope) => Input::Received((*envelope).clone()),
                    Parcel::Held(robot, decision) => Input::Heard(robot, (*decision).clone()),
                    Parcel::Announced(decision) => Input::Announced((*decision).clone()),
                    Parcel::Instructed(instructed) => Input::Instructed((*instructed).clone()),
                    Parcel::Answered(by, at, robot) => Input::Answered(by, at, robot),
                };
                self.tell_mind(i, input);
            }
        }
    }

    /// Gives a mind an input and carries out what it wants done.
    fn tell_mind(&mut self, i: usize, input: Input) {
        if self.network.presence(i) != Presence::Up {
            return;
        }
        let Some(mind) = &mut self.robots[i].mind else { return };
        let outputs = mind.handle(self.now, input);
        let wake = mind.next_wake();
        if self.robots[i].wake != wake {
            self.robots[i].wake = wake;
            if let Some(wake) = wake {
                self.at(wake.max(self.now), Due::Wake(i));
            }
        }
        for output in outputs {
            self.carry_out(i, output);
        }
    }

    fn carry_out(&mut self, i: usize, output: Output) {
        let robot = self.robots[i].id;
        match output {
            Output::Broadcast(envelope) => {
                let (envelope, bytes) = over_the_wire(&envelope);
                let samples = matches!(envelope.message, Message::Samples(_));
                let kind = if samples { Kind::Samples } else { Kind::Vote };
                let reaches = self.broadcast(i, bytes, kind, &Parcel::Said(envelope));
                self.note(&Happening::Broadcast { robot, bytes, reaches });
            }
            Output::Tell(to, envelope) => {
                let (envelope, bytes) = over_the_wire(&envelope);
                let target = to.0 as usize - 1;
                let samples = matches!(envelope.message, Message::Samples(_));
                let taken = self.network.tell(i, target, bytes, samples);
                self.note(&Happening::Tell { robot, to, bytes, arrives: taken.is_some() });
                if let Some(taken) = taken {
                    self.at(self.now + taken, Due::Arrive(target, Parcel::Said(envelope)));
                }
            }
            Output::Hold(decision) => {
                self.note(&Happening::Hold { robot, decision: (&decision).into() });
                self.record.hold(self.now, i, &decision);
                let (decision, bytes) = as_json(&decision);
                self.broadcast(i, bytes, Kind::Decision, &Parcel::Held(robot, decision));
            }
            Output::Announce(decision) => {
                self.note(&Happening::Announce { robot, decision: (&decision).into() });
                self.record.announce(&decision);
                let (decision, bytes) = as_json(&decision);
                self.broadcast(i, bytes, Kind::Decision, &Parcel::Announced(decision));
            }
            Output::Opened(round) => {
                self.note(&Happening::Opened { robot, round });
                self.record.open(self.now, i);
                let robot = &mut self.robots[i];
                robot.looking = true;
                robot.looks += 1;
                let phase: f64 = robot.rng.random();
                let (first, looks) = (robot.observer.period() * phase, robot.looks);
                self.at(self.now + Duration::from_secs_f64(first), Due::Frame(i, looks));
            }
            Output::Closed(round) => {
                self.note(&Happening::Closed { robot, round });
                self.record.close(self.now, i);
                self.robots[i].looking = false;
            }
            Output::Answer(by, answer) => {
                let Answer { at, outcome, samples, .. } = answer;
                self.note(&Happening::Answer { robot, outcome, samples });
                let bytes = json_bytes(&answer);
                self.broadcast(i, bytes, Kind::Words, &Parcel::Answered(by, at, robot));
            }
            Output::Train(changes) => {
                if let Some(pupil) = &mut self.robots[i].pupil {
                    pupil.train_later(changes);
                }
            }
            Output::Remember { revision, changes } => {
                let boot = self.robots[i].boot;
                if let Some(pupil) = &mut self.robots[i].pupil {
                    pupil.remember(revision, changes);
                    self.at(self.now, Due::Remembered(i, boot, revision));
                }
            }
        }
    }

    fn broadcast(&mut self, i: usize, bytes: usize, kind: Kind, parcel: &Parcel) -> usize {
        let arrivals = self.network.broadcast(i, bytes, kind);
        let reaches = arrivals.len();
        let mut arrivals: Vec<_> = arrivals.into_iter().map(|(to, taken)| (self.now + taken, to)).collect();
        arrivals.sort_unstable();
        if let Some((first, _)) = arrivals.first() {
            self.at(*first, Due::Spread(arrivals.into(), parcel.clone()));
        }
        reaches
    }
}

/// What a message becomes by being written and read, and how many bytes that takes.
fn over_the_wire(envelope: &Envelope) -> (Rc<Envelope>, usize) {
    let bytes = envelope.encode();
    let read = Envelope::decode(&bytes).expect("what a mind says can be read");
    (Rc::new(read), bytes.len())
}

fn json_bytes(value: &impl serde::Serialize) -> usize {
    serde_json::to_vec(value).expect("what people say holds nothing that JSON cannot").len()
}

/// The same for a decision, which travels as JSON.
fn as_json(decision: &Decision) -> (Rc<Decision>, usize) {
    let json = serde_json::to_vec(decision).expect("a decision holds nothing that JSON cannot");
    let read = gestalt_protocol::decode_json(&json).expect("what was written can be read");
    (Rc::new(read), json.len())
}
