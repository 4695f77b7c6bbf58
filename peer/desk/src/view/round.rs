//! The latest rounds: what was decided, what it was, and how robots and swarm did.

use std::collections::BTreeMap;

use gestalt_protocol::{
    Answer, ClassId, Decision, Gesture, Instruction, InstructorId, Outcome, Rank, RoundId, RoundOutcome,
    VocabularyId,
};
use gestalt_strategies::{MindConfig, Vocabulary, outcome};
use serde::Serialize;

use super::text::{clipped, finite, gesture};

/// How many rounds are remembered.
pub const MAX_ROUNDS: usize = 240;

/// How many instructors are heard about one round.
const MAX_INSTRUCTORS: usize = 16;

/// Over how many rounds the curve is smoothed.
const SMOOTHED: usize = 6;

/// One round of the strip.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RoundView {
    /// Which round.
    pub round: RoundId,
    /// The gesture that was decided; `None` for "no decision".
    pub label: Option<String>,
    /// What it came to: `gesture`, `unknown` or `undecided`.
    pub outcome: RoundOutcome,
    /// The fused probability, `0.0..=1.0`.
    pub confidence: f64,
    /// What instructors said of it.
    pub verdict: Verdict,
    /// The gesture that was shown, as far as instructors have said so.
    pub truth: Option<String>,
}

/// Whether a decision was right.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nobody said, or it was taken back.
    Unknown,
    /// It was.
    Right,
    /// It was not.
    Wrong,
}

/// The learning curve at one round: means over the last six rounds of which the gesture is known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CurvePoint {
    /// The round's counter.
    pub round: u32,
    /// The share of the robots' votes that were right, `0.0..=1.0`.
    pub single: f64,
    /// The share of the swarm's decisions that were right, `0.0..=1.0`.
    pub swarm: f64,
}

/// The rounds heard of, the newest [`MAX_ROUNDS`].
#[derive(Clone, Debug, Default)]
pub(super) struct Rounds(BTreeMap<RoundId, Round>);

#[derive(Clone, Debug, Default)]
struct Round {
    ended: Option<Ended>,
    /// The latest word of each instructor, with the time it was said at, and the gesture that the round showed by all that had been said by then,
    /// as the swarm answered.
    words: BTreeMap<InstructorId, (u64, Word, Option<ClassId>)>,
}

/// What is kept of a decision.
#[derive(Clone, Debug)]
struct Ended {
    rank: Rank,
    is_final: bool,
    class: Option<ClassId>,
    label: Option<String>,
    outcome: RoundOutcome,
    confidence: f64,
    vocabulary: VocabularyId,
    /// How many votes each gesture got.
    votes: BTreeMap<ClassId, u32>,
}

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Word {
    Class(ClassId),
    Label(String),
    Not(ClassId),
    NotLabel(String),
    TakenBack,
}

/// What a round is known to have shown.
enum Truth {
    Unknown,
    Class(ClassId),
    Not(ClassId),
}

impl Rounds {
    /// Takes in a decision. Says whether it is the first of its round, and whether it is news.
    pub fn decide(&mut self, decision: &Decision, label: Option<&str>) -> (bool, bool) {
        let ended = Ended::new(decision, label);
        let Some(round) = self.round(decision.round) else { return (false, false) };
        let is_first = round.ended.is_none();
        let is_new = round.ended.as_ref().is_none_or(|known| known.place() < ended.place());
        if is_new {
            round.ended = Some(ended);
        }
        (is_first, is_new)
    }

    /// Takes in what an instructor said of a round, and was answered.
    pub fn answer(&mut self, id: RoundId, by: InstructorId, answer: &Answer) {
        // Of robots that do not learn whoever says what was shown is refused, and right all the same.
        if answer.outcome.is_refusal() && answer.outcome != Outcome::NotLearning {
            return;
        }
        let Some(word) = Word::of(answer) else { return };
        let Some(round) = self.round(id) else { return };
        if round.words.len() >= MAX_INSTRUCTORS && !round.words.contains_key(&by) {
            return;
        }
        let said = (answer.at, word, answer.class);
        let known = round.words.entry(by).or_insert_with(|| said.clone());
        if *known < said {
            *known = said;
        }
    }

    /// Whether a decision of that round was heard, and is remembered.
    pub fn is_decided(&self, id: RoundId) -> bool {
        self.0.get(&id).is_some_and(|round| round.ended.is_some())
    }

    /// The gestures that a round was decided among.
    pub fn vocabulary(&self, id: RoundId) -> Option<VocabularyId> {
        self.0.get(&id)?.ended.as_ref().map(|ended| ended.vocabulary)
    }

    /// Forgets rounds with a greater counter than that.
    pub fn forget_after(&mut self, counter: u32) {
        while self.0.last_key_value().is_some_and(|(id, _)| id.counter > counter) {
            self.0.pop_last();
        }
    }

