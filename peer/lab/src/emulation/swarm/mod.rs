//! Many minds: a queue of events, the robots, and what they want done.
//!
//! | file | question |
//! |---|---|
//! | `queue` | what is to happen next? |
//! | `course` | what is shown, seen and taught? |
//! | `answering` | what is asked, and what is answered? |
//! | `faults` | what goes wrong? |
//! | `lives` | who starts, goes on, and knows of whom? |
//! | `turn` | what is due for one robot, and what did it do of it? |
//! | `acting` | what does a robot do by itself? |
//! | `ahead` | what may it do before it is its turn? |
//! | `carry` | what does it want done, and what becomes of it? |
//! | `deceive` | what do liars say? |
//! | `poisoning` | what do poisoners share? |
//! | `reading` | what may a mind be told later than it comes? |
//! | `training` | who learns? |

mod acting;
mod ahead;
mod answering;
mod carry;
mod course;
mod deceive;
mod faults;
mod lives;
mod parcel;
mod plot;
mod poisoning;
mod queue;
mod reading;
mod robot;
mod seed;
mod training;
mod turn;

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{ClassId, RobotId};
use gestalt_strategies::{Classifier, Mind, Shelf};
use rand_chacha::ChaCha8Rng;

use super::network::{Network, Traffic};
use super::observer::Observer;
use super::pupil::Pupil;
use super::record::Record;
use super::report::Learned;
use super::rules::Rules;
use super::scenario::{Event, Fault, Scenario};
use super::school::School;
use super::statistics::Mean;
use super::trace::{Happening, Trace};
use crate::threads::Crew;
use answering::Asking;
use plot::Plot;
use poisoning::Poisoner;
use queue::{Due, Queue};
use robot::Robot;
use seed::{ANSWERS, COURSE, NETWORK, stream};
use turn::Turn;

/// A run of a scenario.
pub(super) struct Swarm<'a> {
    scenario: &'a Scenario,
    school: Option<Arc<School>>,
    /// What robots hold alike.
    shelf: Arc<Shelf>,
    rules: Rules,
    seed: u64,
    now: Duration,
    queue: Queue,
    network: Network,
    robots: Vec<Robot>,
    course: ChaCha8Rng,
    shown: ClassId,
    /// The gestures still to be shown before all have been.
    turn: Vec<ClassId>,
    asking: Asking,
    plot: Plot,
    record: Record,
    trace: Trace<'a>,
    /// How much has arrived that minds are told later, and at how much all are told.
    unread: usize,
    pub most_unread: usize,
    /// Until when was looked for what robots may do ahead, and how much there has to be.
    looked_ahead: Duration,
    pub worthwhile: usize,
    /// How many turns robots had taken ahead.
    pub taken_ahead: u64,
    /// By whom robots learn, go ahead, and are told what could wait.
    pub crew: Crew,
}

impl<'a> Swarm<'a> {
    pub fn new(
        scenario: &'a Scenario,
        seed: u64,
        observers: Vec<Box<dyn Observer>>,
        (school, rules): (Option<Arc<School>>, Rules),
        trace: Trace<'a>,
    ) -> Self {
        let mut rng = stream(seed, NETWORK);
        let links = scenario.topology.links(observers.len(), &mut rng);
        let network = Network::new(observers.len(), links, scenario.link, rng);
        let starts_again = |fault: &Fault| matches!(fault.event, Event::Restart(_));
        let learns = school.as_ref().map(|_| scenario.faults.iter().any(starts_again));
        let robots: Vec<_> = (1..)
            .zip(observers.into_iter().zip(scenario.members()))
            .map(|(id, (observer, group))| {
                let poison = group.poison.map(|strategy| Poisoner::new(strategy, seed, id));
                Robot::new(RobotId(id), observer, seed, learns, (group.lies, poison))
            })
            .collect();
        let size = u32::try_from(robots.len()).unwrap_or(u32::MAX);
        let record = Record::new(robots.iter().map(|robot| robot.lies.is_none()).collect());
        let begun = |school: Arc<School>| Arc::new(school.begun());
        let mut swarm = Self {
            scenario,
            school: school.map(begun),
            shelf: Arc::default(),
            rules,
            seed,
            now: Duration::ZERO,
            queue: Queue::default(),
            network,
            robots,
            course: stream(seed, COURSE),
            shown: ClassId(0),
            turn: Vec::new(),
            asking: Asking::new(stream(seed, ANSWERS)),
            plot: Plot::default(),
            record,
            trace,
            unread: 0,
            most_unread: reading::MANY * scenario.swarm_size(),
            looked_ahead: Duration::ZERO,
            worthwhile: ahead::WORTHWHILE,
            taken_ahead: 0,
            crew: Crew::on_all_cores(),
        };
        if scenario.mind.committee_of(size).is_some() {
            swarm.robots.iter_mut().filter_map(|robot| robot.pupil.as_mut()).for_each(Pupil::start_over);
        }
        (0..swarm.robots.len()).for_each(|robot| swarm.start(robot));
        swarm.tell_who_is_there();
        (0..scenario.rounds).for_each(|n| swarm.at(scenario.showing_at(n), Due::Show(n)));
        scenario.faults.iter().for_each(|fault| swarm.at(fault.at, Due::Fault(fault.event)));
        if let Some(churn) = scenario.churn {
            swarm.at(churn.from, Due::Churn);
            swarm.at(churn.until, Due::Calm);
        }
        swarm
    }

    /// Lets everything happen that is due before that time.
    pub fn pass(&mut self, until: Duration) {
        loop {
            self.go_ahead(until);
            let Some((at, due)) = self.queue.next_before(until) else { break };
            self.now = at;
            self.happen(due);
        }
        self.read_all();
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

    pub fn asked(&self) -> (u32, u32) {
        (self.asking.questions, self.asking.labels)
    }

    /// What that robot judges by after learning from all it holds.
    pub fn learned(&mut self, i: usize) -> Option<Arc<Classifier>> {
        self.keep_up(&[i]);
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
            Due::Calm => self.calm(),
            Due::Notice(change) => {
                self.network.notice(change);
                self.tell_who_is_there();
            }
            Due::Wake(robot) => self.take_turn(robot, &Turn::Wakes),
            Due::Frame(robot, n) => self.take_turn(robot, &Turn::Looks(n)),
            Due::Arrive(robot, parcel) => self.arrive(robot, parcel),
            Due::Spread(arrivals, parcel) => self.spread(arrivals, parcel),
            Due::Teach(n, robot) => self.teach(n, robot),
            Due::Reply(robot, round, ask) => self.reply(robot, round, ask),
            Due::Remembered(robot, boot, revision) => self.take_turn(robot, &Turn::Has(boot, revision)),
        }
    }

    fn at(&mut self, at: Duration, due: Due) {
        self.queue.at(at, due);
    }

    fn note(&mut self, happening: &Happening<'_>) {
        self.trace.write(self.now, happening);
    }
}
