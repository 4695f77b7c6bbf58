//! Decisions and robots in words, and results as lines on stdout.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use gestalt_protocol::{
    Announcement, Answer, Certificate, ClassId, Decision, FusionRule, Instruction, Outcome, Question, Reason,
    RobotId, RoundId, RoundOutcome, Status,
};
use gestalt_strategies::{MindConfig, Vocabulary, outcome};
use serde_json::Value;

use super::Failure;

/// Prints one result on a line of its own: as a JSON object, or in words.
pub(super) fn line(as_json: bool, object: &Value, words: &str) -> Result<(), Failure> {
    super::say(&if as_json { format!("{object}\n") } else { format!("{}\n", plain(words)) })
}

/// What others said, made fit for a terminal: whatever would move its cursor, change its colours or turn its writing is
/// written out, and so is the end of a line.
pub fn clean(said: &str) -> String {
    escape(said, |_| false)
}

/// The same of our own words, which may have several lines.
pub(super) fn plain(words: &str) -> String {
    escape(words, |c| c == '\n')
}

fn escape(text: &str, kept: impl Fn(char) -> bool) -> String {
    let turns =
        |c: char| matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        if (c.is_control() || turns(c)) && !kept(c) {
            escaped.extend(c.escape_default());
        } else {
            escaped.push(c);
        }
    }
    escaped
}

/// The names of the gestures, by the vocabulary that a decision is made in.
#[derive(Clone, Debug, Default)]
pub(super) struct Names(Vec<Vocabulary>);

impl Names {
    /// Those of one vocabulary.
    #[cfg(any(test, feature = "opencv"))]
    pub(super) fn new(vocabulary: &Vocabulary) -> Self {
        Self(vec![vocabulary.clone()])
    }

    /// Those that the robots of a swarm report.
    pub(super) fn reported(statuses: &[Status]) -> Self {
        // A robot without a classifier reports none, which is not a vocabulary.
        let mut known: BTreeMap<u32, Vocabulary> = BTreeMap::new();
        for status in statuses {
            let Some(vocabulary) = Vocabulary::of_status(status) else { continue };
            // Not all may have heard of what was named.
            let fuller =
                known.get(&vocabulary.id().0).is_none_or(|known| known.titles() < vocabulary.titles());
            if fuller {
                known.insert(vocabulary.id().0, vocabulary);
            }
        }
        Self(known.into_values().collect())
    }

    /// Whether they suffice for a decision.
    pub(super) fn cover(&self, decision: &Decision) -> bool {
        self.of(&decision.certificate).is_some()
    }

    fn of(&self, certificate: &Certificate) -> Option<&Vocabulary> {
        self.0.iter().find(|vocabulary| vocabulary.id() == certificate.vocabulary)
    }

    /// What any of the robots calls a gesture.
    fn title(&self, class: ClassId) -> Option<&str> {
        self.0.iter().find_map(|vocabulary| vocabulary.label(class))
    }

    /// A gesture in words: `"three"`, or `class 3` where there is no name for it.
    pub(super) fn gesture(&self, class: ClassId, certificate: &Certificate) -> String {
        let label = self.of(certificate).and_then(|vocabulary| vocabulary.label(class));
        label.map_or_else(|| format!("class {class}"), quoted)
    }
}

/// A label, so that it cannot be taken for a number of something.
pub(super) fn quoted(label: &str) -> String {
    format!("\"{}\"", clean(label))
}

/// A decision with its certificate in short: `round 18 (opened by robot 1) → "2", p = 1.000 · 8 votes in 252 ms, log-pool · by
/// robot 1:"1" 2:"2" 3:"2"`.
#[cfg(any(feature = "opencv", test))]
pub(super) fn decision(decision: &Decision, label: Option<&str>, names: &Names) -> String {
    in_words(decision, label, None, names)
}

