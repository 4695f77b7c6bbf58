//! The samples a robot learns from.

use std::sync::{Mutex, PoisonError};

use gestalt_protocol::{ClassId, RobotId, RoundId, SampleId};
use gestalt_strategies::{Classify, SampleReceipt, SetChange, TrainingSet as Samples};
use pyo3::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::errors::{data, settings};
use crate::model::Model;
use crate::numbers::check_finite;
use crate::rules::{Raised, forgetting, selection};
use crate::sample::Sample;

/// The bounded set of samples of one robot.
#[pyclass(module = "gestalt_swarm._native")]
pub(crate) struct TrainingSet {
    /// Rules are one thread's at a time; Python's own borrows see to it that nobody waits.
    samples: Mutex<Samples>,
    rng: ChaCha8Rng,
    raised: Raised,
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
    fn keep(&mut self, class_: u32, round: &str, vector: Vec<f32>) -> PyResult<Vec<Sample>> {
        let (class, round) = (class(class_)?, round_of(round)?);
        self.fits(&vector)?;
        let (samples, rng) = self.parts();
        let changes = samples.keep(class, round, vector, rng);
        self.raised.check()?;
        Ok(forgotten(&changes))
    }

    /// Selects up to `count` personal samples, which become shared; gives these, in the order of their choice.
    #[pyo3(signature = (count, model=None))]
    fn share(&mut self, count: usize, model: Option<&Model>) -> PyResult<Vec<Sample>> {
        let classifier = model.map(|model| &*model.classifier);
        if let (Some(classifier), Some(width)) = (classifier, self.width)
            && classifier.space().components() != width
        {
            let components = classifier.space().components();
            return Err(data(format!("samples of {width} coordinates, the model's space has {components}")));
        }
        let (samples, rng) = self.parts();
        let classifier = classifier.map(|classifier| classifier as &dyn Classify);
        let changes = samples.share(count, classifier, &<[f32]>::to_vec, rng);
        let shared = changes.iter().filter_map(|change| match change {
            SetChange::Shared(key, _) => samples.get(*key).map(Sample::from),
            _ => None,
        });
        let shared = shared.collect();
        self.raised.check()?;
        Ok(shared)
    }

    /// Takes a shared sample in, unless it was seen before: whether it was new.
    fn receive(&mut self, id: (u32, u32, u32), class_: u32, round: &str, vector: Vec<f32>) -> PyResult<bool> {
        let (author, life, number) = id;
        let id = SampleId { author: RobotId(author), life, number };
        let (class, round) = (class(class_)?, round_of(round)?);
        self.fits(&vector)?;
        let (samples, rng) = self.parts();
        let receipt = samples.receive(id, class, round, vector, rng);
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
        Ok(self.parts().0.relabel(round, class).len())
    }

    /// Removes all samples of a round; they stay seen. Gives these.
    fn retract(&mut self, round: &str) -> PyResult<Vec<Sample>> {
        let round = round_of(round)?;
        Ok(forgotten(&self.parts().0.retract(round)))
    }

    /// All samples, by key.
    fn samples(&mut self) -> Vec<Sample> {
        self.parts().0.iter().map(Sample::from).collect()
    }

    #[getter]
    fn capacity(&mut self) -> usize {
        self.parts().0.capacity()
    }

    fn __len__(&mut self) -> usize {
        self.parts().0.len()
    }
}

impl TrainingSet {
    fn parts(&mut self) -> (&mut Samples, &mut ChaCha8Rng) {
        (self.samples.get_mut().unwrap_or_else(PoisonError::into_inner), &mut self.rng)
    }

    /// Whether a vector may stand beside the others.
    fn fits(&mut self, vector: &[f32]) -> PyResult<()> {
        check_finite(vector, vector.len())?;
        let width = self.width.unwrap_or(vector.len());
        if width == 0 || vector.len() != width {
            return Err(data(format!("a vector of {} coordinates, the set has {width}", vector.len())));
        }
        self.width = Some(width);
        Ok(())
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
