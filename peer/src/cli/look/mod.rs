//! `gestalt look`: what perception makes of one frame, stage by stage.

mod view;

use std::path::PathBuf;
use std::time::Duration;

use gestalt_protocol::RobotId;
use opencv::core::Mat;

use self::view::View;
use super::Failure;
use super::source_arg::{Kind, Rendered, SourceArg, kind};
use crate::camera_source::open_source;
use crate::config::{CameraChoice, CameraSection, Config, ModelSection, SourceSection};
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::model::RobotModel;
use gestalt_vision::perception::{FeatureSet, HandConfig, Perception};
use gestalt_vision::pose::Pose;
use gestalt_vision::source::{
    Device, Glove, ImageFolder, Pipe, RenderedSource, Scene, Source, SourceError, Video, read_image,
};

/// Show what perception makes of one frame: raw, white-balanced, mask, hand, features, opinion
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt look hand.jpg
  gestalt look /dev/video0 --camera laptop --out stages.png")]
pub struct Args {
    /// Image, folder of images, video, named pipe, device (/dev/video0), ROS 2 topic (`ros:/camera/image_raw`), or `rendered:3` (a
    /// synthetic hand showing 3 fingers; `rendered`: an empty scene; `rendered:3,bearing=-30,distance=1.2,seed=7`)
    #[arg(value_name = "SOURCE", required_unless_present = "from")]
    source: Option<SourceArg>,
    /// The same as SOURCE
    #[arg(long = "source", value_name = "SOURCE", conflicts_with = "source")]
    from: Option<SourceArg>,
    /// SVG or PNG file to write [default: SOURCE.look.png in this folder]
    #[arg(long, value_name = "FILE.svg|FILE.png")]
    out: Option<PathBuf>,
    /// Model file written by `gestalt train`, `hands` (bare hands before any camera) or `rendered` (synthetic hands) [default:
    /// the configuration's, or hands, or rendered with a rendered source]
    #[arg(long, value_name = "FILE|hands|rendered")]
    model: Option<ModelSection>,
    /// Camera model [default: the configuration's, or none in particular]
    #[arg(long, value_name = "MODEL", value_parser = super::choice::camera())]
    camera: Option<CameraChoice>,
    /// Feature set: shape, hog or embedding [default: the model's]
    #[arg(long, value_name = "SET")]
    features: Option<FeatureSet>,
    /// Configuration file: camera model, heterogeneity layer, pose and model are taken from it
    #[arg(short, long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Image of the empty scene
    #[arg(long, value_name = "FILE")]
    background: Option<PathBuf>,
    /// Index of the frame within a folder, a video, a camera or a synthetic scene, from 0 [default: 0; of a camera 10, since
    /// its first frames are taken while it still adjusts to the light]
    #[arg(long, value_name = "N")]
    frame: Option<u64>,
    /// Print the report as one JSON object
    #[arg(long)]
    json: bool,
}

/// How many frames a camera takes to adjust to the light.
const WARM_UP: u64 = 10;

/// Looks, draws and says what it saw.
///
/// # Errors
/// When the source, the background, the model or the configuration cannot be used, or the picture not be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let source = args.source.as_ref().or(args.from.as_ref()).ok_or("give a SOURCE to look at")?;
    let out = args.out.clone().unwrap_or_else(|| beside(source));
    gestalt_draw::check(&out)?;
    let config = args.config.as_deref().map(Config::read).transpose()?;
    let section = config.as_ref().map(|config| &config.camera);
    let model = model(args, source, config.as_ref().map(|config| &config.model))?;
    let camera = args.camera.as_ref().map(CameraChoice::properties);
    let camera = camera.or_else(|| section.map(|section| section.model.properties()));
    // What is rendered is rendered for a camera.
    let rendered = matches!(source, SourceArg::Rendered(_)).then(CameraModel::footbot);
    let camera = camera.or(rendered);
    let (frame, described) = frame(source, args.frame, camera.as_ref(), section)?;
    let background = args.background.as_deref().map(read_image).transpose()?;
    let set = args.features.unwrap_or(model.features);
    let layer = section.map(|section| section.layer).unwrap_or_default();
    let mut perception = match &camera {
        Some(camera) => Perception::for_camera(set, HandConfig::default(), layer, camera)?,
        None => Perception::new(set, HandConfig::default())?,
    };
    let seen = perception.observe_before(&frame, background.as_ref());
    let camera = camera.map_or("unspecified camera".to_owned(), |camera| camera.name);
    let view = View { camera, source: described, frame, perception, seen, model };
    gestalt_draw::write(&view.draw()?, &out)?;
    view.say(&out, args.json)
}

/// Where the picture goes when nobody says: into this folder, under the source's name.
fn beside(source: &SourceArg) -> PathBuf {
    let stem = match source {
        SourceArg::Rendered(Rendered { fingers: Some(fingers), .. }) => format!("rendered-{fingers}"),
        SourceArg::Rendered(_) => "rendered".to_owned(),
        SourceArg::Ros(topic) => topic.trim_matches('/').replace('/', "-"),
        SourceArg::Path(path) => {
            path.file_stem().map_or_else(|| "frame".to_owned(), |stem| stem.to_string_lossy().into_owned())
        }
    };
    PathBuf::from(format!("{stem}.look.png"))
}

