//! Whether a round is worth a question, and which.

use std::collections::BTreeMap;

use gestalt_protocol::{Ask, ClassId};
use gestalt_rounds::Doubt;

use super::config::QuestionsConfig;

/// From which probability on it is likelier something that nobody was taught.
const LIKELIER_UNKNOWN: f64 = 0.5;

/// And from which on that cannot be left out of account: a label may be the first of its gesture.
const PERHAPS_UNKNOWN: f64 = 0.2;

/// A round that is over, as the rule sees it.
#[derive(Debug)]
pub struct Occasion<'a> {
    /// What its votes leave open; `None` where robots saw something, and none of them was ever taught anything.
    pub doubt: Option<&'a Doubt>,
    /// By class, of how many rounds it is known that they showed that gesture.
    pub labels: &'a BTreeMap<ClassId, usize>,
    /// Whether what is unknown was shown before, lately, and was likest the same gesture.
    pub repeated: bool,
    /// Whether nothing was asked for long.
    pub quiet: bool,
}

/// What to ask about a round, if that is worth it.
///
/// | the swarm is | robots | it looks unknown | it asks |
/// |---|---|---|---|
/// | – | – | yes, and did before, lately | "a new gesture? its name?" |
/// | unsure | disagree, or it may be unknown | no | "two or three?" |
/// | unsure | are as unsure as each other | no | "show it again, nearer" |
/// | sure | disagree | no | "two or three?", where nothing was asked for long |
/// | sure | agree | no | nothing |
///
/// Unsure is whose entropy reaches [`unsure`](QuestionsConfig::unsure) after it was divided by 1 + n / [`familiar`](QuestionsConfig::familiar), with n the
/// labels of that of the two likeliest gestures that has fewer: what the next label teaches falls with those before, so that a swarm in which something
/// stays hard to see does not ask about it for ever.
#[must_use]
pub fn worth_asking(occasion: &Occasion<'_>, config: &QuestionsConfig) -> Option<Ask> {
    let Some(doubt) = occasion.doubt else {
        return occasion.repeated.then_some(Ask::Name { nearest: None });
    };
    let (first, second) = (doubt.gestures.first().copied(), doubt.gestures.get(1).copied());
    if doubt.unknown >= LIKELIER_UNKNOWN && occasion.repeated {
        return Some(Ask::Name { nearest: first });
    }
    let labels_of = |class: ClassId| occasion.labels.get(&class).copied().unwrap_or(0);
    let labels = [first, second].into_iter().flatten().map(labels_of).min()?;
    let value = |nats: f64| nats / (1.0 + labels as f64 / config.familiar);
    let between = match (first, second) {
        (Some(first), Some(second)) => Ask::Between { classes: [first, second] },
        (nearest, _) => Ask::Name { nearest },
    };
    let disagree = doubt.disagreement >= config.disagreement;
    if value(doubt.entropy) >= config.unsure {
        return Some(if disagree || doubt.unknown >= PERHAPS_UNKNOWN {
            between
        } else {
            Ask::Again { nearest: first? }
        });
    }
    (occasion.quiet && disagree && value(doubt.disagreement) >= config.disagreement).then_some(between)
}

/// Whether what was shown is likelier something that nobody was taught; then what it is likest.
#[must_use]
pub(crate) fn unknown(doubt: Option<&Doubt>) -> Option<Option<ClassId>> {
    match doubt {
        None => Some(None),
        Some(doubt) => (doubt.unknown >= LIKELIER_UNKNOWN).then(|| doubt.gestures.first().copied()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: ClassId = ClassId(2);
    const THREE: ClassId = ClassId(3);

    fn doubt(entropy: f64, disagreement: f64, unknown: f64) -> Doubt {
        Doubt { entropy, disagreement, unknown, gestures: vec![TWO, THREE, ClassId(0)] }
    }

    /// After so many labels of each gesture, of which 2 has twice as many.
    fn ask(doubt: &Doubt, labels: usize, repeated: bool, quiet: bool) -> Option<Ask> {
        let mut labels: BTreeMap<ClassId, usize> = (0..6).map(|class| (ClassId(class), labels)).collect();
        labels.entry(TWO).and_modify(|labels| *labels *= 2);
        let occasion = Occasion { doubt: Some(doubt), labels: &labels, repeated, quiet };
        worth_asking(&occasion, &QuestionsConfig::default())
    }

    const BETWEEN: Option<Ask> = Some(Ask::Between { classes: [TWO, THREE] });

    #[test]
    fn each_line_of_the_table() {
        let sure = doubt(0.05, 0.01, 0.02);
        assert_eq!(ask(&sure, 0, false, true), None);
        let torn = doubt(0.65, 0.4, 0.02);
        assert_eq!(ask(&torn, 0, false, false), BETWEEN);
        let dim = doubt(0.65, 0.02, 0.02);
        assert_eq!(ask(&dim, 0, false, false), Some(Ask::Again { nearest: TWO }));
        let perhaps_new = doubt(0.65, 0.02, 0.3);
        assert_eq!(ask(&perhaps_new, 0, false, false), BETWEEN, "a label may be its gesture's first");
        let new = doubt(0.1, 0.0, 0.97);
        assert_eq!(ask(&new, 9, true, false), Some(Ask::Name { nearest: Some(TWO) }));
        assert_eq!(ask(&new, 9, false, false), None, "once is not often enough");
        let overruled = doubt(0.2, 0.3, 0.02);
        assert_eq!(ask(&overruled, 0, false, false), None);
        assert_eq!(ask(&overruled, 0, false, true), BETWEEN);
    }

    #[test]
    fn the_more_was_said_the_less_is_asked() {
        let torn = doubt(0.65, 0.4, 0.02);
        let asked: Vec<bool> = (0..40).map(|labels| ask(&torn, labels, false, true).is_some()).collect();
        assert!(asked[0] && asked.is_sorted_by(|a, b| a >= b), "{asked:?}");
        assert!(!asked[39], "for ever");
        // The rarer of the two counts: 2 has labels enough, 3 has none.
        let labels = [(TWO, 99)].into();
        let occasion = Occasion { doubt: Some(&torn), labels: &labels, repeated: false, quiet: false };
        assert_eq!(worth_asking(&occasion, &QuestionsConfig::default()), BETWEEN);
    }

    #[test]
    fn who_knows_nothing_asks_for_a_name_when_it_is_shown_again() {
        let config = QuestionsConfig::default();
        let labels = BTreeMap::new();
        let occasion = |repeated| Occasion { doubt: None, labels: &labels, repeated, quiet: false };
        assert_eq!(worth_asking(&occasion(false), &config), None);
        assert_eq!(worth_asking(&occasion(true), &config), Some(Ask::Name { nearest: None }));
        // One gesture is known: there are no two to choose from.
        let one = Doubt { entropy: 0.69, disagreement: 0.0, unknown: 0.4, gestures: vec![TWO] };
        let occasion =
            Occasion { doubt: Some(&one), labels: &[(TWO, 1)].into(), repeated: false, quiet: false };
        assert_eq!(worth_asking(&occasion, &config), Some(Ask::Name { nearest: Some(TWO) }));
    }
}
