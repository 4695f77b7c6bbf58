//! What an emulated robot sees: a bad but honest opinion, without any camera.

use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_strategies::{Classify, ClassifyError, Observation, Vocabulary};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::scenario::View;

/// A robot's eyes in an emulation. Rendered views implement it too.
pub trait Observer: Send {
    /// What judges the frames; none for a robot that does not see.
    fn classifier(&self) -> Option<Arc<dyn Classify>>;

    /// The time between two frames, in seconds.
    fn period(&self) -> f64;

    /// What all robots see alike of the next showing follows from this number.
    fn share(&mut self, alike: u64) {
        let _ = alike;
    }

    /// Another gesture is being shown. All other randomness of this showing comes from `rng`.
    fn show(&mut self, shown: ClassId, rng: &mut dyn rand::Rng);

    /// The next frame of this showing; `None` when there is no hand to be seen.
    fn frame(&mut self, rng: &mut dyn rand::Rng) -> Option<Observation>;
}

/// Sees class scores: the shown class raised by the view's signal, each with Gaussian noise.
#[derive(Debug)]
pub struct StatisticalObserver {
    view: View,
    classifier: Arc<ScoreClassifier>,
    shown: ClassId,
    lasting: Vec<f64>,
    /// From which follows what all robots see alike of this showing.
    alike: u64,
}

impl StatisticalObserver {
    /// An observer with that view of gestures from that vocabulary.
    #[must_use]
    pub fn new(view: View, vocabulary: Vocabulary) -> Self {
        let lasting = vec![0.0; vocabulary.classes()];
        let classifier = Arc::new(ScoreClassifier { vocabulary, signal: view.signal });
        Self { view, classifier, shown: ClassId(0), lasting, alike: 0 }
    }
}

impl Observer for StatisticalObserver {
    fn classifier(&self) -> Option<Arc<dyn Classify>> {
        Some(self.classifier.clone())
    }

    fn period(&self) -> f64 {
        1.0 / self.view.fps
    }

    fn share(&mut self, alike: u64) {
        self.alike = alike;
    }

    fn show(&mut self, shown: ClassId, rng: &mut dyn rand::Rng) {
        self.shown = shown;
        let View { persistence, likeness, .. } = self.view;
        let mut common = ChaCha8Rng::seed_from_u64(self.alike);
        let (own, alike) = ((persistence * (1.0 - likeness)).sqrt(), (persistence * likeness).sqrt());
        for noise in &mut self.lasting {
            *noise = own * gaussian(rng);
            if likeness > 0.0 {
                *noise += alike * gaussian(&mut common);
            }
        }
    }

    fn frame(&mut self, rng: &mut dyn rand::Rng) -> Option<Observation> {
        let spread = (1.0 - self.view.persistence).sqrt();
        let score = |(k, lasting): (usize, &f64)| {
            let signal = if k == self.shown.index() { self.view.signal } else { 0.0 };
            (signal + lasting + spread * gaussian(rng)) as f32
        };
        Some(Observation { features: self.lasting.iter().enumerate().map(score).collect(), quality: 1.0 })
    }
}

/// A robot without a camera.
#[derive(Clone, Copy, Debug)]
pub struct BlindObserver;

impl Observer for BlindObserver {
    fn classifier(&self) -> Option<Arc<dyn Classify>> {
        None
    }

    fn period(&self) -> f64 {
        1.0
    }

    fn show(&mut self, _: ClassId, _: &mut dyn rand::Rng) {}

    fn frame(&mut self, _: &mut dyn rand::Rng) -> Option<Observation> {
        None
    }
}

/// The exact posterior of class scores under unit Gaussian noise: with the shown class raised by d and all classes
/// equally likely beforehand, P(k | x) ∝ exp(d·x_k). So one frame's probabilities mean what they say.
#[derive(Clone, Debug)]
pub struct ScoreClassifier {
    vocabulary: Vocabulary,
    signal: f64,
}

impl Classify for ScoreClassifier {
    fn vocabulary(&self) -> &Vocabulary {
        &self.vocabulary
    }

    fn probabilities(&self, features: &[f32]) -> Result<Vec<f64>, ClassifyError> {
        if features.len() != self.vocabulary.classes() {
            return Err(ClassifyError::Length { found: features.len(), expected: self.vocabulary.classes() });
        }
        if let Some(component) = features.iter().position(|score| !score.is_finite()) {
            return Err(ClassifyError::NotFinite(component));
        }
        let greatest = features.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let mut odds: Vec<f64> =
            features.iter().map(|score| (self.signal * f64::from(score - greatest)).exp()).collect();
        let sum: f64 = odds.iter().sum();
        odds.iter_mut().for_each(|p| *p /= sum);
        Ok(odds)
    }
}

/// A standard normal number (Box & Muller 1958). Always two draws, so that how many frames a robot takes is all that
/// its stream depends on; and written out, so that a seed goes on meaning the same traces.
fn gaussian(rng: &mut dyn rand::Rng) -> f64 {
    let (u, v): (f64, f64) = (rng.random(), rng.random());
    (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vocabulary() -> Vocabulary {
        Vocabulary::new(["0", "1", "2", "3", "4", "5"]).unwrap()
    }

    /// Of 4000 single frames: the share judged rightly, and the mean probability given to the top class.
    fn judged(view: View) -> (f64, f64) {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut observer = StatisticalObserver::new(view, vocabulary());
        let (mut right, mut claimed) = (0.0, 0.0);
        for n in 0..4000 {
            let shown = ClassId((n % 6) as u32);
            observer.show(shown, &mut rng);
            let frame = observer.frame(&mut rng).unwrap();
            let p = observer.classifier.probabilities(&frame.features).unwrap();
            let top = (0..6).max_by(|a, b| p[*a].total_cmp(&p[*b])).unwrap();
            right += f64::from(u8::from(top == shown.index()));
            claimed += p[top];
        }
        (right / 4000.0, claimed / 4000.0)
    }

    #[test]
    fn a_view_is_bad_but_its_probabilities_mean_what_they_say() {
        for persistence in [0.0, 0.5, 1.0] {
            let (right, claimed) = judged(View { fps: 2.0, signal: 1.5, persistence, likeness: 0.0 });
            assert!((0.5..0.7).contains(&right), "right in {right}");
            assert!((right - claimed).abs() < 0.03, "right in {right}, claims {claimed}");
        }
    }

    #[test]
    fn persistence_makes_the_frames_of_a_showing_err_alike() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let view = View { fps: 2.0, signal: 1.0, persistence: 1.0, likeness: 0.0 };
        let mut observer = StatisticalObserver::new(view, vocabulary());
        observer.show(ClassId(2), &mut rng);
        assert_eq!(observer.frame(&mut rng), observer.frame(&mut rng));
    }

    #[test]
    fn what_cannot_be_judged_is_said() {
        let observer = StatisticalObserver::new(
            View { fps: 2.0, signal: 1.0, persistence: 0.0, likeness: 0.0 },
            vocabulary(),
        );
        let judge = |features: &[f32]| observer.classifier.probabilities(features);
        assert_eq!(judge(&[0.0; 5]), Err(ClassifyError::Length { found: 5, expected: 6 }));
        assert_eq!(judge(&[0.0, f32::NAN, 0.0, 0.0, 0.0, 0.0]), Err(ClassifyError::NotFinite(1)));
    }
}
