//! How many robots a decision needs.

use std::fmt;

use serde::de::{Error, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// How many robots a decision needs. In a configuration file: `"majority"`, or a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quorum {
    /// More than half of the robots heard lately must take part, whether or not they saw anything. Two parts of a swarm that are
    /// cut off from each other cannot both be more than half.
    Majority,
    /// So many robots must have given evidence, whoever else there is: parts that are cut off may each decide. At least 1.
    Evidence(u32),
}

/// The name of [`Quorum::Majority`] in a configuration.
const MAJORITY: &str = "majority";

impl Serialize for Quorum {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Majority => serializer.serialize_str(MAJORITY),
            Self::Evidence(robots) => serializer.serialize_u32(*robots),
        }
    }
}

impl<'de> Deserialize<'de> for Quorum {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Words;

        impl Visitor<'_> for Words {
            type Value = Quorum;

            fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(out, "\"{MAJORITY}\" or a number of robots")
            }

            fn visit_str<E: Error>(self, word: &str) -> Result<Quorum, E> {
                match word {
                    MAJORITY => Ok(Quorum::Majority),
                    other => Err(E::invalid_value(Unexpected::Str(other), &self)),
                }
            }

            fn visit_u64<E: Error>(self, robots: u64) -> Result<Quorum, E> {
                let robots = u32::try_from(robots);
                robots
                    .map(Quorum::Evidence)
                    .map_err(|_| E::invalid_value(Unexpected::Other("a greater number"), &self))
            }

            fn visit_i64<E: Error>(self, robots: i64) -> Result<Quorum, E> {
                let unsigned = u64::try_from(robots);
                unsigned
                    .map_err(|_| E::invalid_value(Unexpected::Signed(robots), &self))
                    .and_then(|n| self.visit_u64(n))
            }

            fn visit_f64<E: Error>(self, robots: f64) -> Result<Quorum, E> {
                // JSON5 has one kind of number.
                match robots.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&robots) {
                    true => Ok(Quorum::Evidence(robots as u32)),
                    false => Err(E::invalid_value(Unexpected::Float(robots), &self)),
                }
            }
        }

        deserializer.deserialize_any(Words)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_written_as_a_word_or_a_number() {
        for (text, quorum) in [("\"majority\"", Quorum::Majority), ("3", Quorum::Evidence(3))] {
            assert_eq!(serde_json::from_str::<Quorum>(text).unwrap(), quorum);
            assert_eq!(serde_json::to_string(&quorum).unwrap(), text);
        }
        assert_eq!(serde_json::from_str::<Quorum>("3.0").unwrap(), Quorum::Evidence(3));
        for text in ["\"most\"", "-1", "2.5", "5000000000", "true"] {
            let error = serde_json::from_str::<Quorum>(text).unwrap_err().to_string();
            assert!(error.contains("\"majority\" or a number of robots"), "{text}: {error}");
        }
    }
}
