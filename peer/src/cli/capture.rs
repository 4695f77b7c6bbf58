//! `gestalt capture`: pictures of a gesture, for training.

use std::collections::BTreeMap;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::pin::pin;
use std::time::{Duration, Instant};

use gestalt_protocol::RobotId;
use gestalt_vision::dataset::NONE;
use gestalt_vision::perception::FeatureSet;
use gestalt_vision::source::{Frame, Pipe, Reader, Scene, Source, SourceError, encode_jpeg};
use gestalt_vision::steady::Broken;
use serde_json::json;

use super::show::{counted, line};
use super::source_arg::{Kind, Rendered, SourceArg, kind};
use super::{Failure, interrupted};
use crate::camera_source::open_source;
use crate::capture::{Album, Judge};
use crate::config::{CameraChoice, CameraSection, SourceSection};

/// Take pictures of a gesture into a folder that `gestalt train --dataset` reads. Each is checked: a hand is found, not cut off,
/// neither too bright nor too dark, sharp, and unlike those kept before. What is there is never written over
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt capture --gesture fist --source /dev/video0 --out hands
  gestalt capture --gesture palm --source palm.mp4 --every 200ms --count 50 --person 2 --out hands")]
pub struct Args {
    /// The gesture, which names its folder; `none` for pictures without a gesture, which need no hand
    #[arg(long, value_name = "NAME")]
    gesture: String,
    /// Camera source: a device (/dev/video0), a named pipe, a video, a folder of images, or a synthetic hand (`rendered:3`)
    #[arg(long, value_name = "SOURCE")]
    source: SourceArg,
    /// Folder of the dataset; its subfolders are gestures
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Stop after this many pictures kept
    #[arg(long, default_value_t = 30, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    count: u32,
    /// Time between two pictures; of a folder every image is looked at
    #[arg(long, default_value = "500ms", value_name = "DURATION", value_parser = super::duration)]
    every: Duration,
    /// Seconds of countdown before a camera's first picture
    #[arg(long, default_value_t = 3, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=60))]
    countdown: u8,
    /// Number of who shows the gesture: file names begin with `sNNN_`, so that training never puts one person on both sides of a
    /// split
    #[arg(long, value_name = "N")]
    person: Option<u32>,
    /// Camera model: the size and rate that a device is asked for
    #[arg(long, default_value = "laptop", value_name = "MODEL", value_parser = super::choice::camera())]
    camera: CameraChoice,
    /// Feature set whose eyes must find the hand: the one that is trained with [default: embedding, or shape with a rendered
    /// source]
    #[arg(long, value_name = "SET")]
    features: Option<FeatureSet>,
    /// Print events as JSON Lines, one object per picture
    #[arg(long)]
    json: bool,
}

/// The quality of the JPEG files.
const QUALITY: i32 = 95;

/// For how long none of a camera's may be worth keeping before it is given up, and how many that are drawn: files end by themselves.
const PATIENCE: Duration = Duration::from_secs(60);
const MOST_IN_VAIN: u32 = 500;

/// Runs the verb.
///
/// # Errors
/// A source or folder that cannot be used, and when no picture is worth keeping: why the most were not.
pub fn run(args: &Args) -> Result<(), Failure> {
    let rendered = matches!(args.source, SourceArg::Rendered(_));
    let features = args.features.unwrap_or(if rendered { FeatureSet::Shape } else { FeatureSet::Embedding });
    let mut feed = Feed::open(args)?;
    let judge = Judge::new(features, args.gesture != NONE)?;
    let album = Album::open(&args.out, &args.gesture, args.person)?;
    let mut session = Session { args, judge, album, kept: 0, refused: BTreeMap::new(), in_a_row: ("", 0) };
    super::runtime()?.block_on(async {
        let mut interrupted = pin!(interrupted());
        tokio::select! {
            biased;
            () = &mut interrupted => Ok(()),
            done = session.shoot(&mut feed) => done,
        }
    })?;
    session.sum_up(features)
}

/// Pictures as they come.
enum Feed {
    /// From a camera: the newest whenever one is wanted.
    Live(Reader, Duration),
    /// From files, or rendered: one out of so many.
    Still(Box<dyn Source>, Scene, u32),
}