fn in_words(decision: &Decision, label: Option<&str>, why: Option<String>, names: &Names) -> String {
    let Decision { round, class, confidence, certificate, .. } = decision;
    let what = match (class, label) {
        (Some(_), Some(label)) => format!("{}, p = {confidence:.3}", quoted(label)),
        (Some(class), None) => format!("{}, p = {confidence:.3}", names.gesture(*class, certificate)),
        (None, _) if why.is_some() => why.unwrap_or_default(),
        (None, _) if certificate.reached() < certificate.quorum as usize => format!(
            "undecided: {} of {} took part, {} needed",
            certificate.reached(),
            counted(certificate.robots as usize, "robot"),
            certificate.quorum
        ),
        (None, _) => "undecided".to_owned(),
    };
    let votes = &certificate.votes;
    let mut words = format!(
        "{} → {what} · {} in {} ms, {}",
        opened(*round),
        counted(votes.len(), "vote"),
        certificate.elapsed_ms,
        rule(certificate.rule)
    );
    // The first votes show how it came about; a large swarm's would fill the screen.
    const SHOWN: usize = 12;
    for (i, vote) in votes.iter().take(SHOWN).enumerate() {
        let voted = match label {
            Some(label) if Some(vote.class) == *class => quoted(label),
            _ => names.gesture(vote.class, certificate),
        };
        // Writing to a string cannot fail.
        let _ = write!(words, "{}{}:{voted}", if i == 0 { " · by robot " } else { " " }, vote.robot);
    }
    if votes.len() > SHOWN {
        words.push_str(" …");
    }
    words
}

/// The same of a decision as it was announced.
pub(super) fn announced(announcement: &Announcement, names: &Names) -> String {
    let Announcement { decision, label, .. } = announcement;
    let config = MindConfig { rule: decision.certificate.rule, ..MindConfig::default() };
    let (came_to, reason) = outcome(decision, &config);
    let why = decision.class.is_none().then(|| because(came_to, &reason, decision, names));
    in_words(decision, label.as_deref(), why, names)
}

/// What a round without a gesture came to, and why: `unknown: nearest is "fist", and less likely by 2.3 nats`.
fn because(outcome: RoundOutcome, reason: &Reason, decision: &Decision, names: &Names) -> String {
    let certificate = &decision.certificate;
    let name = |class: ClassId| names.gesture(class, certificate);
    let why = match *reason {
        Reason::Sure => return outcome.name().to_owned(),
        Reason::FarFromAll { nearest, nats } => {
            format!("nearest is {}, and less likely by {nats:.1} nats", name(nearest))
        }
        // Who learns from nothing has no gesture to vote for before the first was taught.
        Reason::NothingSeen => "no robot that knows a gesture saw a hand".to_owned(),
        Reason::TooFewRobots { counted: number, needed } => format!(
            "{number} of {} took part, {needed} needed",
            counted(certificate.robots as usize, "robot")
        ),
        Reason::Disagreement { between: [a, b], robots: [for_a, for_b] } => {
            format!("{for_a} for {}, {for_b} for {}", name(a), name(b))
        }
        Reason::Unsure { nearest, probability } => format!("{} with p = {probability:.3}", name(nearest)),
    };
    format!("{}: {why}", outcome.name())
}

/// `round 18 (opened by robot 1)`.
pub(super) fn opened(RoundId { counter, opener, .. }: RoundId) -> String {
    format!("round {counter} (opened by robot {opener})")
}

/// What the swarm says to a word of feedback: `round 5: learned; robot 1 learns from 8 samples of this round`.
pub(super) fn answer(answer: &Answer, names: &Names) -> String {
    let named = match &answer.to {
        Instruction::New { label, .. } => Some(quoted(label)),
        Instruction::Same { class, .. } | Instruction::Retire { class } | Instruction::Restore { class } => {
            Some(clean(&class.to_string()))
        }
        _ => None,
    };
    if let Some(named) = named.filter(|_| answer.to.round().is_none()) {
        return format!("{named}: {}", answer.outcome.describe());
    }
    let round = answer.to.round().map(|round| format!("round {}: ", round.counter)).unwrap_or_default();
    if answer.outcome.is_refusal() {
        return format!("{round}{}", answer.outcome.describe());
    }
    let alike = answer.looks_like.map(|class| match names.title(class) {
        Some(title) => format!("; it looks like {}: the two may be hard to tell apart", quoted(title)),
        None => format!("; it looks like class {class}: the two may be hard to tell apart"),
    });
    let samples = match (&answer.to, answer.samples) {
        (Instruction::Retract { .. }, 0) => "its samples are no longer used".to_owned(),
        (Instruction::Wrong { .. }, 0) if answer.outcome == Outcome::Learned => {
            "what was seen in it is kept until its gesture is said".to_owned()
        }
        (_, samples) => {
            let samples = counted(samples as usize, "sample");
            format!("robot {} learns from {samples} of this round", answer.robot)
        }
    };
    format!("{round}{}; {samples}{}", answer.outcome.describe(), alike.unwrap_or_default())
}

/// A question of the swarm, and what it rests on.
pub(super) fn question(question: &Question) -> String {
    clean(&format!(
        "round {}: robot {} asks: {question} (unsure by {:.2} nats, {:.2} of them disagreement)",
        question.round.counter, question.robot, question.entropy, question.disagreement
    ))
}

