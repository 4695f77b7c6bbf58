//! What came of a training, as text and as JSON.

use std::path::{Path, PathBuf};

use gestalt_strategies::{Classifier, Classify, Evaluation, Folding, Reduction, Trained};
use serde_json::{Value, json};

use super::super::report;
use gestalt_vision::dataset::joined;
use gestalt_vision::model_file::Model;
use gestalt_vision::survey::Survey;

/// A training that is over.
pub(super) struct Outcome<'a> {
    /// The folders it was trained on.
    pub folders: &'a [PathBuf],
    /// The file it was written to.
    pub out: &'a Path,
    /// What was written.
    pub model: &'a Model,
    /// What the search found.
    pub trained: &'a Trained,
    /// How many folds it was found in.
    pub folds: usize,
    /// The images trained on.
    pub survey: &'a Survey,
    /// How long the training took.
    pub seconds: f64,
    /// How it did on the images held out, if there are any.
    pub test: Option<&'a (Evaluation, Survey)>,
    /// How many of these were left out, as the learned eyes were made with them.
    pub left_out: usize,
    /// How many of the images trained on, and so cross-validated, the learned eyes were made with.
    pub known: usize,
    /// Folders that were left out.
    pub ignored: Vec<&'a str>,
}

impl Outcome<'_> {
    /// Whether it is known of every image who shows it.
    fn by_person(&self) -> bool {
        self.survey.seen.iter().all(|(image, _)| image.person.is_some())
    }

    /// Some lines for people.
    pub(super) fn text(&self) -> String {
        let Self { model, trained, .. } = self;
        let classifier = &model.classifier;
        let people = model.origin.people.len();
        let folding = match (trained.folding, self.by_person()) {
            (Folding::ByGroup, true) => "by subject",
            (Folding::ByGroup, false) => "by subject where known, else by image",
            (Folding::BySample, _) => "by image (subjects appear on both sides of the split)",
        };
        let copies = match self.survey.variations() {
            0 => String::new(),
            copies => format!(" and {copies} variations"),
        };
        let mut lines = vec![
            format!(
                "{} images{copies} of {people} subjects, {}",
                self.survey.seen.len(),
                joined(self.folders)
            ),
            format!("  gestures   {}", classifier.vocabulary().labels().join(" ")),
            format!(
                "  features   {} → {} principal components, {:.1} % of the variance",
                classifier.space().feature_set(),
                classifier.space().components(),
                100.0 * explained(classifier)
            ),
            format!(
                "  SVM        C = {}, γ = {}, {} support vectors",
                trained.cost,
                trained.gamma,
                classifier.support_vectors()
            ),
            format!(
                "  validation accuracy {:.3}, {}-fold cross-validation {folding}{}",
                trained.accuracy,
                self.folds,
                known(self.known, self.survey.seen.len())
            ),
            format!("  trained in {:.1} s → {}", self.seconds, self.out.display()),
        ];
        if let Some((evaluation, survey)) = self.test {
            lines.push(format!("\n{} images of held-out subjects:", evaluation.count()));
            if self.left_out > 0 {
                let left_out = self.left_out;
                lines.push(format!(
                    "  left out          {left_out} images that the learned eyes were made with"
                ));
            }
            lines.push(report::text(evaluation, survey, classifier.vocabulary()));
        }
        lines.join("\n") + "\n"
    }

    /// All of it, for programs.
    pub(super) fn json(&self) -> Value {
        let Self { model, trained, survey, .. } = self;
        let classifier = &model.classifier;
        json!({
            "model": self.out.display().to_string(),
            "dataset": joined(self.folders),
            "gestures": classifier.vocabulary().labels(),
            "ignored": self.ignored,
            "feature_set": classifier.space().feature_set(),
            "space": classifier.space().id().to_string(),
            "components": classifier.space().components(),
            "variance": explained(classifier),
            "cost": trained.cost,
            "gamma": trained.gamma,
            "support_vectors": classifier.support_vectors(),
            "images": survey.seen.len(),
            "variations": survey.variations(),
            "without_hand": survey.without_hand.len(),
            "unreadable": survey.unreadable.len(),
            "people": model.origin.people.len(),
            "cross_validation": {
                "folds": self.folds,
                "by_person": trained.folding == Folding::ByGroup && self.by_person(),
                "accuracy": trained.accuracy,
                "log_loss": trained.log_loss,
                "made_with": self.known,
            },
            "seconds": self.seconds,
            "test_left_out_as_trained_on": self.left_out,
            "test": self.test.map(|(evaluation, survey)| report::json(evaluation, survey, classifier.vocabulary())),
        })
    }
}

/// Of how many of the images cross-validation says too much: the learned eyes were made with them.
fn known(known: usize, images: usize) -> String {
    match known {
        0 => String::new(),
        known => format!(
            "\n             too good: the learned eyes were made with {known} of these {images} images, or with the people in them"
        ),
    }
}

/// Part of the variance that the classifier's space keeps, `0.0..=1.0`.
fn explained(classifier: &Classifier) -> f64 {
    match classifier.space().reduction() {
        Reduction::Pca(pca) => pca.explained(),
        Reduction::Selected { width, kept } => kept.len() as f64 / *width as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::known;

    #[test]
    fn cross_validation_on_what_the_eyes_were_made_with_says_so() {
        assert_eq!(known(0, 1443), "");
        let said = known(1423, 1443);
        assert!(said.contains("too good") && said.contains("made with 1423 of these 1443 images"), "{said}");
    }
}