impl Feed {
    fn open(args: &Args) -> Result<Self, Failure> {
        let mut scene = Scene::default();
        let source = match &args.source {
            SourceArg::Rendered(hand) => {
                let seed = hand.seed.unwrap_or(1);
                scene = Scene { gesture: hand.fingers, seed };
                SourceArg::Rendered(Rendered { fingers: None, seed: Some(seed), ..hand.clone() })
            }
            other => other.clone(),
        };
        let mut section = source.section()?;
        // Each picture once.
        if let SourceSection::Images(files) | SourceSection::Video(files) = &mut section {
            files.repeat = false;
        }
        let live = match &section {
            SourceSection::Device(_) | SourceSection::Ros(_) => true,
            SourceSection::Video(files) => Pipe::is_at(&files.path),
            _ => false,
        };
        let camera =
            CameraSection { model: args.camera.clone(), source: section, ..CameraSection::default() };
        let open = move || open_source(&camera, RobotId(0), Duration::ZERO);
        if live {
            let reader = Reader::start(None, Box::new(open), Instant::now())?;
            reader.want(Some(scene));
            return Ok(Self::Live(reader, args.every));
        }
        let source = open()?;
        let is_folder = matches!(&args.source, SourceArg::Path(path) if kind(path) == Kind::Folder);
        let step = args.every.as_secs_f64() / source.period().as_secs_f64().max(1e-3);
        let step = if is_folder { 1 } else { step.round().clamp(1.0, 10_000.0) as u32 };
        Ok(Self::Still(source, scene, step))
    }

    /// The next picture that is due.
    async fn next(&mut self) -> Result<Frame, SourceError> {
        match self {
            Self::Live(reader, every) => {
                tokio::time::sleep(*every).await;
                // One that waited is as old as the pause.
                reader.next().await?;
                reader.next().await
            }
            Self::Still(source, scene, step) => {
                // Files are read at once: whoever wants to end it is heard between them.
                tokio::task::yield_now().await;
                for _ in 1..*step {
                    source.next_frame(Duration::ZERO, scene)?;
                }
                source.next_frame(Duration::ZERO, scene)
            }
        }
    }

    /// Whether pictures may come again: a camera that fails is opened anew until it delivers.
    fn comes_back_after(&self, error: &SourceError) -> bool {
        matches!(self, Self::Live(..)) && !matches!(error, SourceError::Panicked(Broken::GivenUp(_)))
    }
}

/// One taking of pictures.
struct Session<'a> {
    args: &'a Args,
    judge: Judge,
    album: Album,
    kept: u32,
    refused: BTreeMap<&'static str, u32>,
    /// Why the last picture was not kept, and how many in a row were not for that.
    in_a_row: (&'static str, u32),
}

