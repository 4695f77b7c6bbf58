//! Learning on the spot: machines that follow samples as they come.

use std::sync::Arc;

use gestalt_mind::Origin;
use gestalt_protocol::ClassId;
use gestalt_strategies::{
    Classify, Components, FeatureSpace, Learner as Machines, LearnerOptions, ScalingMethod, Vocabulary,
};
use pyo3::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::errors::{data, settings};
use crate::model::Model;
use crate::numbers::Matrix;

/// The most features a space takes.
const MAX_FEATURES: usize = 65_536;

/// Learns from samples that come, in one feature space.
#[pyclass(module = "gestalt_swarm._native")]
pub(crate) struct Learner {
    machines: Machines,
    origin: Origin,
    next_key: u64,
}

fn options(cost: f64, gamma: f64, folds: usize, staleness: f64) -> PyResult<LearnerOptions> {
    let options = LearnerOptions { cost, gamma, folds, staleness, ..LearnerOptions::default() };
    options.validate().map_err(settings)?;
    Ok(options)
}

#[pymethods]
impl Learner {
    /// Fits a feature space on these rows, in which it will learn these gestures. A number of `components` below 1 is the part of the
    /// variance to keep.
    #[new]
    #[pyo3(signature = (labels, rows, width, *, scaling, components, cost, gamma, folds, staleness, seed, feature_set))]
    #[expect(clippy::too_many_arguments, reason = "the facade names them all")]
    fn new(
        py: Python<'_>,
        labels: Vec<String>,
        rows: &[u8],
        width: usize,
        scaling: &str,
        components: f64,
        cost: f64,
        gamma: f64,
        folds: usize,
        staleness: f64,
        seed: u64,
        feature_set: &str,
    ) -> PyResult<Self> {
        let vocabulary = Vocabulary::new(labels).map_err(settings)?;
        let options = options(cost, gamma, folds, staleness)?;
        let scaling = match scaling {
            "per_component" => ScalingMethod::PerComponent,
            "common" => ScalingMethod::Common,
            other => return Err(settings(format!("'{other}' is no scaling: take per_component or common"))),
        };
        let keep = match components {
            part if part > 0.0 && part < 1.0 => Components::Variance(part),
            count if count >= 1.0 && count.fract() == 0.0 && count <= MAX_FEATURES as f64 => {
                Components::Count(count as usize)
            }
            other => {
                return Err(settings(format!(
                    "components is {other}: choose a whole number, or a part of the variance between 0 and 1"
                )));
            }
        };
        if !(1..=64).contains(&feature_set.len()) {
            return Err(settings("the name of the feature set is not 1 to 64 bytes"));
        }
        if width > MAX_FEATURES {
            return Err(data(format!("{width} features, at most {MAX_FEATURES} are learned from")));
        }
        let matrix = Matrix::read(rows, width)?;
        if matrix.rows().len() < 2 {
            return Err(data("a feature space is fitted on at least 2 samples"));
        }
        let machines = py.detach(|| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let space = FeatureSpace::fit(feature_set, matrix.rows(), scaling, keep, &mut rng);
            Machines::new(Arc::new(space), vocabulary, options)
        });
        let origin = Origin { dataset: "Python".to_owned(), seed, cost, gamma, ..Origin::default() };
        Ok(Self { machines: machines.map_err(data)?, origin, next_key: 0 })
    }

    /// Starts from what a model knows: its support vectors.
    #[staticmethod]
    #[pyo3(signature = (model, *, cost, gamma, folds, staleness))]
    fn on(
        py: Python<'_>,
        model: &Model,
        cost: f64,
        gamma: f64,
        folds: usize,
        staleness: f64,
    ) -> PyResult<Self> {
        let options = options(cost, gamma, folds, staleness)?;
        let classifier = &model.classifier;
        let machines = py.detach(|| {
            let mut machines =
                Machines::new(classifier.space().clone(), classifier.vocabulary().clone(), options)?;
            machines.build_on(classifier).map(|()| machines)
        });
        Ok(Self { machines: machines.map_err(data)?, origin: model.origin().clone(), next_key: 0 })
    }

    /// Takes in samples: rows of features, and the class of each as a byte. Either all or none.
    fn insert(&mut self, py: Python<'_>, rows: &[u8], classes: &[u8]) -> PyResult<()> {
        let space = self.machines.space().clone();
        let matrix = Matrix::read(rows, space.features())?;
        if matrix.rows().len() != classes.len() {
            return Err(data(format!("{} samples and {} classes", matrix.rows().len(), classes.len())));
        }
        let machines = &mut self.machines;
        let (first, before) = (self.next_key, self.next_key);
        let inserted = py.detach(|| {
            for (key, (row, class)) in (first..).zip(matrix.rows().zip(classes)) {
                let vector = space.project(row).map_err(|error| (key, error.to_string()))?;
                machines
                    .insert(key, ClassId((*class).into()), &vector)
                    .map_err(|error| (key, error.to_string()))?;
            }
            Ok(())
        });
        if let Err((reached, error)) = inserted {
            (before..reached).for_each(|key| {
                self.machines.remove(key);
            });
            let error: String = error;
            return Err(data(error));
        }
        self.next_key += classes.len() as u64;
        Ok(())
    }

    /// Brings the machines up to date, and gives a model that judges as they do.
    fn learn(&mut self, py: Python<'_>) -> PyResult<Model> {
        let machines = &mut self.machines;
        let classifier = py.detach(|| machines.learn()).map_err(data)?;
        Ok(Model::new(classifier, self.origin.clone()))
    }

    fn __len__(&self) -> usize {
        self.machines.len()
    }
}
