//! `gestalt look`: what perception makes of one frame, stage by stage.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use gestalt_protocol::ClassId;
use gestalt_strategies::{Classify, Observation};
use opencv::core::{Mat, Rect};
use opencv::prelude::*;
use serde_json::json;

use super::Failure;
use super::progress::bar;
use super::show::line;
use crate::config::{CameraSection, Config, ModelSection, SourceSection};
use crate::opinion::likeliest;
use crate::picture::stages;
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::model::RobotModel;
use gestalt_vision::perception::{FeatureSet, GROUPS, HandConfig, NoObservation, Perception};
use gestalt_vision::pose::Pose;
use gestalt_vision::source::{
    Glove, ImageFolder, RenderedSource, Scene, Source, SourceError, Video, read_image,
};

/// Shows what perception makes of one frame: raw, white-balanced, mask, hand, features, opinion
#[derive(Debug, clap::Args)]
pub struct Args {
    /// An image, a folder of images, a video, or `rendered:3` (a drawn hand of 3 fingers; `rendered`: an empty room)
    #[arg(long, value_name = "SRC")]
    source: LookAt,
    /// The picture, as SVG or PNG by its name
    #[arg(long, value_name = "FILE.svg|FILE.png")]
    out: PathBuf,
    /// The model file, as `gestalt train` wrote it; without one, the embedded model, which takes some seconds
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// The camera: footbot, parrot or laptop; without one, that of the configuration, or any
    #[arg(long, value_name = "CAMERA", value_parser = preset)]
    camera: Option<CameraModel>,
    /// The features: shape or hog; without them, those of the model
    #[arg(long, value_name = "SET")]
    features: Option<FeatureSet>,
    /// A robot's configuration: its camera, layer, pose and model
    #[arg(short, long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// An image of the scene without anyone
    #[arg(long, value_name = "FILE")]
    background: Option<PathBuf>,
    /// Which frame of a folder, a video or a drawn scene, from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    frame: u64,
    /// Report as one JSON object on stdout
    #[arg(long)]
    json: bool,
}

/// What to look at.
#[derive(Clone, Debug)]
enum LookAt {
    Rendered(Option<u8>),
    Path(PathBuf),
}

impl FromStr for LookAt {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.strip_prefix("rendered") {
            Some("") => Ok(Self::Rendered(None)),
            Some(rest) if rest.starts_with(':') => match rest[1..].parse() {
                Ok(fingers @ 0..=5) => Ok(Self::Rendered(Some(fingers))),
                _ => Err("a drawn hand has 0 to 5 fingers: rendered:3".to_owned()),
            },
            _ => Ok(Self::Path(text.into())),
        }
    }
}

fn preset(name: &str) -> Result<CameraModel, String> {
    CameraModel::named(name).ok_or_else(|| "say footbot, parrot or laptop".to_owned())
}

/// Looks, draws and says what it saw.
///
/// # Errors
/// When the source, the background, the model or the configuration cannot be used, or the picture not be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    gestalt_draw::check(&args.out)?;
    let config = args.config.as_deref().map(Config::read).transpose()?;
    let section = config.as_ref().map(|config| &config.camera);
    let camera = args.camera.clone().or_else(|| section.map(|section| section.model.properties()));
    // What is drawn is drawn for a camera.
    let drawn = matches!(args.source, LookAt::Rendered(_)).then(CameraModel::footbot);
    let camera = camera.or(drawn);
    let frame = frame(args, camera.as_ref(), section)?;
    let background = args.background.as_deref().map(read_image).transpose()?;
    let model = model(args, config.as_ref().map(|config| &config.model))?;
    let set = args.features.unwrap_or(model.features);
    let layer = section.map(|section| section.layer).unwrap_or_default();
    let mut perception = match &camera {
        Some(camera) => Perception::for_camera(set, HandConfig::default(), layer, camera)?,
        None => Perception::new(set, HandConfig::default())?,
    };
    let seen = perception.observe_before(&frame, background.as_ref());
    let view = View {
        camera: camera.map_or("any camera".to_owned(), |camera| camera.name),
        source: match &args.source {
            LookAt::Rendered(None) => "an empty room, drawn".to_owned(),
            LookAt::Rendered(Some(fingers)) => format!("a drawn hand, fingers: {fingers}"),
            LookAt::Path(path) if is_image(path) => path.display().to_string(),
            LookAt::Path(path) => format!("{}, frame {}", path.display(), args.frame),
        },
        frame,
        perception,
        seen,
        model,
    };
    gestalt_draw::write(&view.draw()?, &args.out)?;
    view.say(args)
}

