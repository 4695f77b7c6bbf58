//! What a mind is told at its start.

use gestalt_protocol::RobotId;
use gestalt_strategies::{LearningConfig, Life, MindConfig, Vocabulary, streams};
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;

use crate::error::MindError;

/// The longest settings that are read, in bytes.
pub const MAX_SETTINGS: usize = 1024 * 1024;

/// What a mind is told at its start, as JSON. For example, where `rounds` and `learning` are as in a robot's configuration:
///
/// ```json
/// {"robot": 1, "boot": 1, "seed": 42, "swarm": "demo", "vocabulary": ["left", "right"], "rounds": {"deadline": "8s"}}
/// ```
///
/// | key | default | meaning |
/// |---|---|---|
/// | `robot` | | its number, unique in the swarm |
/// | `boot` | | grows at every start of this robot, or its votes are taken for old ones |
/// | `seed` | | where chance comes from. In the field a number drawn at every start; in a simulator the run's, the same for all robots |
/// | `swarm` | `"gestalt"` | the swarm's name: its messages are under `gestalt/<swarm>/` |
/// | `vocabulary` | none | the gestures, for a host that observes probabilities; with a model, the model says them |
/// | `rounds` | `{}` | how the robot takes part in rounds: [`MindConfig`] |
/// | `learning` | none | how it learns: [`LearningConfig`]; needs a model, whose feature space it learns in |
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Its number, unique in the swarm.
    pub robot: RobotId,
    /// Grows at every start.
    pub boot: u32,
    /// Where chance comes from.
    pub seed: u64,
    /// The swarm's name.
    #[serde(default = "default_swarm")]
    pub swarm: String,
    /// The gestures, for a host that observes probabilities.
    #[serde(default)]
    pub vocabulary: Option<Vocabulary>,
    /// How the robot takes part in rounds.
    #[serde(default)]
    pub rounds: MindConfig,
    /// How it learns; `None` for a robot that does not.
    #[serde(default)]
    pub learning: Option<LearningConfig>,
}

fn default_swarm() -> String {
    "gestalt".to_owned()
}

impl Settings {
    /// Reads settings.
    ///
    /// # Errors
    /// [`MindError::Settings`] names the key, or the place, that is wrong.
    pub fn parse(json: &[u8]) -> Result<Self, MindError> {
        if json.len() > MAX_SETTINGS {
            return Err(MindError::Settings(format!(
                "{} bytes, at most {MAX_SETTINGS} are read",
                json.len()
            )));
        }
        serde_json::from_slice(json).map_err(|error| MindError::Settings(error.to_string()))
    }

    /// The generator by which this robot shares and forgets in this life: no other robot, and no other start, has its stream.
    pub(crate) fn rng(&self) -> ChaCha8Rng {
        streams::learning(self.seed, self.robot, self.boot)
    }

    /// The robot's life.
    pub(crate) fn life(&self) -> Life {
        streams::life(self.seed, self.robot, self.boot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_out_is_the_default_and_what_is_misspelt_is_named() {
        let settings = Settings::parse(br#"{"robot": 3, "boot": 1, "seed": 7}"#).unwrap();
        assert_eq!((settings.swarm.as_str(), &settings.rounds), ("gestalt", &MindConfig::default()));
        for (json, named) in [
            (r#"{"boot": 1, "seed": 7}"#, "robot"),
            (r#"{"robot": 3, "boot": 1, "seed": 7, "round": {}}"#, "round"),
            (r#"{"robot": 3, "boot": 1, "seed": 7, "rounds": {"deadline": 5}}"#, "5"),
            (r#"{"robot": 3, "boot": 1, "seed": 7, "vocabulary": ["one"]}"#, "at least 2"),
        ] {
            let error = Settings::parse(json.as_bytes()).unwrap_err().to_string();
            assert!(error.contains(named), "{error}");
        }
        assert!(Settings::parse(&vec![b' '; MAX_SETTINGS + 1]).is_err());
    }

    #[test]
    fn no_two_robots_and_no_two_starts_have_one_life() {
        let life = |robot, boot| {
            let json = format!(r#"{{"robot": {robot}, "boot": {boot}, "seed": 7}}"#);
            Settings::parse(json.as_bytes()).unwrap().life().nonce
        };
        let lives = [life(1, 1), life(1, 2), life(2, 1), life(2, 2)];
        assert_eq!(lives[0], life(1, 1));
        assert!((1..4).all(|i| !lives[..i].contains(&lives[i])), "{lives:?}");
    }
}
