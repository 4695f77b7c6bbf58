//! What each camera sees of each gesture of a seed: drawn and looked at once, for all swarms it takes part in.

use std::collections::BTreeMap;
use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_strategies::Observation;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::plan::{Kind, Recognition};
use super::training::FEATURES;
use crate::experiment::error::ExperimentError;
use gestalt_vision::perception::{HandConfig, LayerConfig, Perception};
use gestalt_vision::source::{RenderedSource, Scene, Source, through_jpeg};

/// The frames that a robot takes of one showing; `None`: no hand was found.
pub type Take = Arc<Vec<Option<Observation>>>;

/// All takes of a seed so far.
pub struct Takes {
    plan: Recognition,
    seed: u64,
    seen: BTreeMap<String, Take>,
}

impl Takes {
    pub fn new(plan: Recognition, seed: u64) -> Self {
        Self { plan, seed, seen: BTreeMap::new() }
    }

    /// What the `robot`th of a swarm sees of that showing, if it is of that kind.
    pub fn of(
        &mut self,
        kind: &Kind,
        layer: LayerConfig,
        robot: usize,
        (showing, shown): (u32, ClassId),
    ) -> Result<Take, ExperimentError> {
        let one = Kind { count: 1, ..kind.clone() };
        let key = format!("{one:?} {layer:?} {robot} {showing} {shown:?}");
        if let Some(take) = self.seen.get(&key) {
            return Ok(take.clone());
        }
        let take = Arc::new(self.look(kind, layer, robot, (showing, shown))?);
        self.seen.insert(key, take.clone());
        Ok(take)
    }

    fn look(
        &self,
        kind: &Kind,
        layer: LayerConfig,
        robot: usize,
        (showing, shown): (u32, ClassId),
    ) -> Result<Vec<Option<Observation>>, ExperimentError> {
        // The place follows from the seed and the robot's number alone: the same for every kind of camera.
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(1 + robot as u64);
        let pose = kind.place.unwrap_or(self.plan.place).draw(&mut rng);
        let noise: u64 = rng.random();
        let camera = kind.model()?.specimen(&mut rng);
        let person = self.seed << 20 | u64::from(showing);
        let scene = Scene { gesture: u8::try_from(shown.0).ok(), seed: person };
        let mut source =
            RenderedSource::new(camera, pose, self.plan.glove, noise ^ u64::from(showing) << 40)?;
        let mut perception = Perception::for_camera(FEATURES, HandConfig::default(), layer, &kind.model()?)?;
        let period = source.period();
        let frames = self.plan.shown_for.div_duration_f64(period).ceil() as u32 + 1;
        (0..frames)
            .map(|n| {
                let mut image = source.next_frame(period * n, &scene)?.image;
                if let Some(quality) = kind.jpeg {
                    image = through_jpeg(&image, quality)?;
                }
                Ok(perception.observe(&image).ok())
            })
            .collect()
    }
}
