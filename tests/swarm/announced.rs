//! What emulated robots decide and announce, signed, for whoever checks it.

use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{Announcement, ClassId, FusionRule, RobotId, Signature};
use gestalt_strategies::{
    Classify, ClassifyError, Input, Life, Mind, MindConfig, Observation, Output, Sign, Vocabulary,
};
use gestalt_trust::{Identity, Membership, Roster, SwarmId, statement};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// How many gestures are on the list.
const LISTED: usize = 4;

/// The features are its probabilities: of the gestures of the list, of one that was named since, and of unknown.
#[derive(Debug)]
struct Verbatim {
    vocabulary: Vocabulary,
    tells: bool,
}

impl Classify for Verbatim {
    fn vocabulary(&self) -> &Vocabulary {
        &self.vocabulary
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        Ok(features[..self.vocabulary.classes()].iter().map(|p| f64::from(*p)).collect())
    }

    fn unknown(&self, features: &[f32]) -> Option<f64> {
        self.tells.then(|| f64::from(features[LISTED + 1]))
    }
}

#[derive(Debug)]
struct Signer(Identity, SwarmId);

impl Sign for Signer {
    fn sign(&self, words: &[u8]) -> Signature {
        statement::sign(&self.0, &self.1, words)
    }
}

pub fn key(robot: u8) -> Identity {
    Identity::from_bytes(&[robot; 32])
}

pub fn roster() -> Roster {
    let robots = (1..=7).map(|k| (RobotId(u32::from(k)), key(k).public_key())).collect();
    let members = Membership { swarm: "demo".to_owned(), epoch: 1, robots, ..Membership::default() };
    members.sign(&key(99)).unwrap()
}

fn uniform(rng: &mut ChaCha8Rng, low: f32, high: f32) -> f32 {
    low + (high - low) * (rng.next_u32() as f32 / u32::MAX as f32)
}

/// What a robot makes of what it sees: the likelier the more it knows, and of what it was not taught as of unknown.
fn seen(rng: &mut ChaCha8Rng, shown: usize) -> Vec<f32> {
    let sure = 30.0 * uniform(rng, 0.0, 1.0).powi(2);
    let mut features: Vec<f32> = (0..LISTED + 2).map(|_| uniform(rng, 0.02, 0.4)).collect();
    features[shown] += sure;
    if rng.next_u32().is_multiple_of(3) {
        let untaught = (shown + 1 + rng.next_u32() as usize % (LISTED - 1)) % LISTED;
        features[untaught] = features[LISTED + 1];
    }
    let sum: f32 = features[..=LISTED].iter().sum();
    features.iter().map(|p| p / sum).collect()
}

/// What robots decide that are all there, and sign what they say.
pub fn decided(seed: u64, rounds: &MindConfig) -> Announcement {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let n = 3 + (rng.next_u32() % 5) as usize;
    let (shown, ms) = (rng.next_u32() as usize % (LISTED + 1), Duration::from_millis);
    let alive: Arc<_> = Arc::new((1..=n as u32).map(RobotId).collect());
    let named = ClassId::named(&"ana".parse().unwrap(), "circle");
    let [some_tell, some_name] = [rng.next_u32() % 4 > 0, rng.next_u32().is_multiple_of(3)];
    let mut due: Vec<(usize, Input)> = Vec::new();
    let mut minds: Vec<Mind> = Vec::new();
    for k in 0..n {
        let life = Life { boot: 1 + rng.next_u32() % 1000, nonce: rng.next_u32() };
        let signer = Signer(key(k as u8 + 1), roster().swarm_id());
        minds.push(
            Mind::new(RobotId(k as u32 + 1), life, rounds.clone()).unwrap().signed_by(Arc::new(signer)),
        );
        let mut vocabulary = Vocabulary::new(["a", "b", "c", "d"]).unwrap();
        if some_name && !rng.next_u32().is_multiple_of(3) {
            vocabulary.meet(named);
        }
        let tells = some_tell && !rng.next_u32().is_multiple_of(4);
        let classifier = Verbatim { vocabulary, tells };
        due.push((k, Input::Learned(Arc::new(classifier))));
        due.push((k, Input::Alive(Arc::clone(&alive))));
        due.push((k, Input::Open));
    }
    for k in 0..n {
        let looks = if n > 3 && rng.next_u32().is_multiple_of(6) { 0 } else { 1 + rng.next_u32() % 2 };
        for _ in 0..looks {
            let features = seen(&mut rng, shown);
            let quality = uniform(&mut rng, 0.3, 1.0);
            due.push((k, Input::Observed(Observation { features, quality })));
        }
    }
    for step in 1..2000 {
        for (k, input) in std::mem::take(&mut due).into_iter().chain((0..n).map(|k| (k, Input::Tick))) {
            for output in minds[k].handle(ms(5 * step), input) {
                match output {
                    Output::Broadcast(said) => {
                        due.extend((0..n).filter(|j| *j != k).map(|j| (j, Input::Received(said.clone()))));
                    }
                    Output::Announce(announced) => return announced,
                    _ => {}
                }
            }
        }
    }
    panic!("nothing was announced");
}

/// The rounds of a swarm: of each rule in turn, some of which expect a liar.
pub fn rounds(seed: u64) -> MindConfig {
    let rule = FusionRule::ALL[seed as usize % FusionRule::ALL.len()];
    let liars = u32::from(seed % 7 == 6);
    MindConfig { rule, liars, deadline: Duration::from_secs(2), ..MindConfig::default() }
}
