//! Side by side with LIBSVM's `svm-train -b 1` on the same reduced samples; skipped where it is not installed.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

use gestalt_protocol::ClassId;
use gestalt_strategies::{Classifier, Classify, Evaluation, Sample, TrainOptions, Vocabulary, train};
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

const CLASSES: usize = 5;

/// Classes on a circle in 6 features: each person shifts them all, so that people never
/// seen are harder than more of the same.
fn samples(people: std::ops::Range<u32>, rng: &mut impl Rng) -> Vec<Sample> {
    let mut normal = || (0..12).map(|_| rng.random_range(-0.5_f32..0.5)).sum::<f32>();
    let mut samples = Vec::new();
    for person in people {
        let shift: Vec<f32> = (0..6).map(|_| 0.3 * normal()).collect();
        for class in 0..CLASSES {
            let angle = class as f32 / CLASSES as f32 * std::f32::consts::TAU;
            for _ in 0..3 {
                let mut features: Vec<f32> = shift.iter().map(|shift| shift + 0.4 * normal()).collect();
                features[0] += angle.cos();
                features[1] += angle.sin();
                samples.push(Sample { features, class: ClassId(class as u8), group: Some(person) });
            }
        }
    }
    samples
}

fn write(path: &Path, classifier: &Classifier, samples: &[Sample]) {
    let mut text = String::new();
    for sample in samples {
        write!(text, "{}", sample.class).unwrap();
        for (index, value) in classifier.reduce(&sample.features).unwrap().iter().enumerate() {
            write!(text, " {}:{value}", index + 1).unwrap();
        }
        text.push('\n');
    }
    fs::write(path, text).unwrap();
}

/// The first line names the classes by column; then, per sample, the answer and a probability per column.
fn read(path: &Path, samples: &[Sample]) -> Evaluation {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines().map(|line| line.split_whitespace().skip(1));
    let columns: Vec<usize> = lines.next().unwrap().map(|label| label.parse().unwrap()).collect();
    let mut evaluation = Evaluation::new(CLASSES);
    for (line, sample) in lines.zip(samples) {
        let mut probabilities = [0.0; CLASSES];
        for (value, column) in line.zip(&columns) {
            probabilities[*column] = value.parse().unwrap();
        }
        evaluation.record(sample.class, &probabilities);
    }
    evaluation
}

#[test]
fn it_judges_as_well_as_libsvm_and_promises_no_more_than_it_keeps() {
    if Command::new("svm-train").output().is_err() {
        eprintln!("skipped: svm-train is not installed (Debian package libsvm-tools)");
        return;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let (learned, unseen) = (samples(0..60, &mut rng), samples(60..300, &mut rng));
    let vocabulary = Vocabulary::new((0..CLASSES).map(|k| k.to_string())).unwrap();
    // One pair of parameters, so that both solve the same problem.
    let options = TrainOptions { costs: vec![4.0], gammas: vec![1.0], ..TrainOptions::default() };
    let trained = train("toy-1", &vocabulary, &learned, &options, &mut rng, |_| ()).unwrap();
    let classifier = trained.classifier;
    let mut ours = Evaluation::new(CLASSES);
    for sample in &unseen {
        ours.record(sample.class, &classifier.probabilities(&sample.features).unwrap());
    }

    let folder = std::env::temp_dir().join(format!("gestalt-libsvm-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let file = |name: &str| folder.join(name);
    write(&file("learned"), &classifier, &learned);
    write(&file("unseen"), &classifier, &unseen);
    let squares = |s: &Sample| -> f64 {
        classifier.reduce(&s.features).unwrap().iter().map(|x| f64::from(x * x)).sum()
    };
    let gamma = learned.len() as f64 / learned.iter().map(squares).sum::<f64>();
    let run = |command: &mut Command| assert!(command.current_dir(&folder).status().unwrap().success());
    run(Command::new("svm-train").args([
        "-q",
        "-b",
        "1",
        "-c",
        "4",
        "-g",
        &gamma.to_string(),
        "learned",
        "model",
    ]));
    run(Command::new("svm-predict").args(["-q", "-b", "1", "unseen", "model", "out"]));
    let theirs = read(&file("out"), &unseen);
    fs::remove_dir_all(&folder).unwrap();

    let of =
        |e: &Evaluation| (e.accuracy().unwrap().value, e.calibration_error().unwrap(), e.log_loss().unwrap());
    let ((accuracy, error, loss), (their_accuracy, their_error, their_loss)) = (of(&ours), of(&theirs));
    eprintln!("accuracy {accuracy:.3} against {their_accuracy:.3}");
    eprintln!("calibration error {error:.3} against {their_error:.3}");
    eprintln!("log loss {loss:.3} against {their_loss:.3}");
    assert!((0.6..0.95).contains(&accuracy), "the classes should overlap");
    assert!((accuracy - their_accuracy).abs() <= 0.01);
    assert!(error <= 0.05);
    assert!(loss <= their_loss + 0.01);
}
