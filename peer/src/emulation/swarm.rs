//! Many minds in one thread: a queue of events, the robots, and what they want done.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::rc::Rc;
use std::time::Duration;

use gestalt_protocol::{ClassId, Decision, Envelope, RobotId};
use gestalt_strategies::{Input, Mind, MindConfig, Output};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::network::{Change, Kind, Network, Presence};
use super::observer::Observer;
use super::record::Record;
use super::route::link;
use super::scenario::{Event, Scenario};
use super::trace::{Happening, Trace};

/// What waits for a frozen robot, at most; what comes after is lost, as in a full buffer.
const WAITING: usize = 10_000;

/// Streams of the seed: one for the network, one for the course of events, and one for what each robot sees.
const NETWORK: u64 = u64::MAX;
const COURSE: u64 = u64::MAX - 1;

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
}

/// What travels.
#[derive(Clone)]
enum Parcel {
    Said(Rc<Envelope>),
    Held(RobotId, Rc<Decision>),
    Announced(Rc<Decision>),
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
    knows: (BTreeSet<usize>, Vec<usize>),
}

/// A run of a scenario.
pub(super) struct Swarm<'a> {
    scenario: &'a Scenario,
    seed: u64,
    now: Duration,
    queue: BTreeMap<(Duration, u64), Due>,
    queued: u64,
    network: Network,
    robots: Vec<Robot>,
    course: ChaCha8Rng,
    shown: ClassId,
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
                knows: Default::default(),
            })
            .collect();
        let record = Record::new(robots.len());
        let mut swarm = Self {
            scenario,
            seed,
            now: Duration::ZERO,
            queue: BTreeMap::new(),
            queued: 0,
            network,
            robots,
            course: stream(seed, COURSE),
            shown: ClassId(0),
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

    /// Runs to the end of the scenario: an interval after the last showing.
    pub fn run(mut self) -> (Record, Network, std::io::Result<()>) {
        let end = self.scenario.showing_at(self.scenario.rounds);
        while let Some(((at, _), due)) = self.queue.pop_first() {
            if at > end {
                break;
            }
            self.now = at;
            self.happen(due);
        }
        self.now = end;
        self.end_showing();
        (self.record, self.network, self.trace.finish())
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
        self.shown = ClassId(self.course.random_range(0..self.scenario.classes as u64) as u8);
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
        robot.mind = Mind::new(robot.id, robot.boot, config).ok();
        if let Some(classifier) = robot.observer.classifier() {
            self.tell_mind(i, Input::Learned(classifier));
        }
    }

    fn thaw(&mut self, i: usize) {
        for parcel in std::mem::take(&mut self.robots[i].waiting) {
            self.arrive(i, parcel);
        }
        self.tell_mind(i, Input::Tick);
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
        let robot = &mut self.robots[i];
        if !robot.looking || robot.looks != looks {
            return;
        }
        let next = self.now + Duration::from_secs_f64(robot.observer.period());
        if self.network.presence(i) == Presence::Up
            && let Some(observation) = robot.observer.frame(&mut robot.rng)
        {
            if let Some(p) =
                robot.observer.classifier().and_then(|c| c.probabilities(&observation.features).ok())
            {
                self.record.frame(&p, self.shown);
            }
            self.tell_mind(i, Input::Observed(observation));
        }
        self.at(next, Due::Frame(i, looks));
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
                let reaches = self.broadcast(i, bytes, Kind::Vote, &Parcel::Said(envelope));
                self.note(&Happening::Broadcast { robot, bytes, reaches });
            }
            Output::Tell(to, envelope) => {
                let (envelope, bytes) = over_the_wire(&envelope);
                let target = to.0 as usize - 1;
                let taken = self.network.tell(i, target, bytes);
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
            // Emulated robots do not learn yet.
            Output::Answer(..) | Output::Train(_) | Output::Remember { .. } => {}
        }
    }

    fn broadcast(&mut self, i: usize, bytes: usize, kind: Kind, parcel: &Parcel) -> usize {
        let arrivals = self.network.broadcast(i, bytes, kind);
        let reaches = arrivals.len();
        for (to, taken) in arrivals {
            self.at(self.now + taken, Due::Arrive(to, parcel.clone()));
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

/// The same for a decision, which travels as JSON.
fn as_json(decision: &Decision) -> (Rc<Decision>, usize) {
    let json = serde_json::to_vec(decision).expect("a decision holds nothing that JSON cannot");
    let read = gestalt_protocol::decode_json(&json).expect("what was written can be read");
    (Rc::new(read), json.len())
}
