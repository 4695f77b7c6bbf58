//! What learning on the spot costs, beside LIBSVM's `svm-train` (Debian package `libsvm-tools`) on the same samples:
//! `cargo bench -p gestalt-svm --bench learner`.
//!
//! 1,000 samples of 6 classes with 40 coordinates unless said otherwise. `svm-train` is a process: it starts, reads
//! the samples from a file and writes its model. What that alone costs says `svm_train_without_training`.

use std::cell::RefCell;
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;
use std::process::Command;
use std::sync::Arc;

use divan::Bencher;
use gestalt_protocol::ClassId;
use gestalt_rounds::{Classify, Vocabulary};
use gestalt_svm::{Components, DiscriminantSums, FeatureSpace, Learner, LearnerOptions, ScalingMethod};
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

const CLASSES: usize = 6;
const WIDTH: usize = 40;
const SAMPLES: usize = 1000;
/// Noise about the centres of the classes: of 1,000 new samples, 999 and 900 are judged right.
const NOISE: [(&str, f32); 2] = [("easy", 1.0), ("overlapping", 2.2)];

fn main() {
    divan::main();
}

/// Samples of classes in turn, without end.
struct Source {
    rng: ChaCha8Rng,
    centres: Vec<Vec<f32>>,
    noise: f32,
    space: Arc<FeatureSpace>,
    given: usize,
}

impl Source {
    fn new(kind: &str) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let noise = NOISE.iter().find(|(name, _)| *name == kind).expect("one of the two").1;
        let centres: Vec<Vec<f32>> =
            (0..CLASSES).map(|_| (0..WIDTH).map(|_| normal(&mut rng)).collect()).collect();
        let rows: Vec<Vec<f32>> = (0..SAMPLES).map(|i| raw(&centres[i % CLASSES], noise, &mut rng)).collect();
        let rows = rows.iter().map(Vec::as_slice);
        let keep = Components::Count(WIDTH);
        let space = Arc::new(FeatureSpace::fit("bench-1", rows, ScalingMethod::PerComponent, keep, &mut rng));
        Self { rng, centres, noise, space, given: 0 }
    }

    fn next(&mut self) -> (ClassId, Vec<f32>) {
        let class = self.given % CLASSES;
        self.given += 1;
        let features = raw(&self.centres[class], self.noise, &mut self.rng);
        (ClassId(class as u32), self.space.project(&features).expect("features of the space"))
    }

    fn take(&mut self, count: usize) -> Vec<(ClassId, Vec<f32>)> {
        (0..count).map(|_| self.next()).collect()
    }

    fn learner(&self, samples: &[(ClassId, Vec<f32>)]) -> Learner {
        let vocabulary = Vocabulary::new((0..CLASSES).map(|k| k.to_string())).expect("different labels");
        let mut learner =
            Learner::new(self.space.clone(), vocabulary, LearnerOptions::default()).expect("good options");
        for (key, (class, vector)) in (0..).zip(samples) {
            learner.insert(key, *class, vector).expect("a good sample");
        }
        learner
    }
}

/// About a standard normal variable: the sum of twelve uniform ones.
fn normal(rng: &mut impl Rng) -> f32 {
    (0..12).map(|_| rng.random_range(-0.5_f32..0.5)).sum()
}

fn raw(centre: &[f32], noise: f32, rng: &mut impl Rng) -> Vec<f32> {
    centre.iter().map(|c| c + noise * normal(rng)).collect()
}

/// Kernel matrix, machines and probabilities.
#[divan::bench(args = [("easy", 50), ("overlapping", 50), ("easy", 1000), ("overlapping", 1000)])]
fn from_nothing(bencher: Bencher, (kind, count): (&str, usize)) {
    let mut source = Source::new(kind);
    let samples = source.take(count);
    bencher.bench_local(|| source.learner(&samples).learn());
}

/// A learner that is taught for ever: each round, the oldest sample of each class makes way for a new one, which are
/// 12 changes.
struct Taught {
    source: Source,
    learner: Learner,
    oldest: u64,
}

impl Taught {
    fn new(kind: &str, count: usize) -> RefCell<Self> {
        let mut source = Source::new(kind);
        let samples = source.take(count - count % CLASSES);
        let mut learner = source.learner(&samples);
        learner.learn().expect("nothing fails");
        RefCell::new(Self { source, learner, oldest: 0 })
    }

