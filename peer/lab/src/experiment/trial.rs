//! One run: a setting, a seed, and how well robots judge after each round.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use gestalt_protocol::{ClassId, FusionRule, Heeded};
use gestalt_strategies::{Classifier, Classify, Evidence, Fuse, JudgedFrame, PoisonDefence};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::error::ExperimentError;
use super::eyes::PoolEyes;
use super::pool::Pool;
use super::setting::{Drift, Setting};
use super::split::Split;
use super::standing::Standing;
use crate::emulation::{Emulation, Observer, Rules, School, Trace, likeliest};
use crate::threads::Crew;

/// The most robots of which all are examined after each round, and how many are of more: all who are train for it.
pub(super) const ALL_EXAMINED: usize = 100;
pub(super) const EXAMINED: usize = 32;

/// A robot's evidence is bounded to this, as in a vote.
const CLIP: f64 = 6.0;

/// Runs a setting with a seed. Two settings with the same seed and number of robots are shown the same.
///
/// Robots share, forget and fuse by `rules` where there are any. Between two rounds it looks whether to `stop`.
///
/// # Errors
/// A setting that cannot be emulated; [`ExperimentError::Stopped`].
pub fn run(
    setting: &Setting,
    school: &Arc<School>,
    pool: &Arc<Pool>,
    seed: u64,
    (rules, stop): (&Rules, &AtomicBool),
) -> Result<Vec<Standing>, ExperimentError> {
    let scenario = setting.scenario(pool.gestures.len())?;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let split = Arc::new(Split::draw(&pool.gestures, &pool.moments, &mut rng)?);
    let places = places(pool.places, setting.robots, &mut rng);
    let drift_after = (setting.drift != Drift::None).then_some(setting.rounds / 2);
    let eyes = |place: &usize| -> Box<dyn Observer> {
        Box::new(PoolEyes {
            pool: pool.clone(),
            split: split.clone(),
            place: *place,
            moments: setting.moments,
            drift_after,
            seed,
            period: setting.period(),
            shown: (0, ClassId(0), 0),
        })
    };
    let observers = places.iter().map(eyes).collect();
    let mut emulation =
        Emulation::by(&scenario, seed, observers, Some(school.clone()), rules.clone(), Trace::none())?;
    let honest = &places[..setting.robots - setting.liars];
    let examined = examined(honest.len(), seed);
    let crew = Crew::on_all_cores();
    let exams = [0, 1].map(|after| {
        Exam::new(pool, school, &split.held_out[after], (honest, &examined), (rules, setting), &crew)
    });
    let mut standings = vec![exams[0].sit(&mut emulation, 0)];
    while emulation.show_next() {
        if stop.load(Ordering::Relaxed) {
            return Err(ExperimentError::Stopped);
        }
        let round = standings.len() as u32;
        let after = usize::from(drift_after.is_some_and(|last| round > last));
        standings.push(exams[after].sit(&mut emulation, round));
    }
    Ok(standings)
}

/// Which part of the samples held is trained on.
fn share<'a>(of: impl IntoIterator<Item = &'a Heeded>) -> f64 {
    let (held, trained) =
        of.into_iter().fold((0, 0), |(held, trained), of| (held + of.held, trained + of.trained));
    if held == 0 { 1.0 } else { trained as f64 / held as f64 }
}

/// Draws where robots stand: no two at one place, as long as there are places.
fn places(places: usize, robots: usize, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let mut drawn = Vec::with_capacity(robots);
    while drawn.len() < robots {
        let mut all: Vec<usize> = (0..places).collect();
        all.shuffle(rng);
        drawn.extend(all.into_iter().take(robots - drawn.len()));
    }
    drawn
}

/// Draws who is examined, of so many robots: of more than [`ALL_EXAMINED`] some.
fn examined(robots: usize, seed: u64) -> Vec<usize> {
    let mut all: Vec<usize> = (0..robots).collect();
    if robots > ALL_EXAMINED {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(u64::MAX);
        all.shuffle(&mut rng);
        all.truncate(EXAMINED);
        all.sort_unstable();
    }
    all
}

/// What is right, and the features and coordinates from each place.
type Question<'a> = (ClassId, BTreeMap<usize, (&'a [f32], Vec<f32>)>);

/// What a robot makes of what it sees.
#[derive(Clone)]
struct Verdict {
    /// Whether it is right, and certainly.
    is_certain: bool,
    /// None where it has learned nothing.
    probabilities: Option<Vec<f64>>,
    /// For how much it takes it to show nothing that it was taught, in nats, if it can tell.
    unknown: Option<f64>,
}

/// Held-out moments as all robots see them, in the space they learn in. Robots at one place see the same.
struct Exam<'a> {
    classes: usize,
    /// All that are honest.
    robots: usize,
    /// Those that are examined.
    examined: Vec<usize>,
    questions: Vec<Question<'a>>,
    places: Vec<usize>,
    crew: &'a Crew,
    /// By which a swarm judges.
    fusion: Arc<dyn Fuse>,
    /// Against how many liars a judgement is to be certain.
    liars: usize,
    /// Whether robots leave samples of others out.
    doubt: bool,
}