/// The frame to be looked at.
fn frame(
    args: &Args,
    camera: Option<&CameraModel>,
    section: Option<&CameraSection>,
) -> Result<Mat, SourceError> {
    let (mut source, scene): (Box<dyn Source>, Scene) = match &args.source {
        LookAt::Rendered(gesture) => {
            let (pose, seed) = match section.map(|section| &section.source) {
                Some(SourceSection::Rendered(rendered)) => (rendered.pose, rendered.seed),
                _ => (Pose::FRONTAL, 1),
            };
            let camera = camera.cloned().unwrap_or_else(CameraModel::footbot);
            let source = RenderedSource::new(camera, pose, Glove::default(), seed)?;
            (Box::new(source), Scene { gesture: *gesture, seed })
        }
        LookAt::Path(path) if path.is_dir() => {
            (Box::new(ImageFolder::open(path, Duration::ZERO, false)?), Scene::default())
        }
        LookAt::Path(path) if is_image(path) => return read_image(path),
        LookAt::Path(path) => (Box::new(Video::open(path, false)?), Scene::default()),
    };
    for _ in 0..args.frame {
        source.next_frame(Duration::ZERO, &scene)?;
    }
    Ok(source.next_frame(Duration::ZERO, &scene)?.image)
}

/// By its name; a file of another one is played as a video.
fn is_image(path: &Path) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    ["jpg", "jpeg", "png"].iter().any(|known| extension.eq_ignore_ascii_case(known))
}

/// The classifier: of the file named, of the configuration, or the embedded one.
fn model(args: &Args, section: Option<&ModelSection>) -> Result<RobotModel, Failure> {
    let section = match (&args.model, section) {
        (Some(path), _) => ModelSection::File(path.clone()),
        (None, Some(ModelSection::File(path))) => ModelSection::File(path.clone()),
        _ => ModelSection::Rendered,
    };
    let training = bar("learning", 0);
    let model = crate::model::load(&section, |done, total| {
        training.set_length(total as u64);
        training.set_position(done as u64);
    })?;
    training.finish_and_clear();
    Ok(model.expect("a section that names a model gives one"))
}

/// All that is shown.
struct View {
    camera: String,
    source: String,
    frame: Mat,
    perception: Perception,
    seen: Result<Observation, NoObservation>,
    model: RobotModel,
}

impl View {
    /// What the classifier says of the hand, or why it says nothing.
    fn opinion(&self) -> Result<Vec<(String, f64)>, String> {
        let observation = self.seen.as_ref().map_err(|_| "no hand, no opinion".to_owned())?;
        let (set, classifier) = (self.perception.feature_set(), &self.model.classifier);
        if set != self.model.features {
            return Err(format!("the model is for {}: give --model", self.model.features.name()));
        }
        let probabilities =
            classifier.probabilities(&observation.features).map_err(|error| error.to_string())?;
        let labels = classifier.vocabulary().labels().iter().cloned();
        Ok(labels.zip(probabilities).collect())
    }

    fn draw(&self) -> Result<String, Failure> {
        let perception = &self.perception;
        let balanced = perception.balance(&self.frame)?;
        let [blue, green, red] = perception.gains();
        let found = self.seen.is_ok();
        let mask = if found {
            // Without its margin, the mask covers the region exactly.
            let mask = perception.mask();
            Mat::roi(mask, Rect::new(1, 1, mask.cols() - 2, mask.rows() - 2))?.try_clone()?
        } else {
            perception.candidates().clone()
        };
        let mask = if mask.empty() {
            Mat::new_rows_cols_with_default(3, 4, opencv::core::CV_8U, 0.into())?
        } else {
            mask
        };
        let (features, scale) = self.features();
        let layer = serde_json::to_value(perception.layer())?;
        let off: Vec<&String> = layer
            .as_object()
            .into_iter()
            .flatten()
            .filter(|(_, on)| **on == json!(false))
            .map(|(name, _)| name)
            .collect();
        let stages_on =
            if off.is_empty() { "all stages of the layer on".to_owned() } else { format!("off: {off:?}") };
        Ok(stages::draw(&stages::Stages {
            headline: format!(
                "{}\ncamera: {}; {stages_on}; features: {}; model: {}",
                self.source,
                self.camera,
                perception.feature_set().name(),
                self.model.name
            ),
            frame: &self.frame,
            region: perception.region(),
            balanced: &balanced,
            balance: format!("gains: red {red:.2}, green {green:.2}, blue {blue:.2}"),
            mask: &mask,
            hand: match &self.seen {
                Ok(observation) => Ok(format!("quality {:.2}", observation.quality)),
                Err(cause) => Err(cause.to_string()),
            },
            features,
            scale,
            opinion: self.opinion(),
        })?)
    }

