//! What robots see: each of many hands from each of many places, looked at once and used by all runs.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use gestalt_protocol::ClassId;
use gestalt_strategies::{Observation, Vocabulary};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::error::ExperimentError;
use super::plan::{Experiment, Hands};
use super::setting::Drift;
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::dataset::{Dataset, leave_out_copies};
use gestalt_vision::model::{self, ModelError};
use gestalt_vision::perception::{FeatureSet, HandConfig, Perception};
use gestalt_vision::pose::Pose;
use gestalt_vision::source::{EmulatedView, RenderedSource, Scene, Source, read_image};
use gestalt_vision::vocabulary::HandPose;

/// How often each person shows a gesture where the people themselves change half-way, and how many do before and
/// after.
const TAKES: u64 = 12;
const PEOPLE_OF_A_DRIFT: u64 = 3;

/// An instant at which a hand shows a gesture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Moment {
    /// The gesture.
    pub class: ClassId,
    /// Who shows it, as far as that is known.
    pub person: Option<u32>,
    /// Whether it is of after the drift.
    pub after: bool,
}

/// Moments, seen from all places.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pool {
    /// Gestures by their labels.
    pub gestures: Vec<String>,
    /// How many places there are.
    pub places: usize,
    /// The moments.
    pub moments: Vec<Moment>,
    /// Features and quality, place by place of each moment; `None` where no hand was found.
    views: Views,
}

/// Features and quality of each view with a hand.
type Views = Vec<Option<(Vec<f32>, f32)>>;

/// A moment and how to make it visible.
#[derive(Clone, Debug, Serialize)]
struct Take {
    moment: Moment,
    /// Whether it is taken by the other of the two cameras of a place.
    other: bool,
    shown: Shown,
}

#[derive(Clone, Debug, Serialize)]
enum Shown {
    Rendered {
        /// How many, or which of a vocabulary.
        fingers: u8,
        seed: u64,
        take: u64,
        /// Where it is one of a vocabulary.
        #[serde(skip_serializing_if = "Option::is_none")]
        pose: Option<HandPose>,
    },
    Picture(PathBuf, u64),
}

impl Pool {
    /// Looks at rendered hands, or at the pictures of a dataset, from all places, on all cores; or reads what an earlier
    /// call with the same `eyes` (see [`Program`](super::Program)) kept in `folder`. `step(done, total)` is called now and then.
    ///
    /// # Errors
    /// A dataset that cannot be read, or fewer gestures in it than two.
    pub fn look(
        experiment: &Experiment,
        dataset: Option<&Path>,
        folder: &Path,
        eyes: u32,
        step: impl Fn(usize, usize) + Sync,
    ) -> Result<Self, ExperimentError> {
        let drift = experiment.drift();
        let hands = experiment.seen(dataset);
        let (gestures, takes) = match dataset {
            None => rendered(hands, drift)?,
            Some(folder) => pictured(hands, drift, folder)?,
        };
        let made_of = serde_json::to_string(&(hands.features.name(), eyes, hands, drift, &gestures, &takes))
            .expect("names and numbers can be written as JSON");
        let made_of = crc32fast::hash(made_of.as_bytes());
        let kept = folder.join(format!("observations-{made_of:08x}.bin"));
        if let Some(pool) = Self::read(&kept) {
            return Ok(pool);
        }
        let views = look_at(&takes, hands, drift, step)?;
        let moments = takes.iter().map(|take| take.moment).collect();
        let pool = Self { gestures, places: hands.places, moments, views };
        pool.write(&kept).map_err(|source| ExperimentError::Write { path: kept, source })?;
        Ok(pool)
    }

    /// What was kept, if it is whole.
    fn read(path: &Path) -> Option<Self> {
        let bytes = std::fs::read(path).ok()?;
        let (sum, bytes) = bytes.split_first_chunk::<4>()?;
        (crc32fast::hash(bytes) == u32::from_le_bytes(*sum)).then(|| postcard::from_bytes(bytes).ok())?
    }

    fn write(&self, path: &Path) -> std::io::Result<()> {
        let bytes = postcard::to_stdvec(self).map_err(std::io::Error::other)?;
        let sum = crc32fast::hash(&bytes).to_le_bytes();
        gestalt_file::write(path, &[&sum[..], &bytes].concat())
    }

