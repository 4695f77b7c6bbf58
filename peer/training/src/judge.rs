//! How often eyes are right about a set of pictures: looked at as robots do, with the weights as they are shipped.

use std::error::Error;
use std::fmt;
use std::path::{Path, PathBuf};

use gestalt_protocol::ClassId;
use gestalt_strategies::{Classify, Evaluation, Proportion, Vocabulary};
use gestalt_vision::dataset::{Dataset, DatasetError, LabelledImage, Naming};
use gestalt_vision::eyes::{Eyes, EyesError};
use gestalt_vision::model_file::{Model, Origin};
use gestalt_vision::perception::{NoHand, NoObservation};
use opencv::imgcodecs::{IMREAD_COLOR, imread};
use rayon::prelude::*;

use crate::course::Taught;
use crate::sets::Sets;

/// A row for each set.
#[derive(Default)]
pub struct Table {
    rows: Vec<Row>,
    /// A line for each picture: its path, what it shows, how sure a hand was found, and how likely each count is.
    pub looks: String,
}

struct Row {
    set: String,
    images: u64,
    without_hand: u64,
    evaluation: Evaluation,
    /// Pictures without a hand, and those of them in which one is found.
    empty: u64,
    alarms: u64,
}

/// A picture, and the count that it shows: `None` for no hand.
type Shown = (PathBuf, Option<ClassId>);

/// The pictures of a set, without those that the eyes were made with, and how many are left out. Folders of other gestures do not count.
fn unseen(
    folder: &Path,
    vocabulary: &Vocabulary,
    eyes: &Origin,
) -> Result<(Vec<Shown>, usize), DatasetError> {
    let Dataset { images, none, .. } = Dataset::list_known(folder, Naming::Counts, vocabulary)?;
    let all = images.len() + none.len();
    let nobodys = |path| LabelledImage { path, class: ClassId(0), person: None };
    let none = eyes.unseen(none.into_iter().map(nobodys).collect());
    let counted = eyes.unseen(images).into_iter().map(|image| (image.path, Some(image.class)));
    let kept: Vec<_> = counted.chain(none.into_iter().map(|image| (image.path, None))).collect();
    let left_out = all - kept.len();
    Ok((kept, left_out))
}

impl Table {
    /// Looks at all pictures of a set but those that the eyes were made with.
    pub fn judge(&mut self, taught: &Taught, sets: &Sets, set: &str) -> Result<(), Box<dyn Error>> {
        let [finder, refiner, counter] = &taught.weights;
        let eyes = || Eyes::new(finder, refiner, counter);
        let Model { classifier, origin } = &taught.model;
        let (pictures, left_out) = unseen(&sets.picture(set), classifier.vocabulary(), origin)?;
        if left_out > 0 {
            println!(
                "{set}: left out {left_out} pictures that these eyes were made with, or of people in such"
            );
        }
        let looks = pictures
            .par_iter()
            .map_init(eyes, |eyes: &mut Result<Eyes, EyesError>, (path, _)| {
                let eyes = eyes.as_mut().map_err(|error| error.to_string())?;
                let picture = imread(path, IMREAD_COLOR).map_err(|error| error.to_string())?;
                match eyes.look(&picture, None) {
                    Ok(look) => Ok(Ok(look)),
                    Err(NoObservation::NoHand(NoHand::Unrecognised { confidence, .. })) => {
                        Ok(Err(confidence))
                    }
                    Err(NoObservation::NoHand(_)) => Ok(Err(0.0)),
                    Err(error) => Err(error.to_string()),
                }
            })
            .collect::<Result<Vec<_>, String>>()?;
        let evaluation = Evaluation::new(6);
        let mut row =
            Row { set: set.to_owned(), images: 0, without_hand: 0, evaluation, empty: 0, alarms: 0 };
        for ((path, count), look) in pictures.iter().zip(looks) {
            let (confidence, look) = match look {
                Ok(look) => (look.confidence, Some(look)),
                Err(confidence) => (confidence, None),
            };
            let p = look.map(|look| classifier.probabilities(&look.embedding)).transpose()?;
            let shown = count.map_or("none".to_owned(), |count| count.index().to_string());
            let likely: String = p.iter().flatten().map(|p| format!(",{p:.3}")).collect();
            self.looks += &format!("{},{shown},{confidence:.3}{likely}\n", path.display());
            match (count, p) {
                (None, p) => {
                    row.empty += 1;
                    row.alarms += u64::from(p.is_some());
                }
                (Some(count), Some(p)) => {
                    row.images += 1;
                    row.evaluation.record(*count, &p);
                }
                (Some(_), None) => {
                    row.images += 1;
                    row.without_hand += 1;
                }
            }
        }
        println!("{row}");
        self.rows.push(row);
        Ok(())
    }
}

impl Row {
    fn accuracy(&self) -> Option<Proportion> {
        let right =
            self.evaluation.accuracy().map_or(0.0, |a| a.value) * (self.images - self.without_hand) as f64;
        Proportion::wilson(right.round() as u64, self.images)
    }
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |share: f64| format!("{:.1} %", 100.0 * share);
        let accuracy = self.accuracy().map_or("-".to_owned(), |a| {
            format!("{} ({:.1} to {:.1})", percent(a.value), 100.0 * a.low, 100.0 * a.high)
        });
        let missed =
            if self.images > 0 { percent(self.without_hand as f64 / self.images as f64) } else { "-".into() };
        let error = self.evaluation.calibration_error().map_or("-".to_owned(), |error| format!("{error:.3}"));
        let alarms =
            if self.empty > 0 { percent(self.alarms as f64 / self.empty as f64) } else { "-".into() };
        write!(
            f,
            "| {} | {} | {accuracy} | {missed} | {error} | {alarms} |",
            self.set,
            self.images + self.empty
        )
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "| set | pictures | right, of all with a hand | no hand found | calibration error | false alarms |"
        )?;
        writeln!(f, "|---|---|---|---|---|---|")?;
        self.rows.iter().try_for_each(|row| writeln!(f, "{row}"))?;
        let all: Vec<f64> = self.rows.iter().filter_map(|row| Some(row.accuracy()?.value)).collect();
        if all.len() > 1 {
            let mean = 100.0 * all.iter().sum::<f64>() / all.len() as f64;
            let least = 100.0 * all.iter().fold(1.0, |a: f64, b| a.min(*b));
            writeln!(f, "mean {mean:.1} %, least {least:.1} %")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_judged_by_pictures_that_the_eyes_were_made_with() {
        let folder = tempfile::tempdir().unwrap();
        let write = |file: &str| {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, file).unwrap();
            LabelledImage { path, class: ClassId(0), person: None }.fingerprint().unwrap()
        };
        let mut images = ["3/seen.jpg", "none/seen.jpg"].map(write).to_vec();
        images.sort_unstable();
        let known = Origin { images, ..Origin::default() };
        for new in ["3/new.jpg", "0/new.jpg", "none/new.jpg"] {
            write(new);
        }
        let vocabulary = Vocabulary::new(["0", "1", "2", "3"]).unwrap();
        let judged = |eyes: &Origin| unseen(folder.path(), &vocabulary, eyes).unwrap();
        let (kept, left_out) = judged(&known);
        assert!(kept.iter().all(|(path, _)| path.ends_with("new.jpg")), "{kept:?}");
        let shown: Vec<_> = kept.into_iter().map(|(_, count)| count).collect();
        assert_eq!((shown, left_out), (vec![Some(ClassId(0)), Some(ClassId(3)), None], 2));
        assert_eq!(judged(&Origin::default()).1, 0);
    }
}
