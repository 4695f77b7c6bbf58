//! Whether a round is worth a question, and which.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::LN_2;

use gestalt_protocol::{Ask, ClassId};
use gestalt_rounds::Doubt;

use super::config::QuestionsConfig;

/// From which probability on it is likelier something that nobody was taught.
const LIKELIER_UNKNOWN: f64 = 0.5;

/// And from which on that cannot be left out of account: a label may be the first of its gesture.
const PERHAPS_UNKNOWN: f64 = 0.2;

/// Nothing was asked for long when nothing was for so many times the rounds that must lie between two questions.
const LONG: u32 = 2;

/// A round that is over, as the rule sees it.
#[derive(Debug)]
pub struct Occasion<'a> {
    /// What its votes leave open; `None` where robots saw something, and none of them was ever taught anything.
    pub doubt: Option<&'a Doubt>,
    /// By class, of how many rounds it is known that they showed that gesture.
    pub labels: &'a BTreeMap<ClassId, usize>,
    /// The gestures that were asked about as the likeliest, since anybody said of a round what it showed.
    pub unanswered: &'a BTreeSet<ClassId>,
    /// The worth of the rounds before, as far as nobody said what they showed.
    pub before: &'a [f64],
    /// Whether something unknown was shown before, lately.
    pub repeated: bool,
    /// Since how many rounds nothing was asked, in units of [`rounds`](QuestionsConfig::rounds).
    pub quiet: u32,
}

impl Occasion<'_> {
    /// What a label of the round would be worth: u + (1 − u) h / (1 + n / [`familiar`](QuestionsConfig::familiar)), with u the probability of something that
    /// nobody was taught, h the entropy over the gestures that were if it is one of them, in nats, and n the labels of that of the two likeliest that has
    /// fewer. The first label of a gesture teaches most; what another one teaches falls with those before.
    ///
    /// Before anybody said of a round that it showed the likeliest gesture, h is at least ln 2, that of a coin: a model made elsewhere may be wrong here, and sure.
    /// Not once that gesture was asked about and nobody says anything.
    #[must_use]
    pub fn worth(&self, config: &QuestionsConfig) -> f64 {
        self.doubt.map_or(1.0, |doubt| {
            let least = if self.is_hearsay(doubt) { LN_2 } else { 0.0 };
            let among_gestures = self.discounted(doubt.among_gestures.max(least), config);
            doubt.unknown + (1.0 - doubt.unknown) * among_gestures
        })
    }

    /// Whether robots know the likeliest gesture from a model alone, and somebody may say whether that holds here.
    fn is_hearsay(&self, doubt: &Doubt) -> bool {
        let likeliest = doubt.gestures.first();
        likeliest.is_some_and(|class| self.labels_of(*class) == 0 && !self.unanswered.contains(class))
    }

    /// So many nats, the less the more was said of the gestures in doubt.
    fn discounted(&self, nats: f64, config: &QuestionsConfig) -> f64 {
        nats / (1.0 + self.least() as f64 / config.familiar)
    }

    /// The labels of that of the two likeliest gestures that has fewer.
    fn least(&self) -> usize {
        let likeliest = self.doubt.map_or(&[][..], |doubt| &doubt.gestures);
        likeliest.iter().take(2).map(|class| self.labels_of(*class)).min().unwrap_or(0)
    }

    fn labels_of(&self, class: ClassId) -> usize {
        self.labels.get(&class).copied().unwrap_or(0)
    }
}

