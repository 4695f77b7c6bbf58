//! What can be said without being a robot. In peace all of it is left unsaid.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{
    Announcement, Decision, Envelope, Give, HeldVote, Instruction, Message, RobotId, RoundId, Stamp, Topic,
};
use gestalt_strategies::{Input, MindConfig};

use crate::forged;
use crate::trust::{SwarmId, Tag};

use super::network::{Swarm, json};
use super::port::Parcel;
use super::world::key;

impl Swarm {
    /// Whether the adversary acts at all: what it would say in peace need not be made.
    pub fn at_war(&self) -> bool {
        !self.peace
    }

    /// The swarm's identity, which everybody may know.
    pub fn id(&self) -> SwarmId {
        self.roster.swarm_id()
    }

    /// How many honest robots there are.
    pub fn honest(&self) -> u32 {
        self.plan.honest
    }

    /// The number of the first liar.
    pub fn liar(&self) -> u32 {
        self.plan.honest + 1
    }

    /// By what its robots decide.
    pub fn rounds(&self) -> &MindConfig {
        &self.plan.rounds
    }

    /// How many honest robots have convicted that one.
    pub fn convicting(&self, robot: u32) -> u32 {
        self.robots.iter().map(|honest| u32::from(honest.port.convicts(RobotId(robot)))).sum()
    }

    /// The round that robot 1 knows, which everybody hears of.
    pub fn round(&self) -> RoundId {
        self.mind(1).round().unwrap_or(RoundId { counter: 1, opener: RobotId(1), life: 0 })
    }

    /// All that was said so far, for whoever recorded it.
    pub fn air(&self) -> &[Parcel] {
        &self.air
    }

    /// The key of that topic.
    pub fn key(&self, topic: &Topic) -> String {
        self.keys.key(topic)
    }

    /// What a key is about.
    pub fn topic(&self, key: &str) -> Option<Topic> {
        self.keys.parse(key)
    }

    /// How many messages and tokens of the adversary reached a robot.
    pub fn uttered(&self) -> u64 {
        self.uttered
    }

    /// How many messages of the adversary were dropped without a counter naming it.
    pub fn silent(&self) -> u64 {
        self.silent
    }

    /// The votes that were said so far, as their authors said them.
    pub fn votes(&self) -> Vec<HeldVote> {
        self.votes_since(Duration::ZERO)
    }

    /// Those that were said since then.
    pub fn votes_since(&self, since: Duration) -> Vec<HeldVote> {
        let since = since.as_nanos() as u64;
        let said = self.air.iter().filter(|parcel| parcel.at >= since);
        let envelopes = said.filter_map(|parcel| Envelope::decode(&parcel.bytes).ok());
        let votes = envelopes.filter_map(|Envelope { author, stamp, message, signature }| match message {
            Message::Vote(vote) => Some(HeldVote { robot: author, stamp, vote, signature }),
            _ => None,
        });
        votes.collect()
    }

    /// Says these bytes under that key to every robot, before anything else is heard.
    pub fn put(&mut self, topic: &Topic, bytes: &[u8]) {
        (1..=self.plan.honest).for_each(|robot| self.put_to(robot, topic, bytes));
    }

    /// The same to one robot alone.
    pub fn put_to(&mut self, robot: u32, topic: &Topic, bytes: &[u8]) {
        self.replay_to(
            robot,
            &Parcel { key: self.keys.key(topic), bytes: bytes.to_vec(), attachment: None, at: self.time() },
        );
    }

    /// Says these bytes under that key to every robot, with that attached.
    pub fn put_attached(&mut self, topic: &Topic, bytes: Vec<u8>, attachment: Option<Vec<u8>>) {
        self.replay(&Parcel { key: self.keys.key(topic), bytes, attachment, at: self.time() });
    }

    /// Says a word as the instructor of that name, who has a key.
    pub fn put_word(&mut self, by: &str, instruction: &Instruction) {
        let parcel = self.word(by, instruction);
        self.replay(&parcel);
    }

    /// Says what was recorded once more.
    pub fn replay(&mut self, parcel: &Parcel) {
        (1..=self.plan.honest).for_each(|robot| self.replay_to(robot, parcel));
    }

    /// The same to one robot alone.
    pub fn replay_to(&mut self, robot: u32, parcel: &Parcel) {
        if self.peace {
            return;
        }
        let i = robot as usize - 1;
        let before = self.robots[i].refusals();
        self.arrive(i, parcel);
        self.uttered += 1;
        self.silent += u64::from(self.robots[i].refusals() == before);
    }

