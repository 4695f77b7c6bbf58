//! The mind of a robot.

use std::sync::Mutex;
use std::time::Duration;

use gestalt_mind::{MindError, OutgoingMessage, PortableMind, Settings};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::errors::{broken, of_mind};
use crate::model::Model;
use crate::rules::{Raised, for_mind};

/// Key, payload, to whom, and whether the payload is JSON.
type Carried<'py> = (String, Bound<'py, PyBytes>, Option<u32>, bool);

/// The mind of one robot; times are nanoseconds since any fixed moment.
#[pyclass(module = "gestalt_swarm._native")]
pub(crate) struct Mind {
    /// Rules are one thread's at a time; Python's own borrows see to it that nobody waits. A panic poisons it.
    mind: Mutex<PortableMind>,
    raised: Raised,
}

impl Mind {
    /// Calls into the mind while other threads run; then tells what a rule in Python raised.
    fn with<T: Send>(
        &mut self,
        py: Python<'_>,
        call: impl FnOnce(&mut PortableMind) -> Result<T, MindError> + Send,
    ) -> PyResult<T> {
        let lock = &self.mind;
        let done = py.detach(|| {
            let mut mind = lock.lock().ok()?;
            Some(call(&mut mind))
        });
        let done = done.ok_or_else(|| broken("mind"))?;
        self.raised.check()?;
        done.map_err(of_mind)
    }

    /// Asks the mind what it knows at once.
    fn peek<T>(&mut self, call: impl FnOnce(&mut PortableMind) -> T) -> PyResult<T> {
        let mut mind = self.mind.lock().map_err(|_| broken("mind"))?;
        Ok(call(&mut mind))
    }
}

#[pymethods]
impl Mind {
    #[new]
    #[pyo3(signature = (settings, selection=None, forgetting=None))]
    fn new(
        settings: &str,
        selection: Option<&Bound<'_, PyAny>>,
        forgetting: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let raised = Raised::default();
        let rules = for_mind(selection, forgetting, &raised)?;
        let settings = Settings::parse(settings.as_bytes()).map_err(of_mind)?;
        let mind = PortableMind::with_rules(settings, rules).map_err(of_mind)?;
        Ok(Self { mind: Mutex::new(mind), raised })
    }

    fn use_model(&mut self, py: Python<'_>, now_ns: u64, model: &Model) -> PyResult<()> {
        let classifier = model.classifier.clone();
        self.with(py, |mind| mind.use_classifier(Duration::from_nanos(now_ns), classifier))
    }

    fn observe(&mut self, py: Python<'_>, now_ns: u64, values: Vec<f32>, quality: f32) -> PyResult<()> {
        self.with(py, |mind| mind.observe(Duration::from_nanos(now_ns), &values, quality))
    }

    fn received(&mut self, py: Python<'_>, now_ns: u64, key: Option<&str>, payload: &[u8]) -> PyResult<()> {
        let now = Duration::from_nanos(now_ns);
        self.with(py, |mind| match key {
            Some(key) => mind.received(now, key, payload),
            None => mind.received_envelope(now, payload),
        })
    }

    fn instructed(
        &mut self,
        py: Python<'_>,
        now_ns: u64,
        instructor: &str,
        at: u64,
        word: &str,
    ) -> PyResult<()> {
        self.with(py, |mind| mind.instructed(Duration::from_nanos(now_ns), instructor, at, word.as_bytes()))
    }

    fn open(&mut self, py: Python<'_>, now_ns: u64) -> PyResult<()> {
        self.with(py, |mind| {
            mind.open(Duration::from_nanos(now_ns));
            Ok(())
        })
    }

    fn tick(&mut self, py: Python<'_>, now_ns: u64) -> PyResult<()> {
        self.with(py, |mind| {
            mind.tick(Duration::from_nanos(now_ns));
            Ok(())
        })
    }

    fn set_blind(&mut self, py: Python<'_>, now_ns: u64, blind: bool) -> PyResult<()> {
        self.with(py, |mind| {
            mind.set_blind(Duration::from_nanos(now_ns), blind);
            Ok(())
        })
    }

    fn set_alive(&mut self, py: Python<'_>, now_ns: u64, robots: Vec<u32>) -> PyResult<()> {
        self.with(py, |mind| mind.set_alive(Duration::from_nanos(now_ns), &robots))
    }

    fn set_neighbours(&mut self, py: Python<'_>, now_ns: u64, robots: Vec<u32>) -> PyResult<()> {
        self.with(py, |mind| mind.set_neighbours(Duration::from_nanos(now_ns), &robots))
    }

    fn train(&mut self, py: Python<'_>, now_ns: u64) -> PyResult<bool> {
        self.with(py, |mind| mind.train(Duration::from_nanos(now_ns)))
    }

    fn next_message<'py>(&mut self, py: Python<'py>) -> PyResult<Option<Carried<'py>>> {
        let message = self.peek(|mind| mind.next_message())?;
        Ok(message.map(|OutgoingMessage { key, to, json, payload }| {
            (key, PyBytes::new(py, &payload), to.map(|robot| robot.0), json)
        }))
    }

    #[getter]
    fn next_wake(&mut self) -> PyResult<Option<u64>> {
        // Beyond five hundred years is never.
        Ok(self.peek(|mind| mind.next_wake())?.and_then(|due| due.as_nanos().try_into().ok()))
    }

    #[getter]
    fn is_open(&mut self) -> PyResult<bool> {
        self.peek(|mind| mind.is_open())
    }

    #[getter]
    fn wants_training(&mut self) -> PyResult<bool> {
        self.peek(|mind| mind.wants_training())
    }

    fn decision(&mut self) -> PyResult<Option<String>> {
        self.peek(|mind| mind.decision())
    }

    fn status(&mut self) -> PyResult<String> {
        self.peek(|mind| mind.status())
    }
}
