//! Keys and names.

use gestalt_protocol::{InstructorId, Keys, RobotId, RoundId, RuleName, Signature};
use gestalt_trust::PublicKey;

use crate::memory::bounded;

/// A key has one spelling, and so has every name but that of a round; what is about our swarm is below its prefix.
///
/// # Panics
/// If not.
pub fn run(bytes: &[u8]) {
    let Ok(text) = str::from_utf8(bytes) else { return };
    let keys = Keys::new("demo").expect("a name");
    if let Some(topic) = bounded(bytes, || keys.parse(text)) {
        assert_eq!(keys.key(&topic), text);
        assert!(text.starts_with("gestalt/demo/") && !text.contains(['*', '$', '#', '?']));
        assert_eq!(Keys::new("demo2").expect("a name").parse(text), None, "one swarm's");
    }
    if let Ok(keys) = bounded(bytes, || Keys::new(text)) {
        let all = keys.every_robot("vote");
        assert_eq!(all.split('/').collect::<Vec<_>>(), ["gestalt", text, "robot", "*", "vote"]);
    }
    if let Ok(robot) = bounded(bytes, || text.parse::<RobotId>()) {
        assert_eq!(robot.to_string(), text);
    }
    if let Ok(name) = bounded(bytes, || text.parse::<InstructorId>()) {
        assert_eq!(name.to_string(), text);
        assert!(!text.contains(['/', '*', '$']));
    }
    if let Ok(rule) = bounded(bytes, || text.parse::<RuleName>()) {
        assert_eq!(rule.to_string(), text);
    }
    if let Ok(round) = bounded(bytes, || text.parse::<RoundId>()) {
        assert_eq!(round.to_string().parse(), Ok(round));
    }
    if let Ok(key) = bounded(bytes, || text.parse::<PublicKey>()) {
        assert_eq!(key.to_string(), text);
    }
    if let Ok(signature) = bounded(bytes, || text.parse::<Signature>()) {
        assert_eq!(signature.to_string(), text);
    }
}