    /// Says a vote under the key of its author.
    pub fn put_vote(&mut self, envelope: &Envelope) {
        self.put(&Topic::Vote(envelope.author), &envelope.encode());
    }

    /// Announces a decision, in the name of its author; a liar that is enrolled signs it.
    pub fn put_decision(&mut self, decision: &Decision) {
        self.whispered += 1;
        let (announcer, stamp) = (decision.author, Stamp { boot: 10, sequence: self.whispered });
        let decision = decision.clone();
        let unsigned = Announcement { decision, label: None, announcer, stamp, signature: None };
        let said = self.signed_by_liar(unsigned.into());
        self.put_announcement(said);
    }

    /// Announces a decision in the words of whoever signed it.
    pub fn put_announcement(&mut self, said: Envelope) {
        let announcement = Announcement::of(said).expect("an announcement");
        self.put(&Topic::Decision, &json(&announcement));
    }

    /// Says what a robot holds under its key; a liar that is enrolled signs it.
    pub fn put_holding(&mut self, to: u32, robot: u32, decision: &Decision) {
        self.whispered += 1;
        let (author, stamp) = (RobotId(robot), Stamp { boot: 10, sequence: self.whispered });
        let message = Message::Holding(decision.holding(false));
        let said = self.signed_by_liar(Envelope { author, stamp, message, signature: None });
        self.put_to(to, &Topic::RobotDecision(author), &said.encode());
    }

    /// Says something as a neighbour does, in that robot's name, to every other robot.
    pub fn whisper(&mut self, from: u32, message: &Message) {
        (1..=self.plan.honest).filter(|to| *to != from).for_each(|to| self.whisper_to(to, from, message));
    }

    /// The same to one robot alone.
    pub fn whisper_to(&mut self, to: u32, from: u32, message: &Message) {
        // Two messages under one stamp would convict it.
        self.whispered += 1;
        let stamp = Stamp { boot: 10, sequence: self.whispered };
        let envelope = self.signed_by_liar(Envelope {
            author: RobotId(from),
            stamp,
            message: message.clone(),
            signature: None,
        });
        let bytes = envelope.encode();
        // A liar that is enrolled has channels; who speaks in another's name has to make a tag up.
        let made_up = [0x5a; size_of::<Tag>()];
        let channels = self.channels.get_mut(&from);
        let tag = channels.and_then(|of| of.tag(&self.roster, RobotId(to), &bytes).ok()).unwrap_or(made_up);
        let attachment = Some(tag.to_vec());
        let key = self.keys.key(&Topic::Repair(RobotId(to)));
        self.replay_to(to, &Parcel { key, bytes, attachment, at: self.time() });
    }

    /// What a liar signs that is enrolled, and stands by what it says.
    fn signed_by_liar(&self, mut envelope: Envelope) -> Envelope {
        let by = envelope.author;
        if !self.channels.contains_key(&by.0) {
            return envelope;
        }
        if let Message::Batches(batches) = &mut envelope.message {
            for batch in batches.batches.iter_mut().filter(|batch| batch.robot == by) {
                batch.signature = forged::signed(batch.clone().into(), &key(by.0), &self.id()).signature;
            }
        }
        match envelope.message {
            Message::Give(Give { decision: Some(_), .. })
            | Message::Lessons(_)
            | Message::Namings(_)
            | Message::Holding(_)
            | Message::Announced(_)
            | Message::Asked(_) => forged::signed(envelope, &key(by.0), &self.id()),
            _ => envelope,
        }
    }

    /// Gives a decision and votes as a neighbour does.
    pub fn give(&mut self, from: u32, decision: Option<Decision>, votes: Vec<HeldVote>) {
        self.whisper(from, &Message::Give(Give { decision, votes, holders: Vec::new() }));
    }

    /// Shows liveliness tokens of these robots beside the true ones, and takes others that it showed away.
    pub fn show_tokens(&mut self, ghosts: impl IntoIterator<Item = u32>) {
        if self.peace {
            return;
        }
        let tokens: BTreeSet<RobotId> =
            self.tokens.iter().copied().chain(ghosts.into_iter().map(RobotId)).collect();
        for i in 0..self.robots.len() {
            let tokens = self.robots[i].port.tokens(&tokens);
            self.tell(i, Input::Alive(Arc::new(tokens)));
            self.uttered += 1;
        }
    }
}