    pub fn views<'v>(&self, known: impl Fn(VocabularyId) -> Option<&'v Vocabulary>) -> Vec<RoundView> {
        let ended = self.0.iter().filter_map(|(id, round)| Some((id, round, round.ended.as_ref()?)));
        let view = |(id, round, ended): (&RoundId, &Round, &Ended)| {
            let vocabulary = known(ended.vocabulary);
            let name = |class| match &ended.label {
                Some(label) if Some(class) == ended.class => label.clone(),
                _ => gesture(class, vocabulary),
            };
            let truth = round.truth(vocabulary);
            RoundView {
                round: *id,
                label: ended.class.map(name),
                outcome: ended.outcome,
                confidence: ended.confidence,
                verdict: ended.verdict(&truth),
                truth: if let Truth::Class(class) = truth { Some(name(class)) } else { None },
            }
        };
        ended.map(view).collect()
    }

    pub fn curve<'v>(&self, known: impl Fn(VocabularyId) -> Option<&'v Vocabulary>) -> Vec<CurvePoint> {
        let scored = self.0.iter().filter_map(|(id, round)| {
            let ended = round.ended.as_ref()?;
            let Truth::Class(truth) = round.truth(known(ended.vocabulary)) else { return None };
            let (votes, right) = (ended.votes.values().sum::<u32>(), ended.votes.get(&truth).copied());
            let single = f64::from(right.unwrap_or_default()) / f64::from(votes.max(1));
            Some((id.counter, single, if ended.class == Some(truth) { 1.0 } else { 0.0 }))
        });
        let scored: Vec<(u32, f64, f64)> = scored.collect();
        (1..=scored.len())
            .map(|end| {
                let window = &scored[end.saturating_sub(SMOOTHED)..end];
                let mean = |pick: fn(&(u32, f64, f64)) -> f64| {
                    window.iter().map(pick).sum::<f64>() / window.len() as f64
                };
                CurvePoint {
                    round: window[window.len() - 1].0,
                    single: mean(|it| it.1),
                    swarm: mean(|it| it.2),
                }
            })
            .collect()
    }

    /// How many words are remembered.
    #[cfg(test)]
    pub fn words(&self) -> usize {
        self.0.values().map(|round| round.words.len()).sum()
    }

    /// That round, if it is not older than all that are remembered.
    fn round(&mut self, id: RoundId) -> Option<&mut Round> {
        if !self.0.contains_key(&id) && self.0.len() >= MAX_ROUNDS {
            if self.0.first_key_value().is_some_and(|(oldest, _)| id < *oldest) {
                return None;
            }
            self.0.pop_first();
        }
        Some(self.0.entry(id).or_default())
    }
}

impl Round {
    /// What instructors say: what all their words come to by the latest answer, or else the latest of those that stand.
    fn truth(&self, vocabulary: Option<&Vocabulary>) -> Truth {
        let words = || self.words.iter().map(|(by, (at, word, comes_to))| (*at, by, word, comes_to));
        let latest = words().max_by_key(|(at, by, ..)| (*at, *by));
        if let Some(comes_to) = latest.and_then(|(.., comes_to)| *comes_to) {
            return Truth::Class(comes_to);
        }
        let standing = words().filter(|(_, _, word, _)| **word != Word::TakenBack);
        let class = |label: &str| vocabulary.and_then(|vocabulary| vocabulary.class(label));
        let truth = match standing.max_by_key(|(at, by, ..)| (*at, *by)).map(|(_, _, word, _)| word) {
            Some(Word::Class(it)) => Some(Truth::Class(*it)),
            Some(Word::Label(label)) => class(label).map(Truth::Class),
            Some(Word::Not(it)) => Some(Truth::Not(*it)),
            Some(Word::NotLabel(label)) => class(label).map(Truth::Not),
            Some(Word::TakenBack) | None => None,
        };
        truth.unwrap_or(Truth::Unknown)
    }
}

impl Ended {
    fn new(decision: &Decision, label: Option<&str>) -> Self {
        let mut votes = BTreeMap::new();
        for counted in &decision.certificate.votes {
            *votes.entry(counted.class).or_default() += 1;
        }
        let config = MindConfig { rule: decision.certificate.rule, ..MindConfig::default() };
        Self {
            rank: decision.rank(),
            is_final: decision.is_final,
            class: decision.class,
            label: label.map(clipped),
            outcome: outcome(decision, &config).0,
            confidence: finite(decision.confidence),
            vocabulary: decision.certificate.vocabulary,
            votes,
        }
    }

    /// The greater of two decisions of one round stands; of one announced twice, the final one.
    fn place(&self) -> (Rank, bool, Option<ClassId>) {
        (self.rank, self.is_final, self.class)
    }

    fn verdict(&self, truth: &Truth) -> Verdict {
        match truth {
            Truth::Class(shown) if self.class == Some(*shown) => Verdict::Right,
            Truth::Class(_) => Verdict::Wrong,
            Truth::Not(it) if self.class == Some(*it) => Verdict::Wrong,
            Truth::Not(_) | Truth::Unknown => Verdict::Unknown,
        }
    }
}

impl Word {
    fn of(answer: &Answer) -> Option<Self> {
        let is = |gesture: &Gesture| match gesture {
            Gesture::Class(class) => Self::Class(*class),
            Gesture::Label(label) => Self::Label(clipped(label)),
        };
        Some(match &answer.to {
            Instruction::Open
            | Instruction::Same { .. }
            | Instruction::Retire { .. }
            | Instruction::Restore { .. } => return None,
            Instruction::New { .. } => Self::Class(answer.class?),
            Instruction::Was { class, .. } => is(class),
            Instruction::Right { of, .. } => is(of),
            Instruction::Wrong { of: Gesture::Class(class), .. } => Self::Not(*class),
            Instruction::Wrong { of: Gesture::Label(label), .. } => Self::NotLabel(clipped(label)),
            Instruction::Retract { .. } => Self::TakenBack,
        })
    }
}