/// The frame to be looked at, and what it is, in words.
fn frame(
    source: &SourceArg,
    index: Option<u64>,
    camera: Option<&CameraModel>,
    section: Option<&CameraSection>,
) -> Result<(Mat, String), SourceError> {
    let first = index.unwrap_or(0);
    match source {
        SourceArg::Rendered(hand) => {
            let (pose, glove, seed) = match section.map(|section| &section.source) {
                Some(SourceSection::Rendered(rendered)) => (rendered.pose, rendered.glove, rendered.seed),
                _ => (Pose::FRONTAL, Glove::default(), 1),
            };
            let (pose, seed) = (hand.pose.unwrap_or(pose), hand.seed.unwrap_or(seed));
            let glove = hand.glove.unwrap_or(glove);
            let camera = camera.cloned().unwrap_or_else(CameraModel::footbot);
            let mut rendered = RenderedSource::new(camera, pose, glove, seed)?;
            let described = match hand.fingers {
                None => "synthetic empty scene".to_owned(),
                Some(fingers) => format!("synthetic hand showing {fingers} fingers"),
            };
            Ok((skip(&mut rendered, first, &Scene { gesture: hand.fingers, seed })?, described))
        }
        SourceArg::Ros(topic) => {
            let source = source.section().map_err(|error| SourceError::Own(error.to_string()))?;
            let mut camera = open_source(
                &CameraSection { source, ..CameraSection::default() },
                RobotId(0),
                Duration::ZERO,
            )?;
            Ok((skip(camera.as_mut(), first, &Scene::default())?, format!("{topic}, frame {first}")))
        }
        SourceArg::Path(path) => {
            let named = |index: u64| format!("{}, frame {index}", path.display());
            let still = Scene::default();
            Ok(match kind(path) {
                Kind::Image => (read_image(path)?, path.display().to_string()),
                Kind::Folder => {
                    (skip(&mut ImageFolder::open(path, Duration::ZERO, false)?, first, &still)?, named(first))
                }
                // It waits until somebody writes.
                Kind::Video if Pipe::is_at(path) => {
                    (skip(&mut Pipe::open(path)?, first, &still)?, named(first))
                }
                Kind::Video => (skip(&mut Video::open(path, false)?, first, &still)?, named(first)),
                Kind::Device => {
                    let index = index.unwrap_or(WARM_UP);
                    let wanted = camera.cloned().unwrap_or_else(CameraModel::laptop);
                    (skip(&mut Device::open(path, &wanted)?, index, &still)?, named(index))
                }
            })
        }
    }
}

/// The frame of that index.
fn skip(source: &mut dyn Source, index: u64, scene: &Scene) -> Result<Mat, SourceError> {
    for _ in 0..index {
        source.next_frame(Duration::ZERO, scene)?;
    }
    Ok(source.next_frame(Duration::ZERO, scene)?.image)
}

/// The classifier: the one named, that of the configuration, or the one for such a source.
fn model(args: &Args, source: &SourceArg, section: Option<&ModelSection>) -> Result<RobotModel, Failure> {
    let named = args.model.as_ref().or(section).filter(|section| **section != ModelSection::None);
    let model = crate::model::load(named.unwrap_or(&source.usual_model()))?;
    model.ok_or_else(|| "a look needs a model: give --model FILE".into())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn args(source: &str, out: &Path) -> Args {
        Args {
            source: Some(source.parse().unwrap()),
            from: None,
            out: Some(out.into()),
            model: None,
            camera: None,
            features: None,
            config: None,
            background: None,
            frame: None,
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
        assert!(
            failure(Path::new("/dev/video-that-is-not")).contains("/dev/video-that-is-not does not exist")
        );
        assert!(failure(Path::new("/dev/null")).contains("V4L2"));
        for name in ["broken.png", "broken.mkv"] {
            let broken = folder.path().join(name);
            std::fs::write(&broken, "neither").unwrap();
            assert!(failure(&broken).contains(name));
        }
        let empty = folder.path().join("empty");
        std::fs::create_dir(&empty).unwrap();
        assert!(failure(&empty).contains("no images"));
    }

    #[test]
    fn a_look_through_a_pipe_is_at_what_somebody_writes_there() {
        let folder = tempfile::tempdir().unwrap();
        let (pipe, out) = (folder.path().join("camera"), folder.path().join("x.png"));
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let hand = frame(&"rendered:3".parse().unwrap(), None, None, None).unwrap().0;
        let jpeg = gestalt_vision::source::encode_jpeg(&hand, 90).unwrap();
        let written = pipe.clone();
        let writing = std::thread::spawn(move || {
            let mut writer = std::fs::OpenOptions::new().write(true).open(written).unwrap();
            // Until the look is over.
            while std::io::Write::write_all(&mut writer, &jpeg).is_ok() {}
        });
        run(&args(pipe.to_str().unwrap(), &out)).unwrap();
        writing.join().unwrap();
        assert!(std::fs::read(&out).unwrap().starts_with(b"\x89PNG"));
    }

    #[test]
    fn a_look_leaves_its_picture_under_the_sources_name() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("x.png");
        run(&args("rendered:3", &out)).unwrap();
        assert!(std::fs::read(&out).unwrap().starts_with(b"\x89PNG"));
        let named = |source: &str| beside(&source.parse().unwrap());
        assert_eq!(named("some/where/fist.jpg"), Path::new("fist.look.png"));
        assert_eq!(named("/dev/video0"), Path::new("video0.look.png"));
        assert_eq!(named("rendered:3,seed=2"), Path::new("rendered-3.look.png"));
    }
}
