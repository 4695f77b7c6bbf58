//! Two programs check decisions, and prove the same ones: `gestalt verify`, and examples/verify.py, which shares no line with it.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use gestalt_peer::proof;
use gestalt_protocol::{Announcement, ClassId, Envelope, FusionRule, Pool, RobotId, Stamp};
use gestalt_strategies::{MindConfig, Quorum};
use gestalt_trials::Need;
use gestalt_trust::statement;
use serde_json::json;

use crate::announced::{decided, key, roster, rounds};
use crate::respelling::respelt;

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
        let MindConfig { rule, liars, clip, committee, quorum, .. } = self.rounds;
        let mut words = vec![
            format!("--rule={rule}"),
            format!("--liars={liars}"),
            format!("--clip={clip}"),
            format!("--committee={committee}"),
            format!("--robots={}", self.robots),
        ];
        if let Quorum::Evidence(quorum) = quorum {
            words.push(format!("--quorum={quorum}"));
        }
        words.extend(self.rounds.alpha.map(|alpha| format!("--alpha={alpha}")));
        words
    }

    fn by_gestalt(&self) -> Result<(), String> {
        let roster = proof::read_roster(&self.roster).map_err(|error| error.to_string())?;
        let announced = proof::read(&self.decision).map_err(|error| error.to_string())?;
        proof::check(&announced, &roster, &self.rounds, self.robots).map_err(|error| error.to_string())
    }
}

