//! Rules of somebody's own, as Python callables.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use gestalt_strategies::{
    Classify, Forgetting, ForgettingRule, HeldSamples, OwnRules, Selection, SelectionRule,
};
use pyo3::prelude::*;
use rand::{Rng, RngExt};

use crate::errors::settings;
use crate::sample::Sample;

/// What a rule in Python raised, until whoever called is told.
#[derive(Clone, Debug, Default)]
pub(crate) struct Raised(Arc<Mutex<Option<PyErr>>>);

impl Raised {
    fn note(&self, error: PyErr) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
    }

    /// The error of a rule that was asked meanwhile, if one had one.
    pub(crate) fn check(&self) -> PyResult<()> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take().map_or(Ok(()), Err)
    }
}

/// A rule in Python: `(samples, seed) -> key`, or `None`.
struct OwnRule {
    rule: Arc<Py<PyAny>>,
    raised: Raised,
}

impl fmt::Debug for OwnRule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("OwnRule")
    }
}

impl OwnRule {
    fn ask(&self, samples: &HeldSamples, rng: &mut dyn Rng) -> Option<u64> {
        let seed: u64 = rng.random();
        let asked = Python::attach(|py| {
            let views: Vec<Sample> = samples.iter().map(Sample::from).collect();
            self.rule.call1(py, (views, seed))?.extract::<Option<u64>>(py)
        });
        asked.unwrap_or_else(|error| {
            self.raised.note(error);
            None
        })
    }
}

impl Selection for OwnRule {
    fn select(&mut self, samples: &HeldSamples, _: Option<&dyn Classify>, rng: &mut dyn Rng) -> Option<u64> {
        self.ask(samples, rng)
    }
}

impl Forgetting for OwnRule {
    fn victim(&mut self, samples: &HeldSamples, rng: &mut dyn Rng) -> Option<u64> {
        self.ask(samples, rng)
    }
}

/// The selection rule of that name, or of somebody's own.
pub(crate) fn selection(rule: &Bound<'_, PyAny>, raised: &Raised) -> PyResult<Box<dyn Selection>> {
    match rule.extract::<String>() {
        Ok(name) => Ok(name.parse::<SelectionRule>().map_err(settings)?.build()),
        Err(_) => Ok(Box::new(own(rule, raised)?)),
    }
}

/// The forgetting rule of that name, or of somebody's own.
pub(crate) fn forgetting(rule: &Bound<'_, PyAny>, raised: &Raised) -> PyResult<Box<dyn Forgetting>> {
    match rule.extract::<String>() {
        Ok(name) => Ok(name.parse::<ForgettingRule>().map_err(settings)?.build()),
        Err(_) => Ok(Box::new(own(rule, raised)?)),
    }
}

/// Rules for a mind: those that are not given are the ones that its settings name.
pub(crate) fn for_mind(
    selection: Option<&Bound<'_, PyAny>>,
    forgetting: Option<&Bound<'_, PyAny>>,
    raised: &Raised,
) -> PyResult<OwnRules> {
    let mut rules = OwnRules::default();
    if let Some(rule) = selection {
        let OwnRule { rule, raised } = own(rule, raised)?;
        rules = rules.selection(move || Box::new(OwnRule { rule: rule.clone(), raised: raised.clone() }));
    }
    if let Some(rule) = forgetting {
        let OwnRule { rule, raised } = own(rule, raised)?;
        rules = rules.forgetting(move || Box::new(OwnRule { rule: rule.clone(), raised: raised.clone() }));
    }
    Ok(rules)
}

fn own(rule: &Bound<'_, PyAny>, raised: &Raised) -> PyResult<OwnRule> {
    if !rule.is_callable() {
        return Err(settings("a rule is a name, or a callable that gives a sample's key"));
    }
    Ok(OwnRule { rule: Arc::new(rule.clone().unbind()), raised: raised.clone() })
}
