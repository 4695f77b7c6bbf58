//! The sure way: neighbours tell each other what they have and give each other what they lack, hop by hop, so
//! that nothing depends on how the fast way routes.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use gestalt_protocol::{Give, Have, Message, RobotId, Stamp};

use super::{Mind, MindConfig, Output};

/// After a change of the neighbourhood, repair stays busy for this long.
const UNREST: Duration = Duration::from_secs(5);

/// The most votes in one [`Give`], so that it fits in a message whatever the vocabulary; the next one brings more.
const MAX_GIVEN: usize = 1024;

/// With whom, and when next, to compare what each has.
#[derive(Clone, Debug)]
pub(super) struct Repair {
    neighbours: BTreeSet<RobotId>,
    next: Duration,
    busy_until: Duration,
    /// Whom this robot turned to last.
    last: Option<RobotId>,
}

impl Repair {
    pub(super) fn new(first: Duration) -> Self {
        Self { neighbours: BTreeSet::new(), next: first, busy_until: Duration::ZERO, last: None }
    }

    /// When the next repair is due; never for a robot that knows of no other.
    pub(super) fn due(&self, alive: &BTreeSet<RobotId>) -> Option<Duration> {
        let alone = self.neighbours.is_empty() && alive.is_empty();
        (!alone).then_some(self.next)
    }

    /// Brings the next repair forward to the busy pace.
    pub(super) fn hurry(&mut self, now: Duration, config: &MindConfig) {
        self.next = self.next.min(now + config.repair_busy);
    }

    /// Whom to turn to: the neighbours in turn, or, where none is known, all the living in turn.
    fn turn(&mut self, alive: &BTreeSet<RobotId>) -> Option<RobotId> {
        let partners = if self.neighbours.is_empty() { alive } else { &self.neighbours };
        let next = partners.iter().find(|robot| Some(**robot) > self.last).or(partners.first()).copied();
        self.last = next;
        next
    }
}

impl Mind {
    /// Greets new neighbours with what this robot has.
    pub(super) fn on_neighbours(&mut self, mut robots: BTreeSet<RobotId>, out: &mut Vec<Output>) {
        robots.remove(&self.me);
        if robots == self.repair.neighbours {
            return;
        }
        let new: Vec<RobotId> = robots.difference(&self.repair.neighbours).copied().collect();
        self.repair.neighbours = robots;
        self.repair.busy_until = self.now + UNREST;
        self.repair.hurry(self.now, &self.config);
        for robot in new {
            self.tell_have(robot, false, out);
        }
    }

    /// Compares what this robot has with one neighbour, when it is time to.
    pub(super) fn repair_when_due(&mut self, out: &mut Vec<Output>) {
        if self.now < self.repair.next {
            return;
        }
        let busy = self.is_open() || self.now < self.repair.busy_until;
        let period = if busy { self.config.repair_busy } else { self.config.repair_idle };
        self.repair.next = self.now + period;
        if let Some(robot) = self.repair.turn(&self.alive) {
            self.tell_have(robot, false, out);
        }
    }

    /// Hears what a neighbour has: gives what it lacks, and asks for what this robot lacks itself.
    pub(super) fn on_have(&mut self, from: RobotId, have: &Have, out: &mut Vec<Output>) {
        if !have.answer {
            self.compare_knowledge(from, have.knowledge, out);
        }
        let order = match have.round {
            None => Ordering::Less,
            Some(id) => match self.place(id) {
                None => return,
                // A round still undecided there is one to take part in.
                Some(Ordering::Greater) if have.decision.is_none() => {
                    self.join(id, out);
                    Ordering::Equal
                }
                Some(order) => order,
            },
        };
        if let Some(give) = self.lacking_there(order, have) {
            self.tell(from, Message::Give(give), out);
        }
        if !have.answer && self.lacking_here(order, have) {
            self.tell_have(from, true, out);
        }
    }