impl Session<'_> {
    async fn shoot(&mut self, feed: &mut Feed) -> Result<(), Failure> {
        if let Feed::Live(reader, _) = feed {
            // A camera that is not there is an error now, not after the countdown.
            reader.next().await?;
            self.count_down().await;
        }
        let (mut since, mut in_vain) = (Instant::now(), 0);
        while self.kept < self.args.count {
            match feed.next().await {
                Ok(frame) => match self.judge.judge(&frame.image)? {
                    None => {
                        let file = self.album.keep(&encode_jpeg(&frame.image, QUALITY)?)?;
                        self.kept += 1;
                        self.in_a_row = ("", 0);
                        (since, in_vain) = (Instant::now(), 0);
                        self.say_kept(&file)?;
                    }
                    Some(unfit) => {
                        in_vain += 1;
                        self.refuse(unfit.word(), &unfit.to_string())?;
                    }
                },
                // A pipe ends with its writer.
                Err(SourceError::Ended(_) | SourceError::WriterGone(_)) => break,
                Err(error @ SourceError::CutShort { .. }) => {
                    eprintln!("note: {error}");
                    break;
                }
                Err(error) if error.is_of_one_picture() => self.refuse("unreadable", &error.to_string())?,
                Err(error) if feed.comes_back_after(&error) => {
                    self.refuse("camera failed", &error.to_string())?;
                }
                Err(error) if self.kept == 0 => return Err(error.into()),
                Err(error) => {
                    eprintln!("note: {error}; it ends here");
                    break;
                }
            }
            let is_in_vain = match (&*feed, &self.args.source) {
                (Feed::Live(..), _) => since.elapsed() > PATIENCE,
                (_, SourceArg::Rendered(_)) => in_vain >= MOST_IN_VAIN,
                _ => false,
            };
            if is_in_vain {
                eprintln!("note: no picture was worth keeping for a while; it is given up");
                break;
            }
        }
        Ok(())
    }

    async fn count_down(&self) {
        for left in (1..=self.args.countdown).rev() {
            if std::io::stderr().is_terminal() || left == self.args.countdown {
                eprintln!("show \"{}\": {left} …", super::clean(&self.args.gesture));
            }
            tokio::time::sleep(Duration::from_secs(1)).await;
        }
    }

    fn say_kept(&self, file: &Path) -> Result<(), Failure> {
        let object = json!({"event": "kept", "file": file, "kept": self.kept, "count": self.args.count});
        line(
            self.args.json,
            &object,
            &format!("kept {} ({} of {})", file.display(), self.kept, self.args.count),
        )
    }

    fn refuse(&mut self, word: &'static str, why: &str) -> Result<(), Failure> {
        *self.refused.entry(word).or_default() += 1;
        let before = if self.in_a_row.0 == word { self.in_a_row.1 } else { 0 };
        self.in_a_row = (word, before + 1);
        let words = match before + 1 {
            1 => format!("not kept: {why}"),
            many if many.is_power_of_two() => format!("not kept: {why} ({many} in a row)"),
            // Whoever reads along has read it.
            _ if !self.args.json => return Ok(()),
            _ => String::new(),
        };
        line(self.args.json, &json!({"event": "not_kept", "cause": word, "why": why}), &words)
    }

    fn sum_up(&self, features: FeatureSet) -> Result<(), Failure> {
        let (folder, refused) = (self.album.folder(), self.refused.values().sum::<u32>());
        let causes: Vec<String> =
            self.refused.iter().map(|(word, count)| format!("{count} {word}")).collect();
        let causes = causes.join(", ");
        if self.kept == 0 {
            let why = if refused == 0 {
                "there were no pictures".to_owned()
            } else {
                format!("of {}: {causes}", counted(refused as usize, "picture"))
            };
            return Err(format!(
                "no picture was worth keeping: {why}; `gestalt look SOURCE` shows what is made of one"
            )
            .into());
        }
        let kept = counted(self.kept as usize, "picture");
        let mut words = format!("{kept} of \"{}\" in {}", self.args.gesture, folder.display());
        if refused > 0 {
            words.push_str(&format!("; {refused} not kept: {causes}"));
        }
        let set = features.name().split('-').next().unwrap_or_default();
        let train = format!(
            "gestalt train --dataset {} --features {set} --out hands.gestalt",
            self.args.out.display()
        );
        words.push_str(&format!("\nwith two gestures or more: {train}"));
        let object = json!({"event": "done", "folder": folder, "kept": self.kept, "not_kept": self.refused});
        line(self.args.json, &object, &words)
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

    fn capture(words: &[&str], out: &Path) -> Result<(), String> {
        let words = ["capture", "--out", out.to_str().unwrap()].into_iter().chain(words.iter().copied());
        run(&Line::try_parse_from(words).unwrap().args).map_err(|error| error.to_string())
    }

    fn pictures(folder: &Path) -> usize {
        std::fs::read_dir(folder).map_or(0, |found| found.count())
    }

    #[test]
    fn gestures_are_captured_into_a_dataset_and_captured_again_into_more_of_it() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("hands");
        for fingers in ["2", "5"] {
            let source = format!("rendered:{fingers}");
            capture(&["--gesture", fingers, "--source", &source, "--count", "1"], &out).unwrap();
        }
        capture(
            &["--gesture", "2", "--source", "rendered:2,bearing=30", "--count", "1", "--person", "7"],
            &out,
        )
        .unwrap();
        assert_eq!((pictures(&out.join("2")), pictures(&out.join("5"))), (2, 1));
        let listed = gestalt_vision::dataset::Dataset::list(&out, None).unwrap();
        assert_eq!(
            (listed.vocabulary.labels(), listed.images.len()),
            (["2".to_owned(), "5".to_owned()].as_slice(), 3)
        );
        assert!(out.join("2/s007_0002.jpg").exists());
        // A folder of pictures is a source too, and ends; of the two that are alike in nothing, both are kept.
        let again = folder.path().join("again");
        let source = out.join("2");
        capture(&["--gesture", "two", "--source", source.to_str().unwrap(), "--features", "shape"], &again)
            .unwrap();
        assert_eq!(pictures(&again.join("two")), 2);
    }

    /// A camera that shows one grey, and fails after so many pictures.
    struct Hiccup {
        level: u8,
        left: u8,
    }

    impl Source for Hiccup {
        fn describe(&self) -> String {
            "a camera in a test".to_owned()
        }
        fn period(&self) -> Duration {
            Duration::from_millis(5)
        }
        fn is_live(&self) -> bool {
            true
        }
        fn next_frame(&mut self, now: Duration, _: &Scene) -> Result<Frame, SourceError> {
            std::thread::sleep(self.period());
            self.left -= 1;
            match self.left {
                0 => Err(SourceError::NoFrame("/dev/video7".into())),
                _ => Frame::from_bgr(32, 24, &[self.level; 32 * 24 * 3], now),
            }
        }
    }

    #[test]
    fn a_camera_that_fails_and_comes_back_is_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let words =
            ["capture", "--gesture", "none", "--source", "/dev/video7", "--countdown", "0", "--count", "3"];
        let words = words.into_iter().chain(["--every", "1ms", "--out", folder.path().to_str().unwrap()]);
        let args = Line::try_parse_from(words).unwrap().args;
        // One picture of each opening is kept, the others repeat it; it opens at every third try.
        let mut tries = 0_u8;
        let open = move || -> Result<Box<dyn Source>, SourceError> {
            tries = tries.wrapping_add(1);
            match tries % 3 {
                1 => Ok(Box::new(Hiccup { level: tries.wrapping_mul(20), left: 40 })),
                _ => Err(SourceError::Missing("/dev/video7".into())),
            }
        };
        let reader = Reader::start(None, Box::new(open), Instant::now()).unwrap();
        reader.want(Some(Scene::default()));
        let mut feed = Feed::Live(reader, args.every);
        let mut session = Session {
            args: &args,
            judge: Judge::new(FeatureSet::Shape, false).unwrap(),
            album: Album::open(&args.out, &args.gesture, args.person).unwrap(),
            kept: 0,
            refused: BTreeMap::new(),
            in_a_row: ("", 0),
        };
        crate::cli::runtime().unwrap().block_on(session.shoot(&mut feed)).unwrap();
        assert_eq!((session.kept, pictures(&folder.path().join("none"))), (3, 3));
        assert!(session.refused.contains_key("camera failed"), "{:?}", session.refused);
    }

    #[test]
    fn a_source_that_shows_nothing_is_an_error_that_says_so() {
        let folder = tempfile::tempdir().unwrap();
        let error = capture(&["--gesture", "fist", "--source", "missing.mp4"], folder.path()).unwrap_err();
        assert!(error.contains("missing.mp4 does not exist"), "{error}");
        assert!(!folder.path().join("fist").exists(), "nothing is made before there is a source");
        let empty = folder.path().join("empty");
        std::fs::create_dir(&empty).unwrap();
        let error =
            capture(&["--gesture", "fist", "--source", empty.to_str().unwrap()], folder.path()).unwrap_err();
        assert!(error.contains("no images"), "{error}");
        let error = capture(&["--gesture", "../fist", "--source", "rendered:2"], folder.path()).unwrap_err();
        assert!(error.contains("no name for a gesture"), "{error}");
        let error = capture(&["--gesture", "fist", "--source", "/dev/null"], folder.path()).unwrap_err();
        assert!(error.contains("no camera that V4L2 can open"), "{error}");
    }
}
