//! What clients write and read.

use std::fmt::Debug;

use gestalt_protocol::{Announcement, Answer, Decision, Envelope, Holding, Instruction, Status, decode_json};
use gestalt_trust::Evidence;
use serde_json::to_vec;

use crate::memory::bounded;

/// What is read is written so that it reads the same.
///
/// # Panics
/// If not.
pub fn run(bytes: &[u8]) {
    if let Ok(instruction) = bounded(bytes, || decode_json::<Instruction>(bytes)) {
        survives(&instruction);
    }
    if let Ok(answer) = bounded(bytes, || decode_json::<Answer>(bytes)) {
        survives(&answer);
    }
    if let Ok(announcement) = bounded(bytes, || decode_json::<Announcement>(bytes))
        && announcement.check().is_ok()
    {
        survives(&announcement);
        // Who signed it signed the same bytes.
        let again = decode_json::<Announcement>(&json(&announcement)).map(Envelope::from);
        assert_eq!(again.map(|again| again.statement()), Ok(Envelope::from(announcement).statement()));
    }
    if let Ok(decision) = bounded(bytes, || decode_json::<Decision>(bytes)) {
        // JSON has no infinity to write: a decision that is none is not written.
        if decision.check().is_ok() {
            survives(&decision);
            let (rank, again) = (decision.rank(), decode_json::<Decision>(&json(&decision)));
            assert_eq!(again.map(|again| again.rank()), Ok(rank), "two copies rank alike");
        }
    }
    if let Ok(holding) = bounded(bytes, || decode_json::<Holding>(bytes))
        && holding.rank.looks.is_finite()
        && holding.rank.confidence.is_finite()
    {
        survives(&holding);
    }
    if let Ok(status) = bounded(bytes, || decode_json::<Status>(bytes)) {
        let camera = &status.camera;
        let numbers = [
            camera.fps,
            camera.delay_ms,
            camera.motion.map_or(0.0, |motion| motion.delay_ms),
            camera.opinion.as_ref().map_or(0.0, |opinion| opinion.probability),
        ];
        if numbers.iter().all(|number| number.is_finite()) {
            survives(&status);
        }
    }
    if let Ok(evidence) = bounded(bytes, || decode_json::<Evidence>(bytes)) {
        survives(&evidence);
    }
}

fn json(value: &impl serde::Serialize) -> Vec<u8> {
    to_vec(value).expect("it is JSON")
}

fn survives<T: serde::Serialize + serde::de::DeserializeOwned + PartialEq + Debug>(value: &T) {
    let written = json(value);
    let read = decode_json::<T>(&written);
    assert_eq!(read.as_ref(), Ok(value), "{}", String::from_utf8_lossy(&written));
}