/// `1 vote`, `8 votes`.
pub(super) fn counted(number: usize, what: &str) -> String {
    format!("{number} {what}{}", if number == 1 { "" } else { "s" })
}

/// A fusion rule's name, as in a configuration, but for the underscores.
fn rule(rule: FusionRule) -> String {
    clean(&rule.name().replace('_', "-"))
}

/// `1 2 3`, or `none`.
pub(super) fn robots<'a>(robots: impl IntoIterator<Item = &'a RobotId>) -> String {
    let ids: Vec<String> = robots.into_iter().map(ToString::to_string).collect();
    if ids.is_empty() { "none".to_owned() } else { ids.join(" ") }
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{CountedVote, Stamp, Terms, VocabularyId, Vote};

    use super::*;

    fn of(class: Option<u32>, votes: &[(u32, u32)], vocabulary: VocabularyId) -> Decision {
        let round = RoundId { counter: 18, opener: RobotId(1), life: 0 };
        let vote = |&(robot, class): &(u32, u32)| CountedVote {
            robot: RobotId(robot),
            stamp: Stamp { boot: 1, sequence: 1 },
            class: ClassId(class),
            weight: 1.0,
            vote: Vote { round, vocabulary, evidence: Vec::new(), looks: 1.0, unknown: None, named: vec![] },
            signature: None,
        };
        Decision {
            round,
            class: class.map(ClassId),
            confidence: 0.9996,
            author: RobotId(2),
            is_final: true,
            certificate: Certificate {
                vocabulary,
                rule: FusionRule::LogPool,
                pool: None,
                probabilities: Vec::new(),
                unknown: None,
                votes: votes.iter().map(vote).collect(),
                others: Vec::new(),
                robots: 3,
                quorum: u32::from(!votes.is_empty()),
                elapsed_ms: 252,
                named: vec![],
                terms: Terms::default(),
            },
        }
    }

    #[test]
    fn a_decision_says_what_each_number_is() {
        let gestures = Vocabulary::new(["fist", "1", "palm"]).unwrap();
        let made = of(Some(2), &[(1, 1), (2, 2), (3, 2)], gestures.id());
        assert_eq!(
            decision(&made, Some("palm"), &Names::new(&gestures)),
            "round 18 (opened by robot 1) → \"palm\", p = 1.000 · 3 votes in 252 ms, log-pool · by robot 1:\"1\" \
             2:\"palm\" 3:\"palm\""
        );
        // Without their names gestures have numbers, except the one that came with its label.
        assert_eq!(
            decision(&made, Some("palm"), &Names::default()),
            "round 18 (opened by robot 1) → \"palm\", p = 1.000 · 3 votes in 252 ms, log-pool · by robot 1:class 1 \
             2:\"palm\" 3:\"palm\""
        );
        assert_eq!(
            decision(&of(None, &[(7, 0)], gestures.id()), None, &Names::new(&gestures)),
            "round 18 (opened by robot 1) → undecided · 1 vote in 252 ms, log-pool · by robot 7:\"fist\""
        );
        assert!(
            decision(&of(None, &[], gestures.id()), None, &Names::default())
                .ends_with("0 votes in 252 ms, log-pool")
        );
    }

    #[test]
    fn the_names_are_those_of_the_decisions_vocabulary() {
        let (mine, other) = (Vocabulary::new(["a", "b"]).unwrap(), Vocabulary::new(["c", "d"]).unwrap());
        let status =
            Status { vocabulary: mine.labels().to_vec(), ..Status::new(RobotId(1), String::new(), 1) };
        let names = Names::reported(&[status, Status::new(RobotId(2), String::new(), 1)]);
        assert!(names.cover(&of(None, &[], mine.id())) && !names.cover(&of(None, &[], other.id())));
        assert!(decision(&of(Some(0), &[], other.id()), None, &names).contains("→ class 0,"));
    }

    #[test]
    fn what_others_say_cannot_touch_the_terminal() {
        let gestures = Vocabulary::new(["x", "y"]).unwrap();
        let made = of(Some(0), &[(1, 0)], gestures.id());
        let evil = "\x1b[2J\r\n\u{9b}31m\u{202e}fist";
        let words = plain(&decision(&made, Some(evil), &Names::default()));
        assert!(words.contains("\\u{1b}[2J\\r\\n\\u{9b}31m\\u{202e}fist"), "{words}");
        assert!(!words.chars().any(char::is_control));
        assert_eq!(plain("two\nlines\x07 · ± „ж“"), "two\nlines\\u{7} · ± „ж“");
        assert_eq!(clean("a\nb"), "a\\nb");
    }
}
