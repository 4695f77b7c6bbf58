//! Two programs check decisions, and prove the same ones: `gestalt verify`, and examples/verify.py, which shares no line with it.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use gestalt_peer::proof;
use gestalt_protocol::{Announcement, ClassId, FusionRule, RobotId, Signature, decode_json};
use gestalt_strategies::{
    Classify, ClassifyError, Input, Life, Mind, MindConfig, Observation, Output, Sign, Vocabulary,
};
use gestalt_trust::{Identity, Membership, Roster, SwarmId, statement};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde_json::json;

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

fn key(robot: u8) -> Identity {
    Identity::from_bytes(&[robot; 32])
}

fn roster() -> Roster {
    let robots = (1..=7).map(|k| (RobotId(u32::from(k)), key(k).public_key())).collect();
    let members = Membership { swarm: "demo".to_owned(), epoch: 1, robots, ..Membership::default() };
    members.sign(&key(99)).unwrap()
}

/// What is to be checked, and the rounds of its swarm.
#[derive(Clone)]
struct File {
    what: String,
    decision: Vec<u8>,
    roster: Vec<u8>,
    rounds: MindConfig,
    robots: u32,
}

impl File {
    fn new(announced: &Announcement, rounds: &MindConfig) -> Self {
        // As a robot says it: the shortest digits that are read as the same number.
        let decision = serde_json::to_vec(announced).unwrap();
        let roster = roster().to_json().into_bytes();
        let what = format!("{} of {} robots", rounds.rule, announced.decision.certificate.robots);
        Self { what, decision, roster, rounds: rounds.clone(), robots: 1 }
    }

    /// What verify.py is told of the rounds.
    fn words(&self) -> Vec<String> {
        let MindConfig { liars, clip, .. } = self.rounds;
        let mut words =
            vec![format!("--liars={liars}"), format!("--clip={clip}"), format!("--robots={}", self.robots)];
        words.extend(self.rounds.alpha.map(|alpha| format!("--alpha={alpha}")));
        words
    }

    fn by_gestalt(&self) -> Result<(), String> {
        let roster = Roster::parse(&self.roster).map_err(|error| error.to_string())?;
        let announced = decode_json(&self.decision).map_err(|error| error.to_string())?;
        proof::check(&announced, &roster, &self.rounds, self.robots).map_err(|error| error.to_string())
    }
}

/// What verify.py says of them; `None` where it cannot run.
fn by_python(files: &[File]) -> Option<Vec<(bool, String)>> {
    let python = Command::new("python3").args(["-c", "import cryptography"]).stderr(Stdio::null()).status();
    if !python.is_ok_and(|status| status.success()) {
        eprintln!("skipped: verify.py: python3 has no package cryptography");
        return None;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("swarm/verdicts.py");
    let mut child =
        Command::new("python3").arg(script).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let lines: Vec<String> = files
        .iter()
        .map(|file| {
            json!({"decision": file.decision, "roster": file.roster, "words": file.words()}).to_string()
                + "\n"
        })
        .collect();
    let writer =
        std::thread::spawn(move || lines.iter().try_for_each(|line| stdin.write_all(line.as_bytes())));
    let ran = child.wait_with_output().unwrap();
    writer.join().unwrap().unwrap();
    let said = String::from_utf8(ran.stdout).unwrap();
    Some(said.lines().map(|line| serde_json::from_str(line).unwrap()).collect())
}

fn uniform(rng: &mut ChaCha8Rng, low: f32, high: f32) -> f32 {
    low + (high - low) * (rng.next_u32() as f32 / u32::MAX as f32)
}

/// What a robot makes of what it sees: the likelier the more it knows, and of what it was not taught as of unknown.
fn seen(rng: &mut ChaCha8Rng, shown: usize) -> Vec<f32> {
    let sure = uniform(rng, 0.0, 4.0);
    let mut features: Vec<f32> = (0..LISTED + 2).map(|_| uniform(rng, 0.1, 1.0)).collect();
    features[shown] += sure;
    if rng.next_u32().is_multiple_of(3) {
        let untaught = rng.next_u32() as usize % LISTED;
        features[untaught] = features[LISTED + 1];
    }
    let sum: f32 = features[..=LISTED].iter().sum();
    features.iter().map(|p| p / sum).collect()
}

/// What robots decide that are all there, and sign what they say.
fn decided(seed: u64, rounds: &MindConfig) -> Announcement {
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
fn rounds(seed: u64) -> MindConfig {
    let rule = FusionRule::ALL[seed as usize % FusionRule::ALL.len()];
    let liars = u32::from(seed % 7 == 6);
    MindConfig { rule, liars, deadline: Duration::from_secs(2), ..MindConfig::default() }
}

#[track_caller]
fn alike(files: &[File]) -> Vec<(bool, String)> {
    let by_gestalt: Vec<Result<(), String>> = files.iter().map(File::by_gestalt).collect();
    let mut apart = Vec::new();
    for (n, (proven, said)) in by_python(files).into_iter().flatten().enumerate() {
        if proven != by_gestalt[n].is_ok() || said.contains("Traceback") {
            apart.push(format!(
                "{}: {:?}, {said}: {}",
                files[n].what,
                by_gestalt[n],
                String::from_utf8_lossy(&files[n].decision)
            ));
        }
    }
    assert!(apart.is_empty(), "{} of {} apart:\n{}", apart.len(), files.len(), apart.join("\n"));
    by_gestalt.into_iter().map(|proven| (proven.is_ok(), proven.err().unwrap_or_default())).collect()
}

pub fn what_robots_decide_both_programs_prove_as_it_was_published() {
    let (mut files, mut near, mut undecided) = (Vec::new(), 0, 0);
    for seed in 0..160 {
        let rounds = rounds(seed);
        let announced = decided(seed, &rounds);
        near += usize::from((0.95..0.99).contains(&announced.decision.confidence));
        undecided += usize::from(announced.decision.class.is_none());
        files.push(File::new(&announced, &rounds));
    }
    println!("{near} with .95 to .99, {undecided} undecided");
    assert!(near >= 10 && undecided >= 10, "{near} {undecided}");
    for (file, (proven, why)) in files.iter().zip(alike(&files)) {
        assert!(proven, "{}: {why}: {}", file.what, String::from_utf8_lossy(&file.decision));
    }
}