/// What verify.py says of them.
fn by_python(files: &[File]) -> Vec<(bool, String)> {
    let python = gestalt_trials::python(Need::CRYPTOGRAPHY).expect("what the trial needs");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("swarm/verdicts.py");
    let mut child =
        Command::new(python).arg(script).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
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
    said.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[track_caller]
fn alike(files: &[File]) -> Vec<(bool, String)> {
    let by_gestalt: Vec<Result<(), String>> = files.iter().map(File::by_gestalt).collect();
    let mut apart = Vec::new();
    for (n, (proven, said)) in by_python(files).into_iter().enumerate() {
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

pub fn a_line_of_watch_is_its_decision_to_both_programs() {
    let rounds = rounds(1);
    let announced = decided(1, &rounds);
    let file = File::new(&announced, &rounds);
    let line = json!({"event": "decision", "decision": &announced}).to_string();
    let of = |text: String| File { decision: text.into_bytes(), ..file.clone() };
    let spoilt = [
        line.replacen("decision", "decisioN", 1),
        line.replace("\"event\":\"decision\"", "\"event\":\"question\""),
        line.replace("\"event\":", "\"seen\":7,\"event\":"),
        format!("{{\"decision\":{line},\"event\":\"decision\"}}"),
    ];
    let same = [line.clone(), line.clone() + "\n", format!(" \t{line}\r\n")];
    // What other readers take for space.
    let around = ["\u{b}", "\u{c}", "\u{85}", "\u{a0}", "\u{2028}"];
    let around = around.iter().flat_map(|space| [format!("{space}{line}"), format!("{line}{space}")]);
    let files: Vec<File> = same.into_iter().chain(spoilt).chain(around).map(of).collect();
    let proven: Vec<bool> = alike(&files).into_iter().map(|(proven, _)| proven).collect();
    assert_eq!(proven[..3], [true; 3]);
    assert_eq!(proven[3..], [false; 14]);
}

/// The same announcement, as member 2 signs it after it was changed.
fn signed_anew(announced: &Announcement, change: impl Fn(&mut Announcement)) -> Announcement {
    let mut changed = announced.clone();
    (changed.announcer, changed.stamp) = (RobotId(2), Stamp { boot: 9, sequence: 9 });
    change(&mut changed);
    let said = Envelope::from(changed.clone()).statement();
    let signature = Some(statement::sign(&key(2), &roster().swarm_id(), &said));
    Announcement { signature, ..changed }
}

/// What somebody makes of an announcement.
type Change = fn(&mut Announcement);

/// What a member can make of a decision, with its own key.
const OWN: [(&str, Change); 40] = [
    ("nothing", |_| {}),
    ("a final one", |d| d.decision.is_final = true),
    ("of another author", |d| d.decision.author = RobotId(9)),
    ("a round of another opener", |d| d.decision.round.opener = RobotId(9)),
    ("another round", |d| d.decision.round.counter += 1),
    ("no class", |d| d.decision.class = None),
    ("class 0", |d| d.decision.class = Some(ClassId(0))),
    ("a class beyond the list", |d| d.decision.class = Some(ClassId(64))),
    ("surer", |d| d.decision.confidence = 0.99),
    ("a little surer", |d| d.decision.confidence = (d.decision.confidence + 1e-6).min(1.0)),
    ("surer in a digit that platforms differ in", |d| {
        d.decision.confidence = (d.decision.confidence - 1e-12).max(0.0);
    }),
    ("impossibly sure", |d| d.decision.confidence = 1.5),
    ("other probabilities", |d| {
        if let Some(p) = d.decision.certificate.probabilities.first_mut() {
            *p = 1.0 - *p;
        }
    }),
    ("a probability less", |d| d.decision.certificate.probabilities.truncate(1)),
    ("another probability of unknown", |d| d.decision.certificate.unknown = Some(0.25)),
    ("none of unknown", |d| d.decision.certificate.unknown = None),
    ("a vote for another class", |d| {
        if let Some(counted) = d.decision.certificate.votes.first_mut() {
            counted.class = ClassId((counted.class.0 + 1) % 4);
        }
    }),
    ("a vote of another weight", |d| {
        if let Some(counted) = d.decision.certificate.votes.first_mut() {
            counted.weight += 0.5;
        }
    }),
    ("a vote of a negative weight", |d| {
        if let Some(counted) = d.decision.certificate.votes.first_mut() {
            counted.weight = -1.0;
        }
    }),
    ("votes out of order", |d| d.decision.certificate.votes.reverse()),
    ("a vote less", |d| drop(d.decision.certificate.votes.pop())),
    ("no votes", |d| d.decision.certificate.votes.clear()),
    ("a vote twice", |d| {
        let twice = d.decision.certificate.votes.first().cloned();
        d.decision.certificate.votes.extend(twice);
    }),
    ("a vote aside", |d| {
        let aside = d.decision.certificate.votes.pop();
        d.decision.certificate.others.extend(aside.map(|counted| counted.held()));
        d.decision.certificate.others.sort_by_key(|held| held.robot);
    }),
    ("a vote unsigned", |d| {
        if let Some(counted) = d.decision.certificate.votes.last_mut() {
            counted.signature = None;
        }
    }),
    ("gestures that nobody named", |d| d.decision.certificate.named.push(ClassId(1 << 27))),
    ("no named gestures", |d| d.decision.certificate.named.clear()),
    ("of one robot", |d| (d.decision.certificate.robots, d.decision.certificate.quorum) = (1, 1)),
    ("of twenty robots", |d| (d.decision.certificate.robots, d.decision.certificate.quorum) = (20, 11)),
    ("another quorum", |d| d.decision.certificate.quorum += 1),
    ("another list", |d| d.decision.certificate.vocabulary.0 ^= 1),
    ("another rule", |d| {
        d.decision.certificate.rule = FusionRule::MeanProbability;
        d.decision.certificate.pool = None;
    }),
    ("a pool", |d| d.decision.certificate.pool = Some(Pool { rounds: 64, ..Pool::PRIOR })),
    ("another pool", |d| {
        d.decision.certificate.pool = Some(Pool { likeness: 0.05, temperature: 0.5, rounds: 64 });
    }),
    ("a pool between the steps", |d| {
        d.decision.certificate.pool = Some(Pool { likeness: 0.512, ..Pool::PRIOR });
    }),
    ("other terms", |d| d.decision.certificate.terms.alpha = 0.4),
    ("no label", |d| d.label = None),
    ("a label of 99 bytes", |d| d.label = Some("é".repeat(49) + "e")),
    ("a label of 100 bytes", |d| d.label = Some("é".repeat(50))),
    ("another label", |d| d.label = Some("stop \u{0}\u{2028}\u{1F44B}".to_owned())),
];

pub fn what_a_member_makes_of_a_decision_both_programs_judge_alike() {
    let (mut files, mut sure, mut unsure) = (Vec::new(), [0; 5], [0; 5]);
    for seed in 1000.. {
        let rounds = rounds(seed);
        let announced = decided(seed, &rounds);
        // Two decisions of each rule, and two without one.
        let rule = seed as usize % 5;
        let so_far = if announced.decision.class.is_some() { &mut sure } else { &mut unsure };
        so_far[rule] += 1;
        if so_far[rule] <= 2 {
            for (what, change) in OWN {
                let file = File::new(&signed_anew(&announced, change), &rounds);
                files.push(File { what: format!("{what}: {}", file.what), robots: seed as u32 % 4, ..file });
            }
        }
        if sure.iter().all(|n| *n >= 2) && unsure.iter().skip(2).all(|n| *n >= 2) || seed > 1400 {
            break;
        }
    }
    assert!(sure.iter().chain(&unsure[2..]).all(|n| *n >= 2), "{sure:?} {unsure:?}");
    let verdicts = alike(&files);
    let proven = files.iter().zip(&verdicts).filter(|(_, (proven, _))| *proven);
    let proven: Vec<&str> = proven.map(|(file, _)| file.what.as_str()).collect();
    println!("{} of {} are proven", proven.len(), files.len());
    for lie in [
        "surer:",
        "a vote for another class:",
        "a vote of another weight:",
        "votes out of order:",
        "another rule: c",
        "a label of 100 bytes:",
    ] {
        assert!(!proven.iter().any(|what| what.starts_with(lie)), "{proven:?}");
    }
    assert!(proven.iter().any(|what| what.starts_with("of another author")), "{proven:?}");
    assert!(proven.iter().any(|what| what.starts_with("a label of 99 bytes")), "{proven:?}");
}

pub fn a_number_in_other_digits_both_programs_judge_alike() {
    // Between two 32-bit floats, where 64 bits first say another one than all digits.
    let (step, low) = (1_u128 << 40, (1_u128 << 63) + (2 << 40));
    let between = low + step / 2 + 1;
    let mut files = Vec::new();
    for signed in [low, low + step] {
        let rounds = rounds(1);
        let mut announced = decided(1, &rounds);
        let counted = &mut announced.decision.certificate.votes[0];
        let huge = -(signed as f32);
        counted.vote.evidence[1] = huge;
        let said = Envelope::from(counted.held()).statement();
        counted.signature = Some(statement::sign(&key(counted.robot.0 as u8), &roster().swarm_id(), &said));
        let file = File::new(&signed_anew(&announced, |_| {}), &rounds);
        let text = String::from_utf8(file.decision.clone()).unwrap();
        let written = serde_json::to_string(&huge).unwrap();
        assert_eq!(text.matches(&written).count(), 1, "{written} in {text}");
        for digits in [written.clone(), format!("-{between}"), format!("-{between}.0"), format!("-{signed}")]
        {
            let decision = text.replace(&written, &digits).into_bytes();
            files.push(File { what: format!("{digits} for {signed}"), decision, ..file.clone() });
        }
    }
    // Not whether it follows, which it need not: whether it is what was signed.
    let is_forged = |said: &str| said.contains("signature");
    let by_gestalt: Vec<bool> =
        files.iter().map(|file| file.by_gestalt().is_err_and(|why| is_forged(&why))).collect();
    for ((file, here), (_, said)) in files.iter().zip(&by_gestalt).zip(by_python(&files)) {
        assert_eq!(*here, is_forged(&said), "{}: {said}", file.what);
    }
    assert!(by_gestalt.contains(&true) && by_gestalt.contains(&false), "{by_gestalt:?}");
}

pub fn a_file_in_other_words_both_programs_judge_alike() {
    let (mut files, mut rosters) = (Vec::new(), 0);
    for seed in [1, 2, 3, 4, 9] {
        let rounds = rounds(seed);
        let file = File::new(&decided(seed, &rounds), &rounds);
        let text = String::from_utf8(file.decision.clone()).unwrap();
        for (what, decision) in respelt(&text) {
            files.push(File { what: format!("{what}: {}", file.what), decision, ..file.clone() });
        }
        let roster = String::from_utf8(file.roster.clone()).unwrap();
        let one = roster.split_once("\"1\": \"").unwrap().1.split_once('"').unwrap().0.to_owned();
        let changed = [
            roster.replacen('{', "{\"more\": 1,", 1),
            roster.replacen("\"epoch\": 1", "\"epoch\": 1, \"epoch\": 1", 1),
            roster.replacen("\"epoch\": 1", "\"epoch\": 1.0", 1),
            roster.replacen("\"instructors\": {},", "", 1),
            roster.replacen("\"local\": [],", "", 1),
            roster.replacen("\"1\": \"", "\"01\": \"", 1),
            roster.replacen("\"1\": \"", "\"8\": \"", 1),
            roster.replacen("\"1\": \"", "\"\\u0031\": \"", 1),
            roster.replacen("\"1\": \"", "\"\\u0030\\u0031\": \"", 1),
            roster.replacen(&one, &one.to_uppercase(), 1),
            roster.replacen("\"demo\"", "\"demo2\"", 1),
            roster.clone() + &" ".repeat(512 << 10),
            String::new(),
        ];
        for (n, roster) in changed.into_iter().enumerate() {
            rosters += 1;
            files.push(File { what: format!("roster {n}"), roster: roster.into_bytes(), ..file.clone() });
        }
    }
    let verdicts = alike(&files);
    let proven: Vec<&str> = files
        .iter()
        .zip(&verdicts)
        .filter(|(_, (proven, _))| *proven)
        .map(|(file, _)| file.what.as_str())
        .collect();
    println!("{} of {} files are proven, {rosters} by other rosters", proven.len(), files.len());
    let is_proven = |what: &str| proven.iter().any(|proven| proven.starts_with(what));
    for same in
        ["itself", "with more space", "its names written otherwise", "all digits", "digits that are nobody's"]
    {
        assert!(is_proven(same), "{same} in {proven:?}");
    }
    for other in [
        "a class before it",
        "its class twice",
        "a field more",
        "no terms",
        "digits in upper case",
        "1 for true",
        "two million",
    ] {
        assert!(!is_proven(other), "{other} in {proven:?}");
    }
}
