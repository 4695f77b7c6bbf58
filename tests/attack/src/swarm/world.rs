//! What all robots of an emulated swarm have in common: their gestures, their feature space, their keys.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use gestalt_protocol::{InstructorId, RobotId};
use gestalt_strategies::{Classify, ClassifyError, Components, FeatureSpace, ScalingMethod, Vocabulary};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::trust::{Identity, Instructor, Membership, Role, Roles, Roster};

/// How many gestures there are.
pub const CLASSES: u32 = 6;

/// How many features a frame has.
pub const FEATURES: usize = 8;

/// How probable a robot finds the gesture that it sees in one frame.
const SURE: f64 = 0.9;

/// The swarm's name.
pub const SWARM: &str = "attacked";

/// The gestures.
pub fn vocabulary() -> &'static Vocabulary {
    static VOCABULARY: OnceLock<Vocabulary> = OnceLock::new();
    VOCABULARY
        .get_or_init(|| Vocabulary::new((0..CLASSES).map(|class| class.to_string())).expect("six labels"))
}

/// The space that samples lie in.
pub fn space() -> Arc<FeatureSpace> {
    static SPACE: OnceLock<Arc<FeatureSpace>> = OnceLock::new();
    let fitted = || {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let rows: Vec<Vec<f32>> = (0..60).map(|n| features(n as u32 % CLASSES, &mut rng)).collect();
        let rows = rows.iter().map(Vec::as_slice);
        Arc::new(FeatureSpace::fit("test", rows, ScalingMethod::PerComponent, Components::Count(4), &mut rng))
    };
    SPACE.get_or_init(fitted).clone()
}

/// What a robot sees of that gesture in one frame.
pub fn features(class: u32, rng: &mut ChaCha8Rng) -> Vec<f32> {
    let mut features: Vec<f32> = (0..FEATURES).map(|_| rng.random::<f32>() * 0.9).collect();
    features[0] += class as f32;
    features
}

/// Tells the gesture from the first feature.
#[derive(Debug)]
pub struct ByFirst;

impl Classify for ByFirst {
    fn vocabulary(&self) -> &Vocabulary {
        vocabulary()
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        let seen = features[0] as usize % CLASSES as usize;
        let other = (1.0 - SURE) / f64::from(CLASSES - 1);
        Ok((0..CLASSES as usize).map(|class| if class == seen { SURE } else { other }).collect())
    }
}

/// The key that a robot of that number is enrolled with; any other number is somebody's too.
pub fn key(number: u32) -> Arc<Identity> {
    let mut secret = [7; 32];
    secret[..4].copy_from_slice(&number.to_le_bytes());
    identity(secret)
}

/// Who enrols the robots.
pub fn authority() -> Arc<Identity> {
    key(1000)
}

/// The key that an instructor of that name is enrolled with.
pub fn key_of(name: &InstructorId) -> Arc<Identity> {
    let mut secret = [9; 32];
    let name = name.to_string();
    secret[..name.len()].copy_from_slice(name.as_bytes());
    identity(secret)
}

/// That of a secret, whose public key is worked out once in a process: thousands of swarms have the same.
fn identity(secret: [u8; 32]) -> Arc<Identity> {
    static KNOWN: Mutex<BTreeMap<[u8; 32], Arc<Identity>>> = Mutex::new(BTreeMap::new());
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    known.entry(secret).or_insert_with(|| Arc::new(Identity::memoised(&secret))).clone()
}

/// The number of a key that nobody enrolled.
pub const STRANGER: u32 = 77;

/// So many robots, from 1 on, as members of the swarm in that epoch.
pub fn members(robots: u32, epoch: u64) -> Membership {
    let robots = (1..=robots).map(|id| (RobotId(id), key(id).public_key())).collect();
    // Ada was there first, and may overrule; the others may teach, but for Olga, who may open rounds.
    let others = (0..16).map(|n| format!("eve{n}")).chain(["eve".to_owned()]);
    let teachers = others.map(|name| (name, Role::Teach));
    let names = teachers.chain([("ada".to_owned(), Role::Overrule), ("olga".to_owned(), Role::Open)]);
    let enrolled = |(name, role): (String, Role)| {
        let key = key_of(&instructor(&name)).public_key();
        (instructor(&name), Instructor { key, roles: Roles::up_to(role) })
    };
    let instructors = names.map(enrolled).collect();
    // Whoever works on a robot's own computer may teach.
    let local = Roles::up_to(Role::Teach);
    Membership { swarm: SWARM.to_owned(), epoch, robots, instructors, local, ..Membership::default() }
}

/// Those, enrolled: once in a process.
pub fn roster(robots: u32) -> Roster {
    static KNOWN: Mutex<BTreeMap<u32, Roster>> = Mutex::new(BTreeMap::new());
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    let signed = || members(robots, 1).sign(&authority()).expect("members that go together");
    known.entry(robots).or_insert_with(signed).clone()
}

/// An instructor of that name.
pub fn instructor(name: &str) -> InstructorId {
    name.parse().expect("a name")
}
