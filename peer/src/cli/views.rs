//! `gestalt views`: what a camera sees of drawn hands from many places, for simulators without a renderer.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::Duration;

use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::config::LayerConfig;
use gestalt_vision::perception::{FeatureSet, HandConfig, Perception};
use gestalt_vision::pose::Pose;
use gestalt_vision::source::{RenderedSource, Scene, Source};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Failure, progress, say};
use crate::config::{CameraChoice, ModelSection};

/// Write what a camera sees of drawn hands from many places, as feature vectors: the eyes of simulated robots
///
/// One line of CSV for each hand, place, gesture and frame: `hand,bearing_deg,distance_m,gesture,frame,quality`, then the
/// features. Where no hand was found, quality and features are missing. The same arguments write the same bytes.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt views --out views.csv
  gestalt views --camera parrot --hands 8 --distances 0.8,1.2,1.6 --out views.csv")]
pub struct Args {
    /// File to write
    #[arg(long, value_name = "FILE.csv")]
    out: PathBuf,
    /// Camera model
    #[arg(long, value_name = "MODEL", default_value = "footbot", value_parser = super::choice::camera())]
    camera: CameraChoice,
    /// Model whose features are computed: a file written by `gestalt train`, `rendered` (drawn hands with a glove), or `hands`
    /// (learned eyes, which know bare hands: these are drawn for them)
    #[arg(long, value_name = "FILE|hands|rendered", default_value = "rendered")]
    model: ModelSection,
    /// How many hands, each of another person, in another light, seen by other specimens of the camera
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..=1000))]
    hands: u16,
    /// How many frames of each
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..=100))]
    frames: u16,
    /// Bearings, in degrees: 0 faces the palm, ±90 sees the hand edge on
    #[arg(long, value_name = "DEG,…", value_delimiter = ',', allow_hyphen_values = true,
        default_values_t = [-75.0, -60.0, -45.0, -30.0, -15.0, 0.0, 15.0, 30.0, 45.0, 60.0, 75.0])]
    bearings: Vec<f64>,
    /// Distances, in metres
    #[arg(long, value_name = "M,…", value_delimiter = ',', default_values_t = [0.6, 0.8, 1.0, 1.2])]
    distances: Vec<f64>,
    /// Height of the camera above the hand as an angle, in degrees; negative looks up from the floor
    #[arg(long, value_name = "DEG", default_value_t = -15.0, allow_hyphen_values = true)]
    elevation: f64,
    /// What the hands, the lights and the cameras follow from
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// More lines than any simulator needs, and some 200 MB.
const MOST_VIEWS: usize = 200_000;

/// Gestures of a drawn hand: 0 to 5 raised fingers.
const GESTURES: u8 = 6;

/// Draws, looks, and writes.
///
/// # Errors
/// When a place is none, the model cannot be used, or the file cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let places = places(args)?;
    let per_place = usize::from(GESTURES) * usize::from(args.frames);
    let views = places.len() * usize::from(args.hands) * per_place;
    if views > MOST_VIEWS {
        return Err(format!("{views} views are more than {MOST_VIEWS}: ask for fewer hands or places").into());
    }
    let named = crate::model::load(&args.model)?;
    let features =
        named.ok_or("views are of a model's features: give --model FILE, hands or rendered")?.features;
    let model = args.camera.properties();
    let unwritable = |cause| {
        format!(
            "cannot write {}: {cause}: its folder must be there, with room, and yours to write to",
            args.out.display()
        )
    };
    gestalt_file::check(&args.out).map_err(unwritable)?;
    let mut table = heading(features);
    let (mut chance, mut found) = (ChaCha8Rng::seed_from_u64(args.seed), 0);
    let shown = progress::bar("views", views);
    for hand in 0..args.hands {
        for pose in &places {
            let place =
                Place { hand, pose: *pose, camera: model.specimen(&mut chance), seed: chance.random() };
            let (lines, hands) = place.look(features, args)?;
            table.push_str(&lines);
            found += hands;
            shown.inc(per_place as u64);
        }
    }
    gestalt_file::write(&args.out, table.as_bytes()).map_err(unwritable)?;
    shown.finish_and_clear();
    let (set, out) = (features.name(), args.out.display());
    say(&format!("{views} views, a hand found in {found}, features: {set} → {out}\n"))
}

/// All places, from the left to the right.
fn places(args: &Args) -> Result<Vec<Pose>, Failure> {
    let mut places = Vec::new();
    for &bearing_deg in &args.bearings {
        for &distance_m in &args.distances {
            let pose = Pose { bearing_deg, elevation_deg: args.elevation, distance_m };
            pose.validate()?;
            places.push(pose);
        }
    }
    Ok(places)
}

fn heading(features: FeatureSet) -> String {
    let mut line = "hand,bearing_deg,distance_m,gesture,frame,quality".to_owned();
    for n in 0..features.length() {
        let _ = write!(line, ",f{n}");
    }
    line.push('\n');
    line
}

/// One camera before one person.
struct Place {
    hand: u16,
    pose: Pose,
    camera: CameraModel,
    seed: u64,
}

impl Place {
    /// All gestures as lines of CSV, and in how many frames a hand was found.
    fn look(&self, features: FeatureSet, args: &Args) -> Result<(String, usize), Failure> {
        let mut source = RenderedSource::new(self.camera.clone(), self.pose, features.glove(), self.seed)?;
        let layer = LayerConfig::ALL;
        let mut perception =
            Perception::for_camera(features, HandConfig::default(), layer, &args.camera.properties())?;
        let (mut lines, mut found) = (String::new(), 0);
        // Another seed, another person; the same one for all places.
        let person = args.seed.rotate_left(32) ^ u64::from(self.hand);
        for gesture in 0..GESTURES {
            for frame in 0..args.frames {
                let scene = Scene { gesture: Some(gesture), seed: person };
                let at = Duration::from_secs_f64(f64::from(frame) / self.camera.fps);
                let seen = perception.observe(&source.next_frame(at, &scene)?.image);
                let Pose { bearing_deg, distance_m, .. } = self.pose;
                let _ = write!(lines, "{},{bearing_deg},{distance_m},{gesture},{frame},", self.hand);
                if let Ok(seen) = &seen {
                    found += 1;
                    let _ = write!(lines, "{}", seen.quality);
                    for value in &seen.features {
                        let _ = write!(lines, ",{value}");
                    }
                }
                lines.push('\n');
            }
        }
        Ok((lines, found))
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        args: Args,
    }

    #[test]
    fn learned_eyes_are_shown_bare_hands_and_find_most() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("views.csv");
        let lines = |model: &str| {
            let words = ["views", "--out", out.to_str().unwrap(), "--model", model, "--hands", "2"];
            let place = ["--frames", "1", "--bearings", "0", "--distances", "0.6"];
            run(&Line::try_parse_from(words.into_iter().chain(place)).unwrap().args)?;
            Ok::<_, Failure>(std::fs::read_to_string(&out)?)
        };
        let seen = lines("hands").unwrap();
        assert_eq!(seen.lines().next().unwrap().split(',').count(), 6 + FeatureSet::Embedding.length());
        let found = seen.lines().skip(1).filter(|line| !line.ends_with(',')).count();
        assert!(found >= 8, "{found} of 12");
        let gloved = lines("rendered").unwrap();
        assert_eq!(gloved.lines().next().unwrap().split(',').count(), 6 + FeatureSet::Shape.length());
        assert!(lines("none").unwrap_err().to_string().contains("--model FILE"));
    }
}