    /// Takes in what this robot lacked, and passes on what was news: the other neighbours may lack it too.
    pub(super) fn on_give(&mut self, from: RobotId, give: Give, out: &mut Vec<Output>) {
        let counter = self.round().map(|id| id.counter);
        let mut news = Give { decision: None, votes: Vec::new() };
        if let Some(decision) = give.decision {
            let id = decision.round;
            if self.hear_decision(Some(from), decision.clone(), out) {
                if !self.is_open() && counter.is_none_or(|counter| id.counter > counter) {
                    self.note_missed_announcement();
                }
                news.decision = Some(decision);
            }
        }
        for held in give.votes {
            if self.hear_vote(held.robot, held.stamp, held.vote.clone(), out) {
                news.votes.push(held);
            }
        }
        if news.decision.is_none() && news.votes.is_empty() {
            return;
        }
        let others: Vec<RobotId> = self.repair.neighbours.iter().copied().filter(|r| *r != from).collect();
        for robot in others {
            self.tell(robot, Message::Give(news.clone()), out);
        }
    }

    /// The robots this one is directly linked to.
    #[must_use]
    pub fn neighbours(&self) -> &BTreeSet<RobotId> {
        &self.repair.neighbours
    }

    /// A round learnt of only after it was decided is not this robot's to announce: those who took part did.
    fn note_missed_announcement(&mut self) {
        if let Some(round) = &mut self.round
            && let Some(class) = round.agreement.best_class()
        {
            round.agreement.note_announced(self.now, class);
        }
    }

    /// What the neighbour lacks; its newest round stands to this robot's as `order` says.
    fn lacking_there(&self, order: Ordering, have: &Have) -> Option<Give> {
        let round = self.round.as_ref().filter(|_| order.is_le())?;
        let (rank, known) = match order {
            Ordering::Equal => (have.decision, have.votes.iter().copied().collect()),
            _ => (None, BTreeMap::<RobotId, Stamp>::new()),
        };
        let decision = round.agreement.held().filter(|held| Some(held.rank()) > rank).cloned();
        // Who gets a decision needs no votes; unless it must not believe one robot's word.
        let votes = if rank.is_none() && (decision.is_none() || self.config.liars > 0) {
            round.ballot.lacking(&known).take(MAX_GIVEN).collect()
        } else {
            Vec::new()
        };
        (decision.is_some() || !votes.is_empty()).then_some(Give { decision, votes })
    }

    /// Whether the neighbour has something that this robot lacks.
    fn lacking_here(&self, order: Ordering, have: &Have) -> bool {
        let Some(round) = self.round.as_ref().filter(|_| order.is_eq()) else { return order.is_gt() };
        let rank = round.agreement.rank();
        let newer = |(robot, stamp): &(RobotId, Stamp)| {
            *robot != self.me && round.ballot.stamp(*robot).is_none_or(|mine| mine < *stamp)
        };
        have.decision > rank || (rank.is_none() && have.votes.iter().any(newer))
    }

    fn tell_have(&mut self, robot: RobotId, answer: bool, out: &mut Vec<Output>) {
        let have = Have {
            round: self.round(),
            decision: self.round.as_ref().and_then(|round| round.agreement.rank()),
            votes: match &self.round {
                Some(round) if round.open => round.ballot.stamps().collect(),
                _ => Vec::new(),
            },
            knowledge: self.knowledge(),
            answer,
        };
        self.tell(robot, Message::Have(have), out);
    }

    /// Turns to one neighbour after the other at the busy pace for a while.
    pub(super) fn hurry_repair(&mut self) {
        self.repair.busy_until = self.now + UNREST;
        self.repair.hurry(self.now, &self.config);
    }

    pub(super) fn tell(&mut self, robot: RobotId, message: Message, out: &mut Vec<Output>) {
        let envelope = self.stamped(message);
        out.push(Output::Tell(robot, envelope));
    }
}
