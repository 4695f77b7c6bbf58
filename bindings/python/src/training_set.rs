//! The samples a robot learns from.

use std::sync::Mutex;

use gestalt_protocol::{ClassId, RobotId, RoundId, SampleId};
use gestalt_strategies::{Classify, SampleReceipt, SetChange, TrainingSet as Samples};
use pyo3::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::errors::{broken, data, settings};
use crate::model::Model;
use crate::numbers::check_finite;
use crate::rules::{Raised, forgetting, selection};
use crate::sample::Sample;

/// The bounded set of samples of one robot.
#[pyclass(module = "gestalt_swarm._native")]
pub(crate) struct TrainingSet {
    /// Rules are one thread's at a time; Python's own borrows see to it that nobody waits. A panic poisons it.
    samples: Mutex<Samples>,
    rng: ChaCha8Rng,
    raised: Raised,
    /// How many coordinates each has, once one was taken in.
    width: Option<usize>,
}

#[pymethods]
impl TrainingSet {
    #[new]
    #[pyo3(signature = (robot, capacity, selection_rule, forgetting_rule, seed))]
    fn new(
        robot: u32,
        capacity: usize,
        selection_rule: &Bound<'_, PyAny>,
        forgetting_rule: &Bound<'_, PyAny>,
        seed: u64,
    ) -> PyResult<Self> {
        if !(1..=100_000).contains(&capacity) {
            return Err(settings(format!("capacity is {capacity}: choose from 1 to 100000")));
        }
        let raised = Raised::default();
        let (selection, forgetting) =
            (selection(selection_rule, &raised)?, forgetting(forgetting_rule, &raised)?);
        let samples = Mutex::new(Samples::new(RobotId(robot), capacity, selection, forgetting));
        Ok(Self { samples, rng: ChaCha8Rng::seed_from_u64(seed), raised, width: None })
    }

    /// Takes an own sample in; gives those that were forgotten for it.
    fn keep(&mut self, py: Python<'_>, class_: u32, round: &str, vector: Vec<f32>) -> PyResult<Vec<Sample>> {
        let (class, round) = (class(class_)?, round_of(round)?);
        let width = self.fits(&vector)?;
        let changes = self.with(py, |samples, rng| samples.keep(class, round, vector, rng))?;
        self.width = Some(width);
        self.raised.check()?;
        Ok(forgotten(&changes))
    }

    /// Selects up to `count` personal samples, which become shared; gives these, in the order of their choice.
    #[pyo3(signature = (count, model=None))]
    fn share(&mut self, py: Python<'_>, count: usize, model: Option<&Model>) -> PyResult<Vec<Sample>> {
        let classifier = model.map(|model| &*model.classifier);
        if let (Some(classifier), Some(width)) = (classifier, self.width)
            && classifier.space().components() != width
        {
            let components = classifier.space().components();
            return Err(data(format!("samples of {width} coordinates, the model's space has {components}")));
        }
        let shared = self.with(py, |samples, rng| {
            let classifier = classifier.map(|classifier| classifier as &dyn Classify);
            let changes = samples.share(count, classifier, &<[f32]>::to_vec, rng);
            let shared = changes.iter().filter_map(|change| match change {
                SetChange::Shared(key, _) => samples.get(*key).map(Sample::from),
                _ => None,
            });
            shared.collect::<Vec<_>>()
        })?;
        self.raised.check()?;
        Ok(shared)
    }

    /// Takes a shared sample in, unless it was seen before: whether it was new.
    fn receive(
        &mut self,
        py: Python<'_>,
        id: (u32, u32, u32),
        class_: u32,
        round: &str,
        vector: Vec<f32>,
    ) -> PyResult<bool> {
        let (author, life, number) = id;
        let id = SampleId { author: RobotId(author), life, number };
        let (class, round) = (class(class_)?, round_of(round)?);
        let width = self.fits(&vector)?;
        let receipt = self.with(py, |samples, rng| samples.receive(id, class, round, vector, rng))?;
        if matches!(receipt, SampleReceipt::New(_)) {
            self.width = Some(width);
        }
        self.raised.check()?;
        match receipt {
            SampleReceipt::New(_) => Ok(true),
            SampleReceipt::Known => Ok(false),
            SampleReceipt::Refused(error) => Err(data(error)),
        }
    }

    /// Gives all samples of a round another class: how many had another.
    fn relabel(&mut self, round: &str, class_: u32) -> PyResult<usize> {
        let (round, class) = (round_of(round)?, class(class_)?);
        self.peek(|samples| samples.relabel(round, class).len())
    }

    /// Removes all samples of a round; they stay seen. Gives these.
    fn retract(&mut self, round: &str) -> PyResult<Vec<Sample>> {
        let round = round_of(round)?;
        Ok(forgotten(&self.peek(|samples| samples.retract(round))?))
    }

    /// All samples, by key.
    fn samples(&mut self) -> PyResult<Vec<Sample>> {
        self.peek(|samples| samples.iter().map(Sample::from).collect())
    }

    #[getter]
    fn capacity(&mut self) -> PyResult<usize> {
        self.peek(|samples| samples.capacity())
    }

    fn __len__(&mut self) -> PyResult<usize> {
        self.peek(|samples| samples.len())
    }
}

impl TrainingSet {
    /// Works on the samples while other threads run. What a rule in Python raised is still to be told.
    fn with<T: Send>(
        &mut self,
        py: Python<'_>,
        call: impl FnOnce(&mut Samples, &mut ChaCha8Rng) -> T + Send,
    ) -> PyResult<T> {
        let (lock, rng) = (&self.samples, &mut self.rng);
        let done = py.detach(|| {
            let mut samples = lock.lock().ok()?;
            Some(call(&mut samples, rng))
        });
        done.ok_or_else(|| broken("training set"))
    }

    /// Does what asks no rule and takes no time.
    fn peek<T>(&mut self, call: impl FnOnce(&mut Samples) -> T) -> PyResult<T> {
        let mut samples = self.samples.lock().map_err(|_| broken("training set"))?;
        Ok(call(&mut samples))
    }

    /// How many coordinates there are, if a vector may stand beside the others.
    fn fits(&self, vector: &[f32]) -> PyResult<usize> {
        check_finite(vector, vector.len())?;
        let width = self.width.unwrap_or(vector.len());
        if width == 0 || vector.len() != width {
            return Err(data(format!("a vector of {} coordinates, the set has {width}", vector.len())));
        }
        Ok(width)
    }
}

fn class(class: u32) -> PyResult<ClassId> {
    let class = ClassId(class);
    if class.is_possible() {
        Ok(class)
    } else {
        Err(data(format!("class {class}: no gesture has that number")))
    }
}

fn round_of(round: &str) -> PyResult<RoundId> {
    round.parse().map_err(data)
}

fn forgotten(changes: &[SetChange]) -> Vec<Sample> {
    let gone = changes.iter().filter_map(|change| match change {
        SetChange::Removed(sample) => Some(Sample::from(sample)),
        _ => None,
    });
    gone.collect()
}
