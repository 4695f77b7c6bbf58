//! What the swarm asks its instructor.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::bounded;
use crate::decode::DecodeError;
use crate::id::{ClassId, RobotId, RoundId, Stamp};
use crate::naming::MAX_TITLE;
use crate::signature::Signature;

/// The most gestures that a question names.
const MAX_NAMED: usize = 2;

/// More nats than this no distribution over the largest vocabulary has.
const MAX_NATS: f64 = 8.0;

/// A question of the swarm to whoever instructs it: the JSON on `question`. For example:
///
/// ```json
/// {"round": {"counter": 5, "opener": 2, "life": 1067057607}, "ask": {"kind": "between", "classes": [2, 3]},
///  "labels": ["two", "three"], "entropy": 0.68, "disagreement": 0.31,
///  "robot": 1, "stamp": {"boot": 1, "sequence": 130}, "signature": null}
/// ```
///
/// It is answered with any [`Instruction`](crate::Instruction) on its round, or not at all: then nothing is learned from it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Question {
    /// The round that it is about. It is over.
    pub round: RoundId,
    /// What is asked.
    pub ask: Ask,
    /// What the gestures that it names are called, in their order; empty where its robot has no such vocabulary.
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_NAMED>")]
    pub labels: Vec<String>,
    /// The entropy of what the votes came to together, in nats.
    pub entropy: f64,
    /// The Jensen-Shannon divergence of the votes, in nats: how much of that is robots that see different things.
    pub disagreement: f64,
    /// The robot that asks.
    pub robot: RobotId,
    /// Its stamp on it.
    pub stamp: Stamp,
    /// Its signature under the [`Envelope`](crate::Envelope) that it is; robots of an open swarm sign nothing.
    pub signature: Option<Signature>,
}

/// What is asked. In JSON an object whose field `kind` names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", try_from = "Read")]
pub enum Ask {
    /// "Two or three?", or neither of them.
    Between {
        /// The two, the likelier first.
        classes: [ClassId; 2],
    },
    /// "Show it again, nearer": all robots are as unsure, and a label would teach little.
    Again {
        /// The gesture that it is likest.
        nearest: ClassId,
    },
    /// "A new gesture? Its name?"
    Name {
        /// The gesture that it is likest, of those that were taught, if any was.
        nearest: Option<ClassId>,
    },
}

/// How an [`Ask`] is read: key by key, whichever comes first, so that nothing of any size is taken up before its tag is found.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Read {
    kind: Kind,
    #[serde(default)]
    classes: Option<[ClassId; 2]>,
    #[serde(default)]
    nearest: Option<ClassId>,
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Kind {
    Between,
    Again,
    Name,
}

impl TryFrom<Read> for Ask {
    type Error = &'static str;

    fn try_from(read: Read) -> Result<Self, &'static str> {
        match read {
            Read { kind: Kind::Between, classes: Some(classes), nearest: None } => {
                Ok(Self::Between { classes })
            }
            Read { kind: Kind::Again, classes: None, nearest: Some(nearest) } => Ok(Self::Again { nearest }),
            Read { kind: Kind::Name, classes: None, nearest } => Ok(Self::Name { nearest }),
            Read { kind: Kind::Between, .. } => Err("between has two classes beside it"),
            Read { kind: Kind::Again, .. } => Err("again has nearest beside it"),
            Read { kind: Kind::Name, .. } => Err("name has no classes beside it"),
        }
    }
}

/// What the asker signs: the message that a [`Question`] is. It travels as JSON alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Asked {
    /// The round.
    pub round: RoundId,
    /// What is asked.
    #[serde(with = "untagged")]
    pub ask: Ask,
    /// What the gestures are called.
    #[serde(deserialize_with = "bounded::vec::<_, _, MAX_NAMED>")]
    pub labels: Vec<String>,
    /// See [`Question::entropy`].
    pub entropy: f64,
    /// See [`Question::disagreement`].
    pub disagreement: f64,
}

/// An [`Ask`] where nobody reads it: what has its tag among its keys cannot be told in postcard.
mod untagged {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::Ask;
    use crate::id::ClassId;

    #[derive(Serialize, Deserialize)]
    enum Numbered {
        Between([ClassId; 2]),
        Again(ClassId),
        Name(Option<ClassId>),
    }

    pub fn serialize<S: Serializer>(ask: &Ask, serializer: S) -> Result<S::Ok, S::Error> {
        if serializer.is_human_readable() {
            return ask.serialize(serializer);
        }
        match *ask {
            Ask::Between { classes } => Numbered::Between(classes),
            Ask::Again { nearest } => Numbered::Again(nearest),
            Ask::Name { nearest } => Numbered::Name(nearest),
        }
        .serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Ask, D::Error> {
        if deserializer.is_human_readable() {
            return Ask::deserialize(deserializer);
        }
        Ok(match Numbered::deserialize(deserializer)? {
            Numbered::Between(classes) => Ask::Between { classes },
            Numbered::Again(nearest) => Ask::Again { nearest },
            Numbered::Name(nearest) => Ask::Name { nearest },
        })
    }
}

impl Ask {
    /// The gestures that it names, in the order of [`Question::labels`].
    #[must_use]
    pub fn classes(&self) -> Vec<ClassId> {
        match self {
            Self::Between { classes } => classes.to_vec(),
            Self::Again { nearest } => vec![*nearest],
            Self::Name { nearest } => nearest.iter().copied().collect(),
        }
    }

    /// The kind as it is written in JSON.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Between { .. } => "between",
            Self::Again { .. } => "again",
            Self::Name { .. } => "name",
        }
    }
}