    fn change(&mut self) {
        let newest = self.oldest + self.learner.len() as u64;
        for i in 0..CLASSES as u64 {
            let (class, vector) = self.source.next();
            self.learner.remove(self.oldest + i);
            self.learner.insert(newest + i, class, &vector).expect("a good sample");
        }
        self.oldest += CLASSES as u64;
    }
}

/// `learn` after a round, with the classifier.
#[divan::bench(args = [("easy", 50), ("overlapping", 50), ("easy", 1000), ("overlapping", 1000)])]
fn after_a_round(bencher: Bencher, (kind, count): (&str, usize)) {
    let taught = Taught::new(kind, count);
    bencher
        .with_inputs(|| taught.borrow_mut().change())
        .bench_local_values(|()| taught.borrow_mut().learner.learn());
}

/// What the head for few takes of a change: a sample out and one in, its sums and the discriminant that they make; without the kernel and the machines.
#[divan::bench]
fn change_of_the_head(bencher: Bencher) {
    let mut source = Source::new("overlapping");
    let mut sums = DiscriminantSums::new(&source.space, CLASSES);
    for (key, (class, vector)) in (0_u64..).zip(source.take(SAMPLES)) {
        sums.insert(key, class.index(), key / 4, &vector);
    }
    let (mut oldest, next) = (0, source.take(SAMPLES));
    bencher.bench_local(|| {
        let (class, vector) = &next[oldest as usize % SAMPLES];
        sums.remove(oldest);
        sums.insert(oldest + SAMPLES as u64, class.index(), (oldest + SAMPLES as u64) / 4, vector);
        oldest += 1;
        sums.discriminant()
    });
}

/// One frame judged whole: probabilities, unknown and view; and what is said of unknown alone.
#[divan::bench(args = ["judge", "unknown", "probabilities"])]
fn frame(bencher: Bencher, what: &str) {
    let taught = Taught::new("overlapping", SAMPLES);
    let mut taught = taught.borrow_mut();
    let classifier = taught.learner.learn().expect("nothing fails");
    let features = raw(&taught.source.centres[0].clone(), 2.2, &mut taught.source.rng);
    bencher.bench_local(|| match what {
        "judge" => drop(divan::black_box(classifier.judge(&features))),
        "unknown" => drop(divan::black_box(classifier.unknown(&features))),
        _ => drop(divan::black_box(classifier.probabilities(&features))),
    });
}

/// Six samples out and six in.
#[divan::bench]
fn change_of_a_round(bencher: Bencher) {
    let taught = Taught::new("overlapping", SAMPLES);
    bencher.bench_local(|| taught.borrow_mut().change());
}

/// Machines only.
#[divan::bench(args = ["easy", "overlapping"])]
fn svm_train(bencher: Bencher, kind: &str) {
    libsvm(bencher, kind, "");
}

/// Machines and probabilities.
#[divan::bench(args = ["easy", "overlapping"], sample_count = 20)]
fn svm_train_probabilities(bencher: Bencher, kind: &str) {
    libsvm(bencher, kind, "-b 1");
}

/// Start, reading and writing: with this tolerance, the first machine will do.
#[divan::bench(args = ["easy", "overlapping"])]
fn svm_train_without_training(bencher: Bencher, kind: &str) {
    libsvm(bencher, kind, "-e 1000");
}

fn libsvm(bencher: Bencher, kind: &str, options: &str) {
    if Command::new("svm-train").output().is_err() {
        eprintln!("LIBSVM is skipped: svm-train is not installed (Debian package libsvm-tools)");
        return;
    }
    let mut source = Source::new(kind);
    let mut text = String::new();
    for (class, vector) in source.take(SAMPLES) {
        write!(text, "{class}").expect("a string takes all");
        for (index, value) in vector.iter().enumerate() {
            write!(text, " {}:{value}", index + 1).expect("a string takes all");
        }
        text.push('\n');
    }
    let folder: PathBuf = std::env::temp_dir().join(format!("gestalt-bench-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a folder for temporary files");
    fs::write(folder.join("samples"), text).expect("room for the samples");
    let gamma = 1.0 / source.space.variance();
    let arguments = format!("-q -c 10 -g {gamma} {options} samples model");
    bencher.bench_local(|| {
        let arguments = arguments.split_whitespace();
        let status = Command::new("svm-train").args(arguments).current_dir(&folder).status();
        assert!(status.is_ok_and(|status| status.success()));
    });
    fs::remove_dir_all(&folder).expect("the folder made above");
}