    /// The gestures.
    ///
    /// # Errors
    /// Labels that make no vocabulary.
    pub fn vocabulary(&self) -> Result<Vocabulary, ExperimentError> {
        Vocabulary::new(self.gestures.iter().cloned())
            .map_err(|error| ExperimentError::Setting(error.to_string()))
    }

    /// What is seen of a moment from a place.
    #[must_use]
    pub fn view(&self, moment: usize, place: usize) -> Option<Observation> {
        let (features, quality) = self.features(moment, place)?;
        Some(Observation { features: features.to_vec(), quality })
    }

    /// The same by reference: features and quality.
    #[must_use]
    pub fn features(&self, moment: usize, place: usize) -> Option<(&[f32], f32)> {
        let (features, quality) = self.views.get(moment * self.places + place)?.as_ref()?;
        Some((features, *quality))
    }

    /// In how many of the views a hand was found, `0.0..=1.0`.
    #[must_use]
    pub fn found(&self) -> f64 {
        self.views.iter().flatten().count() as f64 / self.views.len().max(1) as f64
    }
}

fn rendered(hands: &Hands, drift: Drift) -> Result<(Vec<String>, Vec<Take>), ExperimentError> {
    let shown: Vec<(String, Option<HandPose>)> = match hands.book()? {
        Some(book) => book.gestures.into_iter().map(|gesture| (gesture.name, Some(gesture.pose))).collect(),
        None => (0..6).map(|n: u8| (n.to_string(), None)).collect(),
    };
    let people = hands.people as u64;
    let (people, takes, shift) = match drift {
        Drift::None => (vec![(false, 0..people)], 1, 0),
        Drift::Light | Drift::Camera => (vec![(false, 0..people), (true, 0..people)], 1, 0),
        Drift::Person => {
            let n = PEOPLE_OF_A_DRIFT;
            (vec![(false, 0..n), (true, n..2 * n)], TAKES, 1000)
        }
    };
    let mut all = Vec::new();
    for (after, people) in people {
        for (person, take) in people.flat_map(|person| (0..takes).map(move |take| (person, take))) {
            for (fingers, (_, pose)) in (0_u8..).zip(&shown) {
                let moment =
                    Moment { class: ClassId(u32::from(fingers)), person: Some(person as u32), after };
                let other = after && changes_cameras(drift);
                all.push(Take {
                    moment,
                    other,
                    shown: Shown::Rendered { fingers, seed: shift + person, take, pose: *pose },
                });
            }
        }
    }
    Ok((shown.into_iter().map(|(name, _)| name).collect(), all))
}

fn pictured(hands: &Hands, drift: Drift, folder: &Path) -> Result<(Vec<String>, Vec<Take>), ExperimentError> {
    let fingers: Vec<String> = (0..6).map(|n: u8| n.to_string()).collect();
    // Counts of fingers where there are any, as of the rendered hands; else whatever there is.
    let counts: Vec<String> = fingers.into_iter().filter(|label| folder.join(label).is_dir()).collect();
    let mut dataset = Dataset::list(folder, (counts.len() > 1).then_some(&counts[..]))?;
    // A copy would be taught by one name and judged by the other.
    leave_out_copies(std::slice::from_mut(&mut dataset));
    if hands.features == FeatureSet::Embedding {
        // What the eyes were made with is no test of what they see.
        dataset.images = model::hands().map_err(ModelError::from)?.origin.unseen(dataset.images);
        if dataset.images.is_empty() {
            return Err(ExperimentError::Setting(format!(
                "the learned eyes were made with {}, or with its people: take pictures that they have not seen",
                folder.display()
            )));
        }
    }
    let people: BTreeSet<u32> = dataset.people();
    let middle = people.iter().nth(people.len() / 2).copied();
    let mut takes = Vec::new();
    for class in 0..dataset.vocabulary.classes() {
        let images: Vec<_> = dataset.images.iter().filter(|image| image.class.index() == class).collect();
        // Spread over the list, so that all people are among them.
        let used = images.len().min(hands.pictures);
        for image in (0..used).map(|n| images[n * images.len() / used]) {
            let person = image.person;
            let fingerprint = image
                .fingerprint()
                .map_err(|source| ExperimentError::Read { path: image.path.clone(), source })?;
            let later = person.zip(middle).is_some_and(|(person, middle)| person >= middle);
            let shown = Shown::Picture(image.path.clone(), fingerprint);
            let mut take = |after| {
                let moment = Moment { class: image.class, person, after };
                takes.push(Take { moment, other: after && changes_cameras(drift), shown: shown.clone() });
            };
            match drift {
                Drift::None => take(false),
                Drift::Light | Drift::Camera => [false, true].into_iter().for_each(take),
                Drift::Person => take(later),
            }
        }
    }
    if drift == Drift::Person && people.len() < 2 {
        return Err(ExperimentError::Setting(
            "the file names of this dataset tell of no people that could change (sNNN_…): take another"
                .to_owned(),
        ));
    }
    Ok((dataset.vocabulary.labels().to_vec(), takes))
}

