//! A trained classifier.

use std::sync::Arc;

use gestalt_mind::{ModelFile, Origin};
use gestalt_strategies::{Classifier, Classify};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::errors::{data, model};
use crate::numbers::{Matrix, doubles};

/// A trained classifier: it judges, and does not change.
#[pyclass(frozen, module = "gestalt_swarm._native")]
pub(crate) struct Model {
    pub classifier: Arc<Classifier>,
    origin: Origin,
}

impl Model {
    pub(crate) fn new(classifier: Arc<Classifier>, origin: Origin) -> Self {
        Self { classifier, origin }
    }

    pub(crate) fn origin(&self) -> &Origin {
        &self.origin
    }
}

#[pymethods]
impl Model {
    /// Reads the bytes of a model file, as `gestalt train` writes it.
    #[staticmethod]
    fn decode(py: Python<'_>, file: &[u8]) -> PyResult<Self> {
        let file = py.detach(|| ModelFile::decode(file)).map_err(model)?;
        Ok(Self::new(Arc::new(file.classifier), file.origin))
    }

    /// The bytes of a model file, as `gestalt peer --model` reads it.
    fn encode<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let (classifier, origin) = (Classifier::clone(&self.classifier), self.origin.clone());
        PyBytes::new(py, &py.detach(|| ModelFile { classifier, origin }.encode()))
    }

    /// The gestures, in the order of their probabilities.
    #[getter]
    fn labels(&self) -> Vec<String> {
        self.classifier.vocabulary().labels().to_vec()
    }

    /// How many features it takes.
    #[getter]
    fn features(&self) -> usize {
        self.classifier.space().features()
    }

    /// How many coordinates its feature space has.
    #[getter]
    fn components(&self) -> usize {
        self.classifier.space().components()
    }

    /// Names what the coordinates mean, 16 hexadecimal digits.
    #[getter]
    fn space(&self) -> String {
        self.classifier.space().id().to_string()
    }

    /// How many samples of each gesture it has learned from.
    #[getter]
    fn learned(&self) -> Vec<u32> {
        self.classifier.learned().to_vec()
    }

    /// How many support vectors all pairs of gestures share.
    #[getter]
    fn support_vectors(&self) -> usize {
        self.classifier.support_vectors()
    }

    /// The probability of each gesture, for each row of single-precision features; as double precision, row by row.
    fn probabilities<'py>(&self, py: Python<'py>, rows: &[u8]) -> PyResult<Bound<'py, PyBytes>> {
        let matrix = Matrix::read(rows, self.features())?;
        let judged = py.detach(|| {
            let each = matrix.rows().map(|row| self.classifier.probabilities(row));
            each.collect::<Result<Vec<_>, _>>().map(|judged| doubles(&judged.concat()))
        });
        Ok(PyBytes::new(py, &judged.map_err(data)?))
    }

    /// The coordinates of each row in the feature space, in single precision, row by row: what samples hold.
    fn coordinates<'py>(&self, py: Python<'py>, rows: &[u8]) -> PyResult<Bound<'py, PyBytes>> {
        let matrix = Matrix::read(rows, self.features())?;
        let projected = py.detach(|| {
            let each = matrix.rows().map(|row| self.classifier.space().project(row));
            each.collect::<Result<Vec<_>, _>>()
        });
        let projected: Vec<u8> =
            projected.map_err(data)?.into_iter().flatten().flat_map(f32::to_ne_bytes).collect();
        Ok(PyBytes::new(py, &projected))
    }
}