/// What to ask about a round, if that is worth it.
///
/// | a label is worth it | robots | it looks unknown | it asks |
/// |---|---|---|---|
/// | yes | – | likelier than not, and something did before, lately | "a new gesture? its name?" |
/// | yes | disagree, it may be unknown, or one of the two was told seldom or never | less likely than not | "two or three?" |
/// | yes | are as unsure as each other, of gestures that were told often | hardly | "show it again, nearer" |
/// | no | disagree | less likely than not | "two or three?", where nothing was asked for long |
/// | no | agree | – | nothing |
///
/// Often is [`familiar`](QuestionsConfig::familiar) times. Before, doubt comes from knowing little, which no better view mends and a label does. A gesture that is known
/// from a model alone is asked about however sure all are, until a round is said to have shown it; once only where nobody says anything.
///
/// It is worth it from [`worth`](QuestionsConfig::worth) on, and if at most a third of the rounds before were worth more: questions are few, and how unknown things
/// look falls with all that was learned.
#[must_use]
pub fn worth_asking(occasion: &Occasion<'_>, config: &QuestionsConfig) -> Option<Ask> {
    let worth = occasion.worth(config);
    let more = occasion.before.iter().filter(|before| **before > worth).count();
    let is_worth = worth >= config.worth && 3 * more <= occasion.before.len();
    let gestures = occasion.doubt.map_or(&[][..], |doubt| &doubt.gestures);
    let nearest = gestures.first().copied();
    let [unknown, disagreement] =
        occasion.doubt.map_or([1.0, 0.0], |doubt| [doubt.unknown, doubt.disagreement]);
    if unknown >= LIKELIER_UNKNOWN {
        return (is_worth && occasion.repeated).then_some(Ask::Name { nearest });
    }
    let between = match gestures {
        [first, second, ..] => Ask::Between { classes: [*first, *second] },
        _ => Ask::Name { nearest },
    };
    let disagree = disagreement >= config.disagreement;
    let told_often = occasion.least() as f64 >= config.familiar;
    match is_worth {
        true if disagree || unknown >= PERHAPS_UNKNOWN || !told_often => Some(between),
        true => Some(Ask::Again { nearest: nearest? }),
        false => {
            let dissent = occasion.discounted(disagreement, config) >= config.disagreement;
            (occasion.quiet >= LONG && dissent).then_some(between)
        }
    }
}

