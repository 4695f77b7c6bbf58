//! Three honest robots of a sealed swarm, and the network between them, which may lose, delay, repeat and reorder.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{
    Announcement, ClassId, Decision, Envelope, InstructorId, Message, Question, RobotId, RoundId, SampleId,
    SampleSeries, Samples,
};
use gestalt_strategies::{Input, Output};

use crate::gate::Gate;
use crate::robot::{ByFirst, Robot};

/// Robots 1 to so many are honest.
pub const ROBOTS: usize = 3;

/// The most messages that are on their way, and the most that are remembered to be said again.
const MOST: usize = 256;

fn everybody() -> BTreeSet<RobotId> {
    (1..=ROBOTS as u32).map(RobotId).collect()
}

/// What travels.
#[derive(Clone, Debug)]
pub enum Said {
    /// Between robots.
    Message(Envelope),
    /// For the swarm.
    Announced(Announcement),
    /// By the swarm.
    Asked(Question),
    /// That a robot answered an instructor.
    Answered(InstructorId, u64, RobotId),
}

/// The robots and the network.
pub struct World {
    pub now: Duration,
    robots: Vec<Robot>,
    gates: Vec<Gate>,
    /// What is on its way, and to whom.
    under_way: VecDeque<(usize, Said)>,
    /// All that was said of late.
    said: VecDeque<Said>,
    /// Whether the link between two robots is cut, by the smaller of them and by the greater.
    cut: BTreeSet<(usize, usize)>,
    /// What was announced as final, and what was so last.
    finals: BTreeMap<RoundId, (ClassId, ClassId)>,
    /// Who ever held a gesture, by the counter of its round: names of rounds merge.
    holders: BTreeMap<(u32, ClassId), BTreeSet<usize>>,
    /// The robots that were not told who is there.
    misled: BTreeSet<RobotId>,
    /// Whether a robot started again with an empty disk: it cannot know what it counted for before.
    forgot_all: bool,
    /// Rounds that people spoke of.
    spoken_of: BTreeSet<RoundId>,
    /// The batch that each sample was first said in.
    batches: BTreeMap<SampleId, Samples>,
    /// Series of which a sample was said in two batches.
    contradictory: BTreeSet<SampleSeries>,
}

impl World {
    pub fn new() -> Self {
        let mut world = Self {
            now: Duration::ZERO,
            robots: (1..=ROBOTS).map(|id| Robot::new(RobotId(id as u32), true)).collect(),
            gates: (0..ROBOTS).map(|_| Gate::default()).collect(),
            under_way: VecDeque::new(),
            said: VecDeque::new(),
            cut: BTreeSet::new(),
            finals: BTreeMap::new(),
            holders: BTreeMap::new(),
            misled: BTreeSet::new(),
            forgot_all: false,
            spoken_of: BTreeSet::new(),
            batches: BTreeMap::new(),
            contradictory: BTreeSet::new(),
        };
        world.introduce();
        world
    }

    /// All links are whole, and all robots know of each other.
    pub fn introduce(&mut self) {
        self.cut.clear();
        let all = everybody();
        (0..ROBOTS).for_each(|robot| self.introduce_to(robot, &all));
    }

    fn introduce_to(&mut self, robot: usize, all: &BTreeSet<RobotId>) {
        self.input(robot, Input::Alive(Arc::new(all.clone())));
        self.input(robot, Input::Neighbours(all.clone()));
    }

    /// A robot is ended and started again with what is on its disk, or with an empty one. What is on its way to it arrives.
    ///
    /// # Panics
    /// If it cannot read its disk.
    pub fn restart(&mut self, robot: usize, keeps_disk: bool) {
        self.forgot_all |= !keeps_disk;
        self.robots[robot].restart(keeps_disk);
        self.gates[robot] = Gate::default();
        self.input(robot, Input::Learned(Arc::new(ByFirst)));
        self.introduce_to(robot, &everybody());
    }

    pub fn robots(&self) -> &[Robot] {
        &self.robots
    }

    /// Cuts a link, or mends it.
    pub fn cut(&mut self, one: usize, other: usize, cut: bool) {
        let link = (one.min(other), one.max(other));
        if cut {
            self.cut.insert(link);
        } else {
            self.cut.remove(&link);
        }
    }

    /// A robot takes in something of its own: what it sees, or who is there.
    ///
    /// # Panics
    /// If it announces as final what no majority ever held, and knows who is there.
    pub fn input(&mut self, robot: usize, input: Input) {
        let me = RobotId(robot as u32 + 1);
        if let Input::Instructed(word) = &input {
            self.spoken_of.extend(word.instruction.round());
        }
        for output in self.robots[robot].handle(self.now, input) {
            match output {
                Output::Broadcast(envelope) => self.tell_all(robot, Said::Message(envelope)),
                Output::Tell(to, envelope) => {
                    self.remember(Said::Message(envelope.clone()));
                    self.send(robot, (to.0 as usize).wrapping_sub(1), Said::Message(envelope));
                }
                Output::Hold(decision) => {
                    if let Some(class) = decision.class {
                        self.holders.entry((decision.round.counter, class)).or_default().insert(robot);
                    }
                }
                Output::Announce(announcement) => {
                    self.announced(&announcement.decision);
                    self.tell_all(robot, Said::Announced(announcement));
                }
                Output::Ask(question) => self.tell_all(robot, Said::Asked(question)),
                Output::Answer(by, answer) => self.tell_all(robot, Said::Answered(by, answer.at, me)),
                Output::Opened(_) | Output::Closed(_) | Output::Train(_) | Output::Remember { .. } => {}
            }
        }
    }