    /// The features in groups, and what their bars mean.
    fn features(&self) -> (stages::Groups, stages::Scale) {
        let Ok(observation) = &self.seen else { return (Vec::new(), (String::new(), 1.0)) };
        match self.perception.feature_set() {
            FeatureSet::Shape => {
                let mut values = observation.features.clone();
                let mut unit = "as they are";
                if self.model.features == FeatureSet::Shape {
                    self.model.classifier.space().scaling().apply(&observation.features, &mut values);
                    unit = "standard deviations from the mean of the training";
                }
                let mut rest = values.as_slice();
                let group = |(name, length): (&str, usize)| {
                    let (group, others) = rest.split_at(length.min(rest.len()));
                    rest = others;
                    (name.to_owned(), group.to_vec())
                };
                (GROUPS.into_iter().map(group).collect(), (unit.to_owned(), 3.0))
            }
            FeatureSet::Hog => {
                // Seven rows of seven blocks, each of four cells of nine orientations.
                let block = |values: &[f32]| {
                    (0..9)
                        .map(|bin| values.iter().skip(bin).step_by(9).sum::<f32>() / 4.0)
                        .collect::<Vec<_>>()
                };
                // OpenCV lays the blocks out column by column.
                let column = |(i, blocks): (usize, &[f32])| {
                    let values = blocks.chunks(36).flat_map(block).collect();
                    (format!("column {}", i + 1), values)
                };
                let columns = observation.features.chunks(7 * 36).enumerate().map(column).collect();
                (columns, ("strength of 9 directions of edges in each of 7 x 7 blocks".to_owned(), 0.4))
            }
        }
    }

    /// One line of text, or a JSON object.
    fn say(&self, args: &Args) -> Result<(), Failure> {
        let opinion = self.opinion();
        let probabilities: Vec<f64> = opinion.iter().flatten().map(|(_, probability)| *probability).collect();
        let best = likeliest(&probabilities).and_then(|(ClassId(class), probability)| {
            Some((opinion.as_ref().ok()?.get(usize::from(class))?.0.clone(), probability))
        });
        let (width, height) = (self.frame.cols(), self.frame.rows());
        let (hand, quality) = match &self.seen {
            Ok(observation) => (None, Some(observation.quality)),
            Err(cause) => (Some(cause.to_string()), None),
        };
        let region = self.perception.region();
        let object = json!({
            "source": self.source,
            "camera": self.camera,
            "width": width,
            "height": height,
            "hand": quality.is_some(),
            "cause": hand,
            "quality": quality,
            "region": quality.map(|_| [region.x, region.y, region.width, region.height]),
            "gains_bgr": self.perception.gains(),
            "features": self.perception.feature_set().name(),
            "opinion": opinion.as_ref().ok().map(|all| all.iter().cloned().collect::<std::collections::BTreeMap<_, _>>()),
            "class": best.as_ref().map(|(label, _)| label),
            "out": args.out.display().to_string(),
        });
        let judged = match (&hand, quality, &best, &opinion) {
            (Some(cause), ..) => cause.clone(),
            (_, Some(quality), Some((label, p)), _) => {
                format!("a hand (quality {quality:.2}): {label} ({p:.2})")
            }
            (_, _, _, Err(cause)) => format!("a hand; {cause}"),
            _ => "a hand".to_owned(),
        };
        let words =
            format!("{}, {}, {width}×{height}: {judged} → {}", self.source, self.camera, args.out.display());
        line(args.json, &object, &words)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(source: &str, out: &Path) -> Args {
        Args {
            source: source.parse().unwrap(),
            out: out.into(),
            model: None,
            camera: None,
            features: None,
            config: None,
            background: None,
            frame: 0,
            json: true,
        }
    }

    #[test]
    fn a_source_that_is_missing_or_broken_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("x.png");
        let failure = |source: &Path| run(&args(source.to_str().unwrap(), &out)).unwrap_err().to_string();
        assert!(failure(&folder.path().join("none.jpg")).contains("none.jpg does not exist"));
        assert!(failure(&folder.path().join("none.mp4")).contains("none.mp4 does not exist"));
        for name in ["broken.png", "broken.mkv"] {
            let broken = folder.path().join(name);
            std::fs::write(&broken, "neither").unwrap();
            assert!(failure(&broken).contains(name));
        }
        let empty = folder.path().join("empty");
        std::fs::create_dir(&empty).unwrap();
        assert!(failure(&empty).contains("no images"));
        assert!("rendered:6".parse::<LookAt>().is_err());
    }
}
