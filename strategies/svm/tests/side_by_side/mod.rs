//! Runs LIBSVM's `svm-train -b 1` and `svm-predict -b 1` (Debian package `libsvm-tools`) on the reduced samples of a
//! classifier of ours.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

use gestalt_rounds::Classify;
use gestalt_svm::{Classifier, Evaluation, LabelledFeatures};

/// How LIBSVM judges `unseen` after learning `learned`, with this C and γ (in our unit); `None` where it is not
/// installed.
pub fn libsvm(
    classifier: &Classifier,
    (cost, gamma): (f64, f64),
    learned: &[LabelledFeatures],
    unseen: &[LabelledFeatures],
    name: &str,
) -> Option<Evaluation> {
    if Command::new("svm-train").output().is_err() {
        eprintln!("LIBSVM is skipped: svm-train is not installed (Debian package libsvm-tools)");
        return None;
    }
    let folder = std::env::temp_dir().join(format!("gestalt-libsvm-{name}-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    write(&folder.join("learned"), classifier, learned);
    write(&folder.join("unseen"), classifier, unseen);
    let squares = |sample: &LabelledFeatures| -> f64 {
        classifier.space().project(&sample.features).unwrap().iter().map(|x| f64::from(x * x)).sum()
    };
    let gamma = gamma * learned.len() as f64 / learned.iter().map(squares).sum::<f64>();
    let run = |program: &str, arguments: &str| {
        let mut command = Command::new(program);
        command.args(arguments.split(' ')).current_dir(&folder);
        assert!(command.status().unwrap().success(), "{program} {arguments}");
    };
    run("svm-train", &format!("-q -b 1 -c {cost} -g {gamma} learned model"));
    run("svm-predict", "-q -b 1 unseen model out");
    let evaluation = read(&folder.join("out"), unseen, classifier.vocabulary().classes());
    fs::remove_dir_all(&folder).unwrap();
    Some(evaluation)
}

/// One line on stderr.
pub fn print(who: &str, evaluation: &Evaluation) {
    eprintln!(
        "{who:>8}: accuracy {:.3}, calibration error {:.3}, log loss {:.3}",
        evaluation.accuracy().unwrap().value,
        evaluation.calibration_error().unwrap(),
        evaluation.log_loss().unwrap()
    );
}

fn write(path: &Path, classifier: &Classifier, samples: &[LabelledFeatures]) {
    let mut text = String::new();
    for sample in samples {
        write!(text, "{}", sample.class).unwrap();
        for (index, value) in classifier.space().project(&sample.features).unwrap().iter().enumerate() {
            write!(text, " {}:{value}", index + 1).unwrap();
        }
        text.push('\n');
    }
    fs::write(path, text).unwrap();
}

/// The first line names the classes by column; then, per sample, the answer and a probability per column.
fn read(path: &Path, samples: &[LabelledFeatures], classes: usize) -> Evaluation {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines().map(|line| line.split_whitespace().skip(1));
    let columns: Vec<usize> = lines.next().unwrap().map(|label| label.parse().unwrap()).collect();
    let mut evaluation = Evaluation::new(classes);
    for (line, sample) in lines.zip(samples) {
        let mut probabilities = vec![0.0; classes];
        for (value, column) in line.zip(&columns) {
            probabilities[*column] = value.parse().unwrap();
        }
        evaluation.record(sample.class, &probabilities);
    }
    evaluation
}