    fn announced(&mut self, decision: &Decision) {
        let Some(class) = decision.class.filter(|_| decision.is_final) else { return };
        let held_by = self.holders.get(&(decision.round.counter, class)).map_or(0, BTreeSet::len);
        let known = self.misled() || 2 * held_by > ROBOTS;
        assert!(known, "gesture {class} is final for {}, and was held by {held_by} robots", decision.round);
        self.finals.entry(decision.round).or_insert((class, class)).1 = class;
    }

    /// Whether robots were told of others that are not there, or not of all that are.
    pub fn misled(&self) -> bool {
        !self.misled.is_empty()
    }

    /// Whether that robot was.
    pub fn was_misled(&self, robot: RobotId) -> bool {
        self.misled.contains(&robot)
    }

    /// A round for which two gestures were final.
    pub fn contradiction(&self) -> Option<RoundId> {
        self.finals.iter().find(|(_, (first, last))| first != last).map(|(round, _)| *round)
    }

    /// Whether a person spoke of that round.
    pub fn was_spoken_of(&self, round: RoundId) -> bool {
        self.spoken_of.contains(&round)
    }

    /// Whether a robot lost its disk.
    pub fn forgot_all(&self) -> bool {
        self.forgot_all
    }

    /// Whether samples of that series were said in batches that overlap, of which each robot keeps the one that it heard first.
    pub fn is_contradictory(&self, series: SampleSeries) -> bool {
        self.contradictory.contains(&series)
    }

    fn note_batch(&mut self, batch: &Samples) {
        for sample in &batch.samples {
            if self.batches.entry(sample.id).or_insert_with(|| batch.clone()) != batch {
                self.contradictory.insert(sample.id.series());
            }
        }
    }

    /// Who is there is not what a robot is told.
    pub fn mislead(&mut self, robot: usize, input: Input) {
        self.misled.insert(RobotId(robot as u32 + 1));
        self.input(robot, input);
    }

    fn tell_all(&mut self, from: usize, said: Said) {
        self.remember(said.clone());
        for to in (0..ROBOTS).filter(|to| *to != from) {
            self.send(from, to, said.clone());
        }
    }

    fn send(&mut self, from: usize, to: usize, said: Said) {
        if to < ROBOTS && !self.cut.contains(&(from.min(to), from.max(to))) {
            self.under_way.push_back((to, said));
        }
        if self.under_way.len() > MOST {
            self.under_way.pop_front();
        }
    }

    fn remember(&mut self, said: Said) {
        self.said.push_back(said);
        if self.said.len() > MOST {
            self.said.pop_front();
        }
    }

    /// Something that was said, if anything was.
    pub fn recall(&self, which: usize) -> Option<Said> {
        self.said.get(which % self.said.len().max(1)).cloned()
    }

    /// A robot hears something, whoever said it: it believes what the members signed.
    pub fn hear(&mut self, robot: usize, said: Said) {
        match &said {
            Said::Message(Envelope { message: Message::Samples(batch), .. }) => self.note_batch(batch),
            Said::Message(Envelope { message: Message::Batches(batches), .. }) => {
                batches.batches.iter().for_each(|batch| self.note_batch(&batch.samples));
            }
            _ => {}
        }
        let gate = &mut self.gates[robot];
        let input = match said {
            Said::Message(envelope) => match gate.message(self.now, envelope) {
                Ok(envelope) => Input::Received(envelope),
                Err(_) => return,
            },
            Said::Announced(announcement) => {
                let sound = announcement.check().is_ok();
                if !sound || gate.announcement(self.now, &announcement).is_err() {
                    return;
                }
                Input::Announced(announcement)
            }
            Said::Asked(question) => {
                let sound = question.check().is_ok();
                if !sound || gate.message(self.now, question.clone().into()).is_err() {
                    return;
                }
                Input::Asked(question)
            }
            Said::Answered(by, at, robot) => Input::Answered(by, at, robot),
        };
        self.input(robot, input);
    }

    /// What is on its way at that place arrives, if something is; what it causes is then on its way too.
    pub fn arrive(&mut self, which: usize) {
        let place = which % self.under_way.len().max(1);
        if let Some((to, said)) = self.under_way.remove(place) {
            self.hear(to, said);
        }
    }

    /// It is lost.
    pub fn lose(&mut self, which: usize) {
        let place = which % self.under_way.len().max(1);
        self.under_way.remove(place);
    }

    /// It comes twice.
    pub fn repeat(&mut self, which: usize) {
        if let Some(again) = self.under_way.get(which % self.under_way.len().max(1)).cloned() {
            self.under_way.push_back(again);
        }
    }

    /// Everything that is on its way arrives, and all that this causes.
    ///
    /// # Panics
    /// If it never ends.
    pub fn arrive_all(&mut self) {
        let mut left = 100_000;
        while let Some((to, said)) = self.under_way.pop_front() {
            self.hear(to, said);
            left -= 1;
            assert!(left > 0, "the robots talk in circles");
        }
    }

    /// Time passes; robots do what is due. Messages arrive at once, or not at all meanwhile.
    ///
    /// # Panics
    /// If a robot wants to be woken without end.
    pub fn pass(&mut self, time: Duration, arriving: bool) {
        let end = self.now + time;
        let mut left = 100_000;
        loop {
            if arriving {
                self.arrive_all();
            }
            let due = self.robots.iter().filter_map(|robot| robot.mind().next_wake()).min();
            let next = due.map_or(end, |due| due.max(self.now + Duration::from_millis(1)));
            self.now = next.min(end);
            for robot in 0..ROBOTS {
                self.input(robot, Input::Tick);
            }
            if self.now >= end {
                break;
            }
            left -= 1;
            assert!(left > 0, "a robot never rests");
        }
        if arriving {
            self.arrive_all();
        }
    }
}