impl<'a> Exam<'a> {
    fn new(
        pool: &'a Pool,
        school: &School,
        moments: &[usize],
        (places, examined): (&[usize], &[usize]),
        (rules, setting): (&Rules, &Setting),
        crew: &'a Crew,
    ) -> Self {
        let (robots, places) =
            (places.len(), examined.iter().map(|robot| places[*robot]).collect::<Vec<_>>());
        let question = |moment: &usize| {
            let seen = places.iter().filter_map(|place| {
                let (features, _) = pool.features(*moment, *place)?;
                Some((*place, (features, school.space().project(features).ok()?)))
            });
            (pool.moments[*moment].class, seen.collect())
        };
        let questions = moments.iter().map(question).collect();
        let fusion = rules.fusion.clone().unwrap_or(Arc::new(FusionRule::default()));
        Self {
            classes: pool.gestures.len(),
            robots,
            examined: examined.to_vec(),
            questions,
            places,
            fusion,
            crew,
            liars: setting.liars.max(1),
            doubt: setting.learning.poison != PoisonDefence::default(),
        }
    }

    /// What a robot makes of what it sees of a hand that shows that.
    fn verdict(
        &self,
        classifier: Option<&Classifier>,
        (features, view): (&[f32], &[f32]),
        class: ClassId,
    ) -> Verdict {
        let certain = classifier.and_then(|classifier| classifier.certified(view));
        let judged = classifier.and_then(|classifier| classifier.judge(features).ok());
        let unknown = judged.as_ref().and_then(|judged| judged.unknown);
        Verdict {
            is_certain: certain.is_some_and(|it| it.class == class && it.tolerates >= self.liars),
            unknown: unknown.map(|odds| odds.ln().clamp(-CLIP, CLIP)),
            probabilities: judged.map(|judged| judged.probabilities),
        }
    }

    /// How well robots judge now, of the views in which they find a hand.
    fn sit(&self, emulation: &mut Emulation<'_>, round: u32) -> Standing {
        emulation.learn(&self.examined);
        let classifiers: Vec<Option<Arc<Classifier>>> =
            self.examined.iter().map(|robot| emulation.classifier(*robot)).collect();
        let mut verdicts: Vec<Vec<Option<Verdict>>> = vec![Vec::new(); classifiers.len()];
        let all = verdicts.iter_mut().zip(classifiers.iter().zip(&self.places)).collect();
        self.crew.on_each(all, |(verdicts, (classifier, place))| {
            let verdict = |(class, views): &Question<'_>| {
                let (features, view) = views.get(place)?;
                Some(self.verdict(classifier.as_deref(), (features, view), *class))
            };
            verdicts.extend(self.questions.iter().map(verdict));
        });
        let chance = 1.0 / self.classes as f64;
        let (mut single, mut certified, mut seen, mut swarm, mut majority) = (0.0, 0.0, 0.0, 0.0, 0.0);
        let unknown: Vec<f64> = verdicts.iter().flatten().flatten().filter_map(|it| it.unknown).collect();
        let mut judged = 0.0;
        for (n, (class, _)) in self.questions.iter().enumerate() {
            if verdicts.iter().all(|of_robot| of_robot[n].is_none()) {
                continue;
            }
            judged += 1.0;
            let mut evidence: Vec<Vec<f32>> = Vec::new();
            for Verdict { is_certain, probabilities, .. } in
                verdicts.iter().filter_map(|of_robot| of_robot[n].as_ref())
            {
                seen += 1.0;
                certified += f64::from(u8::from(*is_certain));
                match probabilities {
                    None => single += chance,
                    Some(p) => {
                        single += f64::from(u8::from(likeliest(p) == Some(class.index())));
                        evidence.push(evidence_of(p));
                    }
                }
            }
            let votes: Vec<&[f32]> = evidence.iter().map(Vec::as_slice).collect();
            let pooled = |rule: &dyn Fuse| {
                rule.fuse(CLIP, self.classes, &votes)
                    .map_or(chance, |fused| f64::from(u8::from(fused.top == *class)))
            };
            swarm += pooled(&*self.fusion);
            majority += pooled(&FusionRule::Majority);
        }
        let judged = f64::max(judged, 1.0);
        let robots = self.robots as f64;
        let traffic = (0..self.robots).map(|robot| emulation.traffic(robot));
        let traffic: crate::emulation::Traffic = traffic.sum();
        let samples = (0..self.robots).filter_map(|robot| Some(emulation.training_set(robot)?.len()));
        let (asked, labels) = emulation.asked();
        let doubting = (0..self.robots).filter(|_| self.doubt);
        let heeded: Vec<Heeded> = doubting.flat_map(|robot| emulation.heeded(robot)).collect();
        // The honest robots are the first.
        let (of_honest, of_liars): (Vec<Heeded>, Vec<Heeded>) =
            heeded.into_iter().partition(|of| of.robot.0 as usize <= self.robots);
        Standing {
            round,
            single: single / f64::max(seen, 1.0),
            swarm: swarm / judged,
            majority: majority / judged,
            published: traffic.published_samples as f64 / robots,
            on_links: traffic.samples_on_links() as f64 / robots,
            samples: samples.sum::<usize>() as f64 / robots,
            questions: f64::from(asked),
            labels: f64::from(labels),
            heeded_honest: share(&of_honest),
            heeded_liars: share(&of_liars),
            least_heeded: of_honest.iter().map(|of| share([of])).fold(1.0, f64::min),
            certified: certified / f64::max(seen, 1.0),
            unknown: unknown.iter().sum::<f64>() / unknown.len().max(1) as f64,
        }
    }
}

/// What one look at a hand says, as a vote would carry it.
fn evidence_of(p: &[f64]) -> Vec<f32> {
    let mut evidence = Evidence::new(p.len());
    evidence.add(
        JudgedFrame { at: Duration::ZERO, probabilities: p, unknown: None, quality: 1.0, view: &[] },
        Duration::from_secs(1),
    );
    evidence.clipped(CLIP)
}
