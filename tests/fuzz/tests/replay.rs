//! What fuzzers met before is met again, and some more by chance. One target at a time: memory is measured for the whole program.

use std::sync::{Mutex, MutexGuard, PoisonError};

use gestalt_fuzz::{Fuzzer, Target, contradicts, corpus, passes};
use gestalt_protocol::MAX_JSON;

static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

fn alone() -> MutexGuard<'static, ()> {
    ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Tries the corpus of a target, and so many inputs more.
#[track_caller]
fn stands(target: Target, more: usize) {
    let _alone = alone();
    let known = corpus::read(&corpus::folder(target)).expect("the corpus is part of the repository");
    assert!(known.len() >= 24, "{target} has {} inputs", known.len());
    for (path, bytes) in &known {
        assert!(passes(target, bytes), "{} fails", path.display());
    }
    let mut fuzzer = Fuzzer::new(target, known.into_iter().map(|(_, bytes)| bytes).collect(), 1);
    for _ in 0..more {
        if let Err(input) = fuzzer.step() {
            let path = gestalt_fuzz::keep(&std::env::temp_dir(), target, &input).expect("a place to keep it");
            panic!(
                "{target} fails; again with: cargo run -p gestalt-fuzz --bin fuzz replay {target} {}",
                path.display()
            );
        }
    }
}

#[test]
fn a_message_reads_as_it_was_written_and_takes_no_more_memory_than_promised() {
    stands(Target::Envelope, 100_000);
}

#[test]
fn json_reads_as_it_was_written_and_takes_no_more_memory_than_promised() {
    stands(Target::Json, 100_000);
}

#[test]
fn a_roster_is_its_authoritys_and_its_members_go_together() {
    stands(Target::Roster, 30_000);
}

#[test]
fn a_decision_that_is_proven_loses_its_proof_by_any_change() {
    stands(Target::Proof, 100_000);
}

#[test]
fn a_key_has_one_spelling() {
    stands(Target::Key, 100_000);
}

#[test]
fn what_travels_beside_a_picture_reads_as_it_was_written() {
    stands(Target::Frame, 100_000);
}

#[test]
fn whatever_arrives_nobody_but_a_member_votes() {
    stands(Target::Inbox, 100_000);
}

#[test]
fn three_honest_minds_come_to_know_the_same_whatever_a_stranger_says() {
    stands(Target::Mind, 200);
}

#[test]
fn no_round_of_theirs_has_two_final_gestures() {
    stands(Target::Finals, 1000);
}

#[test]
fn what_is_final_stands_however_late_votes_are() {
    let _alone = alone();
    let known = corpus::read(&corpus::folder(Target::Mind).join("../../late/mind")).expect("a folder");
    assert!(!known.is_empty(), "nothing is known to have come late");
    for (path, bytes) in known {
        assert!(!contradicts(&bytes), "{}: two gestures are final for one round", path.display());
    }
}

#[test]
fn the_longest_json_takes_no_more_memory_than_promised() {
    let _alone = alone();
    for (before, again, after) in [
        (r#"{"say":"open","x":["#, "0,", "0]}"),
        (r#"{"say":"was","class":["#, "[],", "0]}"),
        (
            r#"{"robot":1,"at":1,"to":{"say":"open","x":["#,
            "0,",
            r#"0]},"outcome":"known","class":null,"samples":1}"#,
        ),
        (r#"{"robot":1,"name":"","vocabulary":["#, "\"\",", "0]}"),
        (r#"{"round":{"counter":1,"opener":1,"life":1},"class":["#, "0,", "0]}"),
        (r#"{"certificate":{"votes":["#, "0,", "0]}}"),
    ] {
        let times = (MAX_JSON - before.len() - after.len()) / again.len();
        let json = [before, &again.repeat(times), after].concat();
        assert!(passes(Target::Json, json.as_bytes()), "{before}…");
    }
}

#[test]
fn the_corpus_stays_small() {
    let _alone = alone();
    let all = Target::ALL.map(|target| corpus::read(&corpus::folder(target)).expect("the corpus"));
    let bytes: usize = all.iter().flatten().map(|(_, bytes)| bytes.len()).sum();
    assert!(bytes <= 1024 * 1024, "{bytes} bytes, at most a megabyte");
}

#[test]
fn the_same_seed_tries_the_same_inputs() {
    let _alone = alone();
    let tried = |seed| {
        let mut fuzzer = Fuzzer::new(Target::Key, vec![b"1".to_vec()], seed);
        (0..100).map(|_| fuzzer.step().map(|()| format!("{fuzzer:?}"))).collect::<Vec<_>>()
    };
    assert_eq!(tried(7), tried(7));
    assert_ne!(tried(7), tried(8));
}
