//! What robots do ahead of their turn, on all cores at once.
//!
//! A message takes some time on its way. What is due within that time from the next event on is known by then, but for what a robot gives
//! itself to do: no other robot can hear of it before, and do something about it. So each robot does its part of that by itself, in the order
//! of time; then all parts are carried out in the order of all, as if each had been done at its turn. What comes of it is the same on any
//! number of threads, and on one, where nothing is done ahead.

use std::time::Duration;

use super::Swarm;
use super::answering::THINKS;
use super::queue::Due;
use super::robot::Robot;
use super::turn::{Deed, Turn};
use crate::emulation::network::Presence;
use crate::emulation::school::School;

/// Fewer turns than this are done sooner than other cores are woken.
pub(super) const WORTHWHILE: usize = 32;

impl Swarm<'_> {
    /// Lets robots do what is due for them within the time of a message, and before that time, if it is worth it.
    pub(super) fn go_ahead(&mut self, until: Duration) {
        let Some(start) = self.queue.next() else { return };
        if self.crew.is_alone() || start < self.looked_ahead {
            return;
        }
        let end = until.min(start + self.scenario.link.latency.min(THINKS));
        let end = self.queue.before(end).find(|(_, due)| due.is_for_all()).map_or(end, |(at, _)| at);
        self.looked_ahead = end;
        if self.queue.before(end).map(|(_, due)| due.turns_before(end)).sum::<usize>() < self.worthwhile {
            return;
        }
        let Self { queue, network, robots, .. } = self;
        let mut plan = |at: Duration, i: usize, turn: Turn| {
            let robot: &mut Robot = &mut robots[i];
            // What a poisoner says depends on what it holds when it says it.
            if network.presence(i) == Presence::Up && robot.mind.is_some() && robot.poison.is_none() {
                robot.ahead.due.push((at, turn));
            }
        };
        for (at, due) in queue.before(end) {
            match due {
                Due::Frame(i, n) => plan(at, *i, Turn::Looks(*n)),
                Due::Remembered(i, boot, revision) => plan(at, *i, Turn::Has(*boot, *revision)),
                Due::Arrive(i, parcel) => plan(at, *i, Turn::Hears(parcel.clone())),
                Due::Spread(arrivals, parcel) => {
                    let in_time = arrivals.iter().take_while(|(at, _)| *at < end);
                    in_time.for_each(|(at, i)| plan(*at, *i, Turn::Hears(parcel.clone())));
                }
                // Of all times that it ever wanted to be woken at it knows the last.
                Due::Wake(_) => {}
                Due::Show(_)
                | Due::Fault(_)
                | Due::Churn
                | Due::Calm
                | Due::Notice(_)
                | Due::Teach(..)
                | Due::Reply(..) => {}
            }
        }
        let school = self.school.as_deref();
        let busy = robots.iter_mut().filter(|robot| !robot.ahead.due.is_empty()).collect();
        self.crew.on_each(busy, |robot: &mut Robot| robot.go_ahead(start, end, school));
    }
}

impl Robot {
    /// Does what is due for it before `end`, up to where two things are due at once: which comes first is known when it is their turn.
    fn go_ahead(&mut self, start: Duration, end: Duration, school: Option<&School>) {
        let mut due = std::mem::take(&mut self.ahead.due);
        // The first last.
        due.sort_by_key(|(at, _)| std::cmp::Reverse(*at));
        let mut now = start;
        loop {
            let wakes = self.wake.filter(|wake| (now..end).contains(wake));
            let next = due.last().map(|(at, _)| *at);
            let turn = match (wakes, next) {
                (Some(wake), Some(next)) if wake == next => break,
                (Some(wake), next) if next.is_none_or(|next| wake < next) => (wake, Turn::Wakes),
                _ => match due.pop() {
                    Some((at, _)) if due.last().is_some_and(|(other, _)| *other == at) => break,
                    Some(turn) => turn,
                    None => break,
                },
            };
            now = turn.0;
            let deeds = self.act(now, &turn.1, true, school);
            for deed in &deeds {
                let (at, turn) = match deed {
                    Deed::Looks(_, at, n) | Deed::LooksOn(at, n) => (*at, Turn::Looks(*n)),
                    Deed::Remembers(revision) => (now, Turn::Has(self.boot, *revision)),
                    _ => continue,
                };
                if at < end {
                    due.insert(due.partition_point(|(other, _)| *other > at), (at, turn));
                }
            }
            self.ahead.done.push_back((turn.0, turn.1, deeds));
        }
        due.clear();
        self.ahead.due = due;
    }
}
