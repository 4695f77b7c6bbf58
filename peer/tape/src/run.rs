//! What happened in a recorded run: its rounds, with their votes, their decisions, and what people said of them.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use gestalt_protocol::{
    Announcement, Answer, ClassId, Decision, Envelope, Gesture, HeldVote, Instruction, InstructorId, Keys,
    Message, RobotId, RoundId, Status, Topic, VocabularyId, decode_json,
};
use gestalt_rounds::{Quorum, RoundsConfig, Vocabulary};
use serde_json::Value;

use crate::kind::Kind;
use crate::ledger::Tally;
use crate::reader::Recorded;
use crate::view::wire;
use crate::words::Words;

/// The key of the metadata that names the swarm.
pub const SWARM: &str = "swarm";

/// The key of the metadata that holds the rounds of the swarm's robots, as JSON.
pub const ROUNDS: &str = "rounds";

/// Rounds of the same count that begin further apart are no longer one showing, nor are those of one robot in two lives: counts begin anew when all
/// robots were switched off.
const ONE_SHOWING: Duration = Duration::from_secs(60);

/// A recorded run.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// The showings, in the order in which they were heard of.
    pub showings: Vec<Showing>,
    /// How many messages of each kind there are.
    pub messages: Tally,
    /// Messages that are of another form than recorders write.
    pub strange: u64,
    /// Of the swarm that the first channel names.
    keys: Option<Keys>,
    vocabularies: BTreeMap<u32, Vocabulary>,
    by_round: BTreeMap<RoundId, usize>,
}

/// One showing of a gesture. Rounds that were opened at the same time and merged are one.
#[derive(Clone, Debug, Default)]
pub struct Showing {
    /// Under which names.
    pub rounds: BTreeSet<RoundId>,
    /// When it was first heard of, in nanoseconds since 1970.
    pub opened: u64,
    /// The votes as they were heard: when, and which.
    pub votes: Vec<(u64, HeldVote)>,
    /// What was announced.
    pub announced: Vec<Decision>,
    /// What each instructor said of it.
    pub words: BTreeMap<InstructorId, Words>,
}

/// What people said that a gesture was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Truth {
    /// This one.
    Is(ClassId),
    /// Any but this one.
    IsNot(ClassId),
}

impl Showing {
    /// The name that it ended under: that of its greatest decision, or else its smallest.
    #[must_use]
    pub fn name(&self) -> Option<RoundId> {
        self.decision().map(|decision| decision.round).or_else(|| self.rounds.first().copied())
    }

    /// What the swarm decided: the greatest decision announced, which wins everywhere.
    #[must_use]
    pub fn decision(&self) -> Option<&Decision> {
        self.announced.iter().max_by_key(|decision| decision.rank())
    }
}

impl Run {
    /// Takes in one message of a recording; those of a second swarm count as strange.
    pub fn add(&mut self, recorded: &Recorded<'_>) {
        *self.messages.entry(recorded.kind).or_default() += 1;
        let matters = matches!(
            recorded.kind,
            Kind::Vote | Kind::Decision | Kind::Feedback | Kind::Answer | Kind::Status
        );
        if !matters {
            return;
        }
        if self.take(recorded).is_none() {
            self.strange += 1;
        }
    }

    fn take(&mut self, recorded: &Recorded<'_>) -> Option<()> {
        if self.keys.is_none() {
            self.keys = recorded.keys();
        }
        let topic = self.keys.as_ref()?.parse(recorded.channel.strip_prefix('/')?)?;
        let payload = payload(&topic, recorded.data)?;
        match topic {
            Topic::Vote(_) => {
                let envelope = Envelope::decode(&payload).ok()?;
                let Message::Vote(vote) = envelope.message else { return None };
                let held = HeldVote {
                    robot: envelope.author,
                    stamp: envelope.stamp,
                    vote,
                    signature: envelope.signature,
                };
                self.showing(held.vote.round, recorded.at).votes.push((recorded.at, held));
            }
            Topic::Decision => {
                let decision = decode_json::<Announcement>(&payload).ok()?.decision;
                decision.check().ok()?;
                self.showing(decision.round, recorded.at).announced.push(decision);
            }
            Topic::Feedback(instructor) => {
                let word: Instruction = decode_json(&payload).ok()?;
                if let Some(round) = word.round() {
                    let words = &mut self.showing(round, recorded.at).words;
                    words.entry(instructor).or_default().hear(word, recorded.published);
                }
            }
            Topic::Answer(instructor) => {
                let answer: Answer = decode_json(&payload).ok()?;
                if let Some(round) = answer.to.round() {
                    let words = &mut self.showing(round, recorded.at).words;
                    words.entry(instructor).or_default().answer(&answer);
                }
            }
            Topic::Status(_) => {
                let status: Status = decode_json(&payload).ok()?;
                // A robot without a classifier reports no vocabulary.
                let Some(vocabulary) = Vocabulary::of_status(&status) else { return Some(()) };
                // Those that do not learn have heard of nothing that was named.
                let known = self.vocabularies.get(&vocabulary.id().0);
                if known.is_none_or(|known| known.titles() <= vocabulary.titles()) {
                    self.vocabularies.insert(vocabulary.id().0, vocabulary);
                }
            }
            _ => return None,
        }
        Some(())
    }

