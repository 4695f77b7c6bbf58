//! An honest robot: a mind, its port, its disk, and what it is known by from outside.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{Envelope, Fnv1a, Keys, RobotId, Signature, Stamp};
use gestalt_strategies::{
    Input, LearningSetup, Life, Mind, Output, RecordChange, RobotMemory, Sign, is_refuted,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::plan::Plan;
use super::port::Port;
use super::world::{ByFirst, SWARM, key, space, vocabulary};
use crate::trust::{Channels, Identity, Judge, Roster, SwarmId, statement};

/// An honest robot.
#[derive(Debug)]
pub struct Robot {
    /// Whose.
    pub id: RobotId,
    /// Its mind.
    pub mind: Mind,
    /// Where it hears.
    pub port: Port,
    /// How often it has started.
    pub boot: u32,
    /// When it wants to be woken.
    pub wake: Option<Duration>,
    /// Whether its camera runs, and how often that was begun.
    pub looking: bool,
    pub looks: u64,
    /// What its camera adds to what it sees.
    pub chance: ChaCha8Rng,
    /// Refused in its earlier lives.
    before: BTreeMap<String, u64>,
    disk: BTreeMap<Vec<u8>, Vec<u8>>,
    seed: u64,
    said: Fnv1a,
}

/// What a robot said and knows, to be compared.
#[derive(Clone, Debug)]
pub struct Account {
    /// Which robot.
    pub robot: RobotId,
    /// A digest of everything it said and did, and when.
    pub said: u64,
    /// The round, the decision and the votes that it knows, and what it learned.
    pub knows: String,
    /// What it learned alone.
    pub learned: String,
}

#[derive(Debug)]
struct Signer {
    identity: Arc<Identity>,
    swarm: SwarmId,
}

impl Sign for Signer {
    fn sign(&self, statement: &[u8]) -> Signature {
        statement::sign(&self.identity, &self.swarm, statement)
    }
}

impl Robot {
    /// A robot that starts for the first time.
    pub fn new(id: RobotId, plan: &Plan, roster: Option<&Roster>, seed: u64) -> Self {
        let seed = seed.wrapping_mul(1000) + u64::from(id.0);
        let disk = BTreeMap::new();
        let (mind, port) = waken(id, plan, roster, (seed, 1), &disk);
        Self {
            id,
            mind,
            port,
            boot: 1,
            wake: None,
            looking: false,
            looks: 0,
            chance: ChaCha8Rng::seed_from_u64(seed),
            before: BTreeMap::new(),
            disk,
            seed,
            said: Fnv1a::default(),
        }
    }

    /// Ends and starts again, with what its disk holds, or with an empty one.
    pub fn restart(&mut self, plan: &Plan, roster: Option<&Roster>, forgets: bool) {
        self.before = self.refused();
        self.boot += 1;
        if forgets {
            self.disk.clear();
        }
        (self.mind, self.port) = waken(self.id, plan, roster, (self.seed, self.boot), &self.disk);
        (self.looking, self.wake) = (false, None);
    }

    /// What it is told when it starts.
    pub fn introduction(&self, alive: &BTreeSet<RobotId>, neighbours: &BTreeSet<RobotId>) -> Vec<Input> {
        let believe = self.port.believer().map(Input::Believe);
        let others = [
            Input::Learned(Arc::new(ByFirst)),
            Input::Alive(Arc::new(alive.clone())),
            Input::Neighbours(neighbours.clone()),
        ];
        believe.into_iter().chain(others).collect()
    }

    /// Writes to its disk.
    pub fn write(&mut self, changes: Vec<RecordChange>) {
        for RecordChange { key, value } in changes {
            match value {
                Some(value) => self.disk.insert(key, value),
                None => self.disk.remove(&key),
            };
        }
    }

    /// Notes what it said or did.
    pub fn note(&mut self, now: Duration, output: &Output) {
        let words = match output {
            Output::Broadcast(envelope) | Output::Tell(_, envelope) => envelope.encode(),
            Output::Hold(decision) => format!("{decision:?}").into_bytes(),
            Output::Announce(announcement) => format!("{announcement:?}").into_bytes(),
            // What follows from them is said, held or learned.
            Output::Train(_) | Output::Remember { .. } => Vec::new(),
            other => format!("{other:?}").into_bytes(),
        };
        self.said.add(now.as_nanos().to_le_bytes().into_iter().chain(words));
    }

    /// What it refused in all its lives, by counter.
    pub fn refused(&self) -> BTreeMap<String, u64> {
        let mut refused = self.before.clone();
        let of_mind = self.mind.refusals().iter().map(|(cause, times)| (cause.name().to_owned(), times));
        let of_port = self.port.refused().iter().map(|(name, times)| (name.clone(), *times));
        for (counter, times) in of_mind.chain(of_port).filter(|(_, times)| *times > 0) {
            *refused.entry(counter).or_default() += times;
        }
        refused
    }

    /// How much it refused in all its lives.
    pub fn refusals(&self) -> u64 {
        let of_mind = self.mind.refusals().iter().map(|(_, times)| times);
        self.before.values().copied().chain(of_mind).chain(self.port.refused().values().copied()).sum()
    }

    /// What it says and knows.
    pub fn account(&self) -> Account {
        let mind = &self.mind;
        let mut learned = format!("{:?}", mind.learned().map(|status| (status.common, status.lessons)));
        let samples = mind.training_set().into_iter().flat_map(|set| set.iter());
        let mut samples: Vec<_> = samples.map(|sample| (sample.id, sample.class, sample.round)).collect();
        samples.sort_unstable();
        let _ = write!(learned, " {samples:?}");
        let stamps: Vec<(RobotId, Stamp)> =
            mind.ballot().into_iter().flat_map(|ballot| ballot.stamps()).collect();
        let knows = format!("{:?} {:?} {:?} {stamps:?} {learned}", mind.round(), mind.is_open(), mind.held());
        Account { robot: self.id, said: self.said.hash(), knows, learned }
    }
}

/// A mind with what a disk holds, and its port.
fn waken(
    id: RobotId,
    plan: &Plan,
    roster: Option<&Roster>,
    (seed, boot): (u64, u32),
    disk: &BTreeMap<Vec<u8>, Vec<u8>>,
) -> (Mind, Port) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(1 << 20) + u64::from(boot));
    let life = Life { boot, nonce: rng.random() };
    let records = disk.iter().map(|(key, value)| (key.as_slice(), value.as_slice()));
    let setup = LearningSetup {
        config: plan.learning.clone(),
        space: space(),
        vocabulary: vocabulary().clone(),
        rng: Box::new(rng),
        memory: Some(RobotMemory::read(records).expect("what it wrote itself")),
        rules: gestalt_strategies::OwnRules::default(),
    };
    let mind = Mind::new(id, life, plan.rounds.clone()).expect("sound parameters");
    let mut mind = mind.learning(setup).expect("sound parameters");
    if let Some(roster) = roster {
        mind = mind.signed_by(Arc::new(Signer { identity: key(id.0), swarm: roster.swarm_id() }));
    }
    let keys = Keys::new(SWARM).expect("a name");
    let sealed = roster.map(|roster| {
        let channels = Channels::new(id, key(id.0), roster.swarm_id());
        (Judge::new(roster.clone(), is_refuted), channels)
    });
    (mind, Port::new(id, keys, sealed))
}

/// A message of a robot's, as the network carries it.
pub fn is_vote(envelope: &Envelope) -> bool {
    matches!(envelope.message, gestalt_protocol::Message::Vote(_))
}