/// Looks at each moment from each place. Each moment is looked at with fresh eyes: what is seen depends neither on the
/// number of threads nor on their order.
fn look_at(
    takes: &[Take],
    hands: &Hands,
    drift: Drift,
    step: impl Fn(usize, usize) + Sync,
) -> Result<Views, ExperimentError> {
    let cameras = cameras(hands, drift)?;
    let done = AtomicUsize::new(0);
    let look = |(n, take): (usize, &Take)| -> Result<Views, ExperimentError> {
        let mut perception = Perception::new(hands.features, HandConfig::default())?;
        let views = look_from_all(n, take, &cameras, hands, &mut perception)?;
        step(done.fetch_add(1, Ordering::Relaxed) + 1, takes.len());
        Ok(views)
    };
    let seen: Vec<Views> = takes.par_iter().enumerate().map(look).collect::<Result<_, _>>()?;
    Ok(seen.concat())
}

/// Whether what changes half-way is seen by other cameras: other ones, or the same in another light.
fn changes_cameras(drift: Drift) -> bool {
    matches!(drift, Drift::Light | Drift::Camera)
}

/// The camera at each place, before and after the drift.
fn cameras(hands: &Hands, drift: Drift) -> Result<Vec<(Pose, [CameraModel; 2])>, ExperimentError> {
    let named = |name: &str| {
        CameraModel::named(name).ok_or_else(|| {
            ExperimentError::Setting("the camera is none of footbot, parrot and laptop".to_owned())
        })
    };
    let model = named(&hands.camera)?;
    let of_others = named(if hands.camera == "footbot" { "parrot" } else { "footbot" })?;
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let places = hands.placement.place(hands.places, 1);
    Ok(places
        .into_iter()
        .map(|pose| {
            let bright = model.specimen(&mut rng);
            if drift == Drift::Camera {
                return (pose, [bright, of_others.specimen(&mut rng)]);
            }
            let [blue, green, red] = bright.cast_bgr;
            let dim = CameraModel {
                gain: (bright.gain * 0.7).max(0.1),
                noise_sigma: bright.noise_sigma + 3.0,
                cast_bgr: [blue * 0.85, green, red * 1.12],
                ..bright.clone()
            };
            (pose, [bright, dim])
        })
        .collect())
}

fn look_from_all(
    n: usize,
    take: &Take,
    cameras: &[(Pose, [CameraModel; 2])],
    hands: &Hands,
    perception: &mut Perception,
) -> Result<Views, ExperimentError> {
    let picture = match &take.shown {
        Shown::Picture(path, _) => Some(read_image(path)?),
        Shown::Rendered { .. } => None,
    };
    let mut views = Vec::with_capacity(cameras.len());
    for (place, (pose, both)) in cameras.iter().enumerate() {
        let camera = both[usize::from(take.other)].clone();
        let seed = (n as u64) << 16 | place as u64;
        let frame = match (&take.shown, &picture) {
            (Shown::Picture(..), Some(picture)) => {
                EmulatedView::new(camera, *pose, hands.picture_height_m, seed)?.view(picture)?
            }
            (Shown::Rendered { fingers, seed: person, take, pose: held }, _) => {
                // Aim and tilt differ from take to take.
                let mut source = RenderedSource::new(camera, *pose, hands.glove, seed ^ take << 48)?;
                let mut scene = Scene { gesture: Some(*fingers), seed: *person };
                if let Some(held) = held {
                    (source, scene.gesture) = (source.showing([*held].into()), Some(0));
                }
                source.next_frame(Duration::ZERO, &scene)?.image
            }
            (Shown::Picture(..), None) => continue,
        };
        views.push(perception.observe(&frame).ok().map(|seen| (seen.features, seen.quality)));
    }
    Ok(views)
}
