//! What liars say to the others.

use std::sync::Arc;

use gestalt_protocol::{Announcement, ClassId, Decision, Envelope, Give, HeldVote, Message, RobotId};

use super::Swarm;
use super::parcel::{Parcel, as_json, over_the_wire};
use super::queue::Due;
use crate::emulation::network::Kind;
use crate::emulation::scenario::Lies;

impl Swarm<'_> {
    /// The liars hear something, and lie if it is news.
    pub(super) fn deceive(&mut self, parcel: &Parcel) {
        let heard: Vec<HeldVote> = match parcel {
            Parcel::Said(envelope) => match &envelope.message {
                Message::Vote(vote) => {
                    let (robot, stamp, signature) = (envelope.author, envelope.stamp, envelope.signature);
                    vec![HeldVote { robot, stamp, vote: vote.clone(), signature }]
                }
                Message::Give(give) => {
                    let counted = give.decision.iter().flat_map(|decision| &decision.certificate.votes);
                    give.votes.iter().cloned().chain(counted.map(|counted| counted.held())).collect()
                }
                _ => Vec::new(),
            },
            Parcel::Announced(said) => {
                said.decision.certificate.votes.iter().map(|counted| counted.held()).collect()
            }
            Parcel::Asked(_) | Parcel::Instructed(_) | Parcel::Answered(..) => Vec::new(),
        };
        let honest = |robot: RobotId| self.robots[robot.0 as usize - 1].lies.is_none();
        let of_others: Vec<HeldVote> = heard.into_iter().filter(|held| honest(held.robot)).collect();
        // All of them are heard, whichever is news.
        if of_others.iter().filter(|held| self.plot.hear(held)).count() > 0 {
            self.lie();
        }
    }

    /// All of them that are up do.
    fn lie(&mut self) {
        let liars: Vec<usize> = self.network.up().filter(|i| self.robots[*i].lies.is_some()).collect();
        let Some(lies) = liars.first().and_then(|i| self.robots[*i].lies) else { return };
        let ids: Vec<RobotId> = liars.iter().map(|i| self.robots[*i].id).collect();
        let (classes, robots) = (self.scenario.classes, self.robots.len());
        let rivals = self.plot.rivals(self.shown, classes);
        if self.plot.goal != Some(rivals[0]) {
            self.plot.goal = Some(rivals[0]);
            let other = rivals.get(1).copied().unwrap_or(self.shown);
            let faces = [rivals[0], if lies == Lies::TwoFaced { other } else { rivals[0] }];
            liars.iter().for_each(|i| self.vote_falsely(*i, faces));
            if lies == Lies::Choosing
                && let Some(claim) = self.plot.claim(rivals[0], classes, &ids, robots, &self.scenario.mind)
            {
                self.spread_decision(&liars, &claim);
            }
        }
        if lies != Lies::Choosing {
            return;
        }
        let took =
            self.now.saturating_sub(self.record.showings.last().map_or(self.now, |showing| showing.at));
        for class in rivals {
            if self.plot.told.contains(&class) {
                continue;
            }
            let (what, who) = ((self.shown, classes), (ids.as_slice(), robots));
            if let Some(decision) = self.plot.choose(class, what, who, took, &self.scenario.mind) {
                self.plot.told.insert(class);
                self.record.forge(&decision);
                self.spread_decision(&liars, &decision);
            }
        }
    }

    /// Votes for the first gesture before every other robot, and for the second before the rest.
    fn vote_falsely(&mut self, i: usize, faces: [ClassId; 2]) {
        let (stamp, author) = (self.plot.stamp(), self.robots[i].id);
        let votes = faces.map(|class| self.plot.vote(class, self.scenario.classes, self.scenario.mind.clip));
        let [Some(first), Some(second)] = votes else { return };
        let said = [first, second].map(|vote| {
            over_the_wire(&Envelope { author, stamp, message: Message::Vote(vote), signature: None })
        });
        for (to, taken) in self.network.broadcast(i, said[0].1, Kind::Vote) {
            self.at(self.now + taken, Due::Arrive(to, Parcel::Said(said[to % 2].0.clone())));
        }
    }

    /// Announces a decision as final, says that all liars hold it, and gives it to the neighbours.
    fn spread_decision(&mut self, liars: &[usize], decision: &Decision) {
        for i in liars {
            let announcer = self.robots[*i].id;
            let said = |stamp, message| Envelope { author: announcer, stamp, message, signature: None };
            let stamp = self.plot.stamp();
            let announcement =
                Announcement { decision: decision.clone(), label: None, announcer, stamp, signature: None };
            let (announced, bytes) = as_json(&announcement);
            let (held, held_bytes) =
                over_the_wire(&said(self.plot.stamp(), Message::Holding(decision.holding(false))));
            let given = Give { decision: Some(decision.clone()), votes: Vec::new(), holders: Vec::new() };
            let given = Arc::new(said(self.plot.stamp(), Message::Give(given)));
            self.broadcast(*i, bytes, Kind::Decision, &Parcel::Announced(announced));
            self.broadcast(*i, held_bytes, Kind::Decision, &Parcel::Said(held));
            for to in self.network.neighbours(*i) {
                if let Some(taken) = self.network.tell(*i, to, bytes, false) {
                    self.at(self.now + taken, Due::Arrive(to, Parcel::Said(given.clone())));
                }
            }
        }
    }
}
