//! One seed: every swarm is shown the same gestures.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use gestalt_protocol::ClassId;
use gestalt_strategies::{Classifier, Classify, Observation};

use super::outcome::Outcome;
use super::plan::{Kind, Recognition, SwarmPlan};
use super::takes::{Take, Takes};
use super::training::{Classifiers, GESTURES};
use crate::emulation::{Emulation, Group, LinkModel, Observer, Order, Scenario, Trace};
use crate::experiment::error::ExperimentError;
use crate::shape::NetworkShape;
use gestalt_vision::perception::LayerConfig;

/// Shows all swarms of a plan the gestures of a seed; outcomes in the order of the plan. Between two gestures it looks
/// whether to `stop`.
///
/// # Errors
/// A swarm that cannot be emulated, hands that cannot be drawn or seen; [`ExperimentError::Stopped`].
pub fn run(
    plan: &Recognition,
    classifiers: &Classifiers,
    seed: u64,
    stop: &AtomicBool,
) -> Result<Vec<Outcome>, ExperimentError> {
    let seen = Arc::new(Mutex::new(Takes::new(plan.clone(), seed)));
    plan.swarms.iter().map(|swarm| show(plan, swarm, classifiers.of(swarm), &seen, (seed, stop))).collect()
}

fn show(
    plan: &Recognition,
    swarm: &SwarmPlan,
    classifier: &Arc<Classifier>,
    seen: &Arc<Mutex<Takes>>,
    (seed, stop): (u64, &AtomicBool),
) -> Result<Outcome, ExperimentError> {
    let scenario = Scenario {
        robots: vec![Group {
            name: "robot".to_owned(),
            count: swarm.size(),
            view: None,
            lies: None,
            poison: None,
        }],
        topology: NetworkShape::Ring,
        link: LinkModel::default(),
        classes: GESTURES,
        rounds: plan.showings,
        order: Order::InTurn,
        interval: plan.shown_for + Duration::from_secs(3),
        mind: plan.mind(swarm)?,
        learning: None,
        faults: Vec::new(),
        churn: None,
        compare: Vec::new(),
        seeds: 1,
    };
    let failure = Arc::new(Mutex::new(None));
    let mut observers: Vec<Box<dyn Observer>> = Vec::new();
    for (robot, kind) in swarm.members() {
        observers.push(Box::new(Eyes {
            seen: seen.clone(),
            failure: failure.clone(),
            classifier: classifier.clone(),
            kind: kind.clone(),
            layer: swarm.layer,
            period: kind.model()?.period().as_secs_f64(),
            robot,
            showing: 0,
            take: Take::default(),
            next: 0,
        }));
    }
    let mut emulation = Emulation::new(&scenario, seed, observers, None, Trace::none())?;
    while emulation.show_next() {
        if let Some(failure) = lock(&failure).take() {
            return Err(failure);
        }
        if stop.load(Ordering::Relaxed) {
            return Err(ExperimentError::Stopped);
        }
    }
    let (report, _) = emulation.finish();
    // What opened no round, as robots were still in the one before, was not decided.
    let opened = report.right.trials as f64 / report.showings as f64;
    let [right, wrong] = [report.right, report.wrong].map(|of| of.share * opened);
    Ok(Outcome {
        right,
        wrong,
        frames_right: (report.frames_right.trials > 0).then_some(report.frames_right.share),
        undecided: report.undecided.share * opened + (1.0 - opened),
        decided_s: (report.decided_ms.n > 0).then_some(report.decided_ms.mean / 1000.0),
    })
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A robot's eyes: they see what was taken for its kind and its number in the swarm.
struct Eyes {
    seen: Arc<Mutex<Takes>>,
    failure: Arc<Mutex<Option<ExperimentError>>>,
    classifier: Arc<Classifier>,
    kind: Kind,
    layer: LayerConfig,
    period: f64,
    robot: usize,
    showing: u32,
    take: Take,
    next: usize,
}

impl Observer for Eyes {
    fn classifier(&self) -> Option<Arc<dyn Classify>> {
        Some(self.classifier.clone())
    }

    fn period(&self) -> f64 {
        self.period
    }

    fn show(&mut self, shown: ClassId, _: &mut dyn rand::Rng) {
        self.showing += 1;
        self.next = 0;
        let take = lock(&self.seen).of(&self.kind, self.layer, self.robot, (self.showing, shown));
        self.take = take.unwrap_or_else(|error| {
            lock(&self.failure).get_or_insert(error);
            Take::default()
        });
    }

    fn frame(&mut self, _: &mut dyn rand::Rng) -> Option<Observation> {
        let frame = self.take.get(self.next).cloned().flatten();
        self.next += 1;
        frame
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn robots_stand_at_places_of_their_own_whatever_their_kinds() {
        let text = "{ title: 't', swarms: [
            { line: 'a', robots: [{ camera: 'footbot', count: 2 }] },
            { line: 'b', robots: [{ camera: 'footbot', count: 1 }, { camera: 'footbot', count: 1 }] } ] }";
        let plan = Recognition::parse(text, Path::new("test")).unwrap();
        let mut takes = Takes::new(plan.clone(), 1);
        let of = |swarm: &SwarmPlan| -> Vec<Take> {
            let take = |(robot, kind): (usize, &Kind)| {
                takes.of(kind, LayerConfig::default(), robot, (1, ClassId(3))).unwrap()
            };
            swarm.members().map(take).collect()
        };
        let [one, two] = [&plan.swarms[0], &plan.swarms[1]].map(of);
        assert_eq!(one, two);
        assert_ne!(two[0], two[1]);
    }
}