impl Asked {
    /// Whether every value is one that a robot may say.
    ///
    /// # Errors
    /// [`DecodeError::Impossible`] names what is wrong.
    pub fn check(&self) -> Result<(), DecodeError> {
        let Self { ask, labels, entropy, disagreement, .. } = self;
        check(ask, labels, [*entropy, *disagreement])
    }
}

impl Question {
    /// Whether every value is one that a robot may say.
    ///
    /// # Errors
    /// [`DecodeError::Impossible`] names what is wrong.
    pub fn check(&self) -> Result<(), DecodeError> {
        let Self { ask, labels, entropy, disagreement, .. } = self;
        check(ask, labels, [*entropy, *disagreement])
    }

    /// What the gestures that it names are called; where it does not say, their numbers.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        if self.labels.is_empty() {
            self.ask.classes().iter().map(ToString::to_string).collect()
        } else {
            self.labels.clone()
        }
    }
}

impl fmt::Display for Question {
    /// The question in words.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = self.names();
        match (&self.ask, &names[..]) {
            (Ask::Between { .. }, [first, second]) => write!(f, "\"{first}\" or \"{second}\"?"),
            (Ask::Again { .. }, [nearest]) => {
                write!(f, "that may be \"{nearest}\": show it again, nearer")
            }
            (Ask::Name { .. }, [nearest]) => {
                write!(f, "a new gesture? its name? it is likest \"{nearest}\"")
            }
            _ => f.write_str("a new gesture? its name?"),
        }
    }
}

fn check(ask: &Ask, labels: &[String], nats: [f64; 2]) -> Result<(), DecodeError> {
    let named = ask.classes();
    if matches!(ask, Ask::Between { classes: [first, second] } if first == second) {
        return Err(DecodeError::Impossible("a question between a gesture and itself"));
    }
    if !(labels.is_empty() || labels.len() == named.len()) {
        return Err(DecodeError::Impossible("other labels than of the gestures in question"));
    }
    if !labels.iter().all(|label| (1..=MAX_TITLE).contains(&label.len())) {
        return Err(DecodeError::Impossible("a label of no gesture: 1 to 99 bytes"));
    }
    if !nats.iter().all(|nats| (0.0..=MAX_NATS).contains(nats)) {
        return Err(DecodeError::Impossible("nats that no distribution has"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decode::decode_json;
    use crate::envelope::Envelope;

    fn question(ask: Ask, labels: &[&str]) -> Question {
        Question {
            round: RoundId { counter: 5, opener: RobotId(2), life: 7 },
            ask,
            labels: labels.iter().map(|label| (*label).to_owned()).collect(),
            entropy: 0.5,
            disagreement: 0.25,
            robot: RobotId(1),
            stamp: Stamp { boot: 1, sequence: 130 },
            signature: None,
        }
    }

    #[test]
    fn it_says_in_words_what_it_asks() {
        let between = Ask::Between { classes: [ClassId(2), ClassId(3)] };
        assert_eq!(question(between, &["two", "three"]).to_string(), "\"two\" or \"three\"?");
        assert_eq!(question(between, &[]).to_string(), "\"2\" or \"3\"?");
        let again = Ask::Again { nearest: ClassId(2) };
        assert!(question(again, &["two"]).to_string().contains("\"two\": show it again"));
        assert_eq!(question(Ask::Name { nearest: None }, &[]).to_string(), "a new gesture? its name?");
        let name = question(Ask::Name { nearest: Some(ClassId(2)) }, &["two"]);
        assert!(name.to_string().contains("likest \"two\""), "{name}");
    }

    #[test]
    fn what_no_robot_may_ask_is_refused() {
        let between = Ask::Between { classes: [ClassId(2), ClassId(3)] };
        let good = question(between, &["two", "three"]);
        assert_eq!(good.check(), Ok(()));
        // Two who named gestures alike.
        let title = format!("{} ({})", "x".repeat(64), "i".repeat(32));
        assert_eq!(question(between, &["two", &title]).check(), Ok(()));
        let itself = Ask::Between { classes: [ClassId(2), ClassId(2)] };
        let long = "x".repeat(MAX_TITLE + 1);
        for bad in [
            question(itself, &[]),
            question(between, &["two"]),
            question(between, &["two", ""]),
            question(between, &["two", &long]),
            Question { entropy: f64::NAN, ..good.clone() },
            Question { disagreement: -0.1, ..good.clone() },
            Question { entropy: 9.0, ..good.clone() },
        ] {
            assert!(bad.check().is_err(), "{bad:?}");
        }
        let three = serde_json::to_string(&good).unwrap().replace("\"three\"", "\"three\",\"four\"");
        assert!(decode_json::<Question>(three.as_bytes()).is_err(), "a third label is not taken up");
        for bad in [
            r#"{"kind":"between","classes":[2]}"#,
            r#"{"kind":"between","nearest":2}"#,
            r#"{"kind":"again"}"#,
            r#"{"kind":"name","classes":[2,3]}"#,
            r#"{"kind":"name","nearest":null,"more":[]}"#,
            r#"{"kind":"why"}"#,
        ] {
            assert!(decode_json::<Ask>(bad.as_bytes()).is_err(), "{bad}");
        }
    }

    #[test]
    fn it_is_the_message_that_its_asker_signs() {
        for ask in [
            Ask::Between { classes: [ClassId(2), ClassId(3)] },
            Ask::Again { nearest: ClassId(1) },
            Ask::Name { nearest: None },
            Ask::Name { nearest: Some(ClassId(0)) },
        ] {
            let asked = question(ask, &[]);
            let envelope = Envelope::from(asked.clone());
            assert_eq!(Envelope::decode(&envelope.encode()), Ok(envelope.clone()));
            assert_eq!(Question::of(envelope), Some(asked));
        }
    }
}