    /// The showing that a round is a name of: opened at the same time by several robots, it has one count and several names.
    fn showing(&mut self, round: RoundId, at: u64) -> &mut Showing {
        let near = |showing: &Showing| {
            at.abs_diff(showing.opened) <= ONE_SHOWING.as_nanos() as u64
                && showing.rounds.iter().all(|known| known.may_merge(&round))
        };
        let index = match self.by_round.get(&round) {
            Some(index) => *index,
            None => self.showings.iter().rposition(near).unwrap_or_else(|| {
                self.showings.push(Showing { opened: at, ..Showing::default() });
                self.showings.len() - 1
            }),
        };
        self.by_round.insert(round, index);
        let showing = &mut self.showings[index];
        showing.rounds.insert(round);
        showing
    }

    /// The label of a class, if the vocabulary was heard of.
    #[must_use]
    pub fn label(&self, vocabulary: VocabularyId, class: ClassId) -> Option<&str> {
        self.vocabularies.get(&vocabulary.0)?.label(class)
    }

    /// What people said that the gesture of a showing was; `None` where they said nothing, took it back, or contradict each other. What robots refused was
    /// not said, nor what names a gesture that none of them has.
    #[must_use]
    pub fn truth(&self, showing: &Showing) -> Option<Truth> {
        let vocabulary = showing.decision()?.certificate.vocabulary;
        let class = |gesture: &Gesture| match gesture {
            Gesture::Class(class) => Some(*class),
            Gesture::Label(label) => self.vocabularies.get(&vocabulary.0)?.class(label),
        };
        let mut truth = None;
        for (by, words) in &showing.words {
            let Some(word) = words.last() else { continue };
            let said = match word {
                Instruction::Was { class: gesture, .. } | Instruction::Right { of: gesture, .. } => {
                    class(gesture).map(Truth::Is)
                }
                Instruction::Wrong { of, .. } => class(of).map(Truth::IsNot),
                // As robots take it: a gesture that is listed needs no new name.
                Instruction::New { label, .. } => {
                    let listed = self.vocabularies.get(&vocabulary.0).and_then(|listed| listed.class(label));
                    Some(Truth::Is(listed.unwrap_or_else(|| ClassId::named(by, label))))
                }
                Instruction::Open
                | Instruction::Retract { .. }
                | Instruction::Same { .. }
                | Instruction::Retire { .. }
                | Instruction::Restore { .. } => None,
            };
            let Some(said) = said else { continue };
            truth = Some(match (truth, said) {
                (None, said) => said,
                (Some(Truth::Is(known)), Truth::IsNot(other))
                | (Some(Truth::IsNot(other)), Truth::Is(known))
                    if known != other =>
                {
                    Truth::Is(known)
                }
                (Some(known), said) if known == said => known,
                _ => return None,
            });
        }
        truth
    }

    /// What the certificates of all decisions say of how many robots a decision needed: more than half where all agree on that, else a
    /// number; `None` where they say several things.
    #[must_use]
    pub fn quorum(&self) -> Option<Quorum> {
        let needed = || self.showings.iter().flat_map(|showing| &showing.announced).map(|it| &it.certificate);
        if needed().all(|certificate| certificate.quorum == certificate.robots / 2 + 1) {
            return Some(Quorum::Majority);
        }
        let quorum = needed().next()?.quorum;
        needed().all(|certificate| certificate.quorum == quorum).then_some(Quorum::Evidence(quorum))
    }

    /// All robots that voted.
    #[must_use]
    pub fn robots(&self) -> BTreeSet<RobotId> {
        self.showings.iter().flat_map(|showing| &showing.votes).map(|(_, held)| held.robot).collect()
    }
}

/// The rounds that a recording says its swarm was configured with; `None` where it says nothing that can be understood.
#[must_use]
pub fn rounds_of(about: &BTreeMap<String, String>) -> Option<RoundsConfig> {
    serde_json::from_str(about.get(ROUNDS)?).ok()
}

/// The bytes that travelled, from the data of a recorded message.
pub(crate) fn payload(topic: &Topic, data: &[u8]) -> Option<Vec<u8>> {
    wire(topic, &serde_json::from_slice::<Value>(data).ok()?)
}