/// Whether what was shown is likelier something that nobody was taught.
#[must_use]
pub(crate) fn is_unknown(doubt: Option<&Doubt>) -> bool {
    doubt.is_none_or(|doubt| doubt.unknown >= LIKELIER_UNKNOWN)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: ClassId = ClassId(2);
    const THREE: ClassId = ClassId(3);
    const NONE: &BTreeSet<ClassId> = &BTreeSet::new();

    fn doubt(among_gestures: f64, disagreement: f64, unknown: f64) -> Doubt {
        let gestures = vec![TWO, THREE, ClassId(0)];
        Doubt { entropy: among_gestures, among_gestures, disagreement, unknown, gestures }
    }

    /// With so many labels, the first time and in time.
    fn occasion<'a>(doubt: Option<&'a Doubt>, labels: &'a BTreeMap<ClassId, usize>) -> Occasion<'a> {
        Occasion { doubt, labels, unanswered: NONE, before: &[], repeated: false, quiet: 1 }
    }

    /// After so many labels of each gesture, of which 2 has twice as many.
    fn ask(doubt: &Doubt, labels: usize, repeated: bool, quiet: u32) -> Option<Ask> {
        let mut labels: BTreeMap<ClassId, usize> = (0..6).map(|class| (ClassId(class), labels)).collect();
        labels.entry(TWO).and_modify(|labels| *labels *= 2);
        let occasion = Occasion { repeated, quiet, ..occasion(Some(doubt), &labels) };
        worth_asking(&occasion, &QuestionsConfig::default())
    }

    const BETWEEN: Option<Ask> = Some(Ask::Between { classes: [TWO, THREE] });

    #[test]
    fn each_line_of_the_table() {
        let sure = doubt(0.05, 0.01, 0.02);
        assert_eq!(ask(&sure, 1, false, 2), None);
        let torn = doubt(0.65, 0.4, 0.02);
        assert_eq!(ask(&torn, 1, false, 1), BETWEEN);
        let dim = doubt(0.65, 0.02, 0.02);
        assert_eq!(ask(&dim, 1, false, 1), BETWEEN, "a label teaches more than a better view");
        assert_eq!(ask(&dim, 4, false, 1), Some(Ask::Again { nearest: TWO }));
        let perhaps_new = doubt(0.05, 0.02, 0.3);
        assert_eq!(ask(&perhaps_new, 9, false, 1), BETWEEN, "a label may be its gesture's first");
        let new = doubt(0.1, 0.0, 0.97);
        assert_eq!(ask(&new, 9, true, 1), Some(Ask::Name { nearest: Some(TWO) }));
        assert_eq!(ask(&new, 9, false, 1), None, "once is not often enough");
        let overruled = doubt(0.1, 0.3, 0.02);
        assert_eq!(ask(&overruled, 1, false, 1), None);
        assert_eq!(ask(&overruled, 1, false, 2), BETWEEN);
    }

    #[test]
    fn the_more_was_said_the_less_is_asked() {
        let torn = doubt(0.65, 0.4, 0.02);
        let asked: Vec<bool> = (1..60).map(|labels| ask(&torn, labels, false, 2).is_some()).collect();
        assert!(asked[0] && asked.is_sorted_by(|a, b| a >= b), "{asked:?}");
        assert!(!asked[58], "for ever");
        // The rarer of the two counts: 2 has labels enough, 3 has none.
        let labels = [(TWO, 99)].into();
        assert_eq!(worth_asking(&occasion(Some(&torn), &labels), &QuestionsConfig::default()), BETWEEN);
    }

    #[test]
    fn what_is_known_from_a_model_alone_is_as_doubtful_as_a_coin_unless_nobody_answers() {
        let (config, sure) = (QuestionsConfig::default(), doubt(0.05, 0.01, 0.02));
        let worth = |labels: &BTreeMap<ClassId, usize>, unanswered: &BTreeSet<ClassId>| {
            let occasion = Occasion { unanswered, quiet: 2, ..occasion(Some(&sure), labels) };
            (occasion.worth(&config), worth_asking(&occasion, &config))
        };
        let (known, unknown) = (0.98 * 0.05, 0.02);
        let (never, once) = (BTreeMap::new(), [(TWO, 1)].into());
        assert_eq!(worth(&never, NONE), (unknown + 0.98 * LN_2, BETWEEN));
        assert_eq!(worth(&never, &[THREE].into()), (unknown + 0.98 * LN_2, BETWEEN));
        assert_eq!(worth(&never, &[TWO].into()), (unknown + known, None));
        assert_eq!(worth(&once, NONE), (unknown + known, None), "the second likeliest is no matter");
    }

    #[test]
    fn what_is_worth_less_than_the_rounds_before_waits_for_better() {
        let config = QuestionsConfig::default();
        let torn = doubt(0.4, 0.4, 0.02);
        let labels = [(TWO, 1), (THREE, 1)].into();
        let asks = |before: &[f64]| {
            let occasion = Occasion { before, ..occasion(Some(&torn), &labels) };
            worth_asking(&occasion, &config).is_some()
        };
        assert!(asks(&[]) && asks(&[0.1, 0.2]) && asks(&[0.9, 0.1, 0.1]));
        assert!(!asks(&[0.9]) && !asks(&[0.9, 0.9, 0.1]));
    }

    #[test]
    fn who_knows_nothing_asks_for_a_name_when_it_is_shown_again() {
        let config = QuestionsConfig::default();
        let labels = BTreeMap::new();
        let shown = |repeated| Occasion { before: &[1.0], repeated, ..occasion(None, &labels) };
        assert_eq!(worth_asking(&shown(false), &config), None);
        assert_eq!(worth_asking(&shown(true), &config), Some(Ask::Name { nearest: None }));
        // One gesture is known: there are no two to choose from.
        let one = Doubt { gestures: vec![TWO], ..doubt(0.0, 0.0, 0.4) };
        let labels = [(TWO, 1)].into();
        assert_eq!(
            worth_asking(&occasion(Some(&one), &labels), &config),
            Some(Ask::Name { nearest: Some(TWO) })
        );
    }
}
