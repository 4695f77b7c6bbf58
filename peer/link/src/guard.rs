//! Between a robot and the program's own classifier: what panics there ends nothing here.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use gestalt_strategies::{Classify, ClassifyError, Judgement, Observation, Vocabulary};

use crate::failure::Part;
use crate::panics::said;
use crate::supervisor::Supervisor;

/// A classifier whose first panic is told; it is not asked again afterwards.
#[derive(Debug)]
struct Guarded {
    inner: Arc<dyn Classify>,
    vocabulary: Vocabulary,
    broken: Arc<AtomicBool>,
    supervisor: Arc<Supervisor>,
}

impl Guarded {
    fn ask<T>(&self, question: impl FnOnce(&dyn Classify) -> T) -> Option<T> {
        if self.broken.load(Ordering::Relaxed) {
            return None;
        }
        match catch_unwind(AssertUnwindSafe(|| question(&*self.inner))) {
            Ok(answer) => Some(answer),
            Err(panic) => {
                self.broken.store(true, Ordering::Relaxed);
                self.supervisor.failed(Part::Classifier, &said(&*panic));
                None
            }
        }
    }
}

impl Classify for Guarded {
    fn vocabulary(&self) -> &Vocabulary {
        &self.vocabulary
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        // No probabilities are no distribution: whoever asked counts the look as not judged.
        self.ask(|classifier| classifier.probabilities(features)).unwrap_or_else(|| Ok(Vec::new()))
    }

    fn judge(&self, features: &[f32]) -> Result<Judgement, ClassifyError> {
        let nothing = Judgement { probabilities: Vec::new(), unknown: None, view: None };
        self.ask(|classifier| classifier.judge(features)).unwrap_or(Ok(nothing))
    }

    fn judge_seen(&self, seen: &Observation) -> Result<Judgement, ClassifyError> {
        let nothing = Judgement { probabilities: Vec::new(), unknown: None, view: None };
        self.ask(|classifier| classifier.judge_seen(seen)).unwrap_or(Ok(nothing))
    }

    fn probabilities_in_space(&self, coordinates: &[f32]) -> Option<Vec<f64>> {
        self.ask(|classifier| classifier.probabilities_in_space(coordinates))?
    }

    fn unknown(&self, features: &[f32]) -> Option<f64> {
        self.ask(|classifier| classifier.unknown(features))?
    }

    fn view(&self, features: &[f32]) -> Option<Vec<f32>> {
        self.ask(|classifier| classifier.view(features))?
    }
}

/// Whether a robot sees: as its program says, and as long as its classifier works.
#[derive(Debug)]
pub(crate) struct Sight {
    supervisor: Arc<Supervisor>,
    broken: Arc<AtomicBool>,
    /// What the program said last.
    told_blind: bool,
    /// What the mind was told last.
    said_blind: bool,
}

impl Sight {
    pub fn new(supervisor: Arc<Supervisor>) -> Self {
        Self { supervisor, broken: Arc::default(), told_blind: false, said_blind: false }
    }

    /// Puts a classifier behind a guard; `None` when it panics at the first question.
    pub fn guard(&mut self, classifier: Arc<dyn Classify>) -> Option<Arc<dyn Classify>> {
        let vocabulary = match catch_unwind(AssertUnwindSafe(|| classifier.vocabulary().clone())) {
            Ok(vocabulary) => vocabulary,
            Err(panic) => {
                self.supervisor.failed(Part::Classifier, &said(&*panic));
                return None;
            }
        };
        self.broken = Arc::default();
        let (broken, supervisor) = (self.broken.clone(), self.supervisor.clone());
        Some(Arc::new(Guarded { inner: classifier, vocabulary, broken, supervisor }))
    }

    /// Notes what the program says of its camera.
    pub fn told(&mut self, blind: bool) {
        self.told_blind = blind;
    }

    /// What the mind is to be told, if that is another than it was told last.
    pub fn news(&mut self) -> Option<bool> {
        let blind = self.told_blind || self.broken.load(Ordering::Relaxed);
        (blind != self.said_blind).then(|| {
            self.said_blind = blind;
            blind
        })
    }

    /// A new mind takes the old one's place: it was told nothing.
    pub fn begin_anew(&mut self) {
        self.said_blind = false;
    }
}
