//! `gestalt vocabulary`: gestures to show, what they mean, and pictures of them.

use std::fmt::Write as _;
#[cfg(feature = "opencv")]
use std::path::{Path, PathBuf};

#[cfg(feature = "opencv")]
use gestalt_vision::source::Glove;
use gestalt_vision::vocabulary::GestureBook;
use serde_json::json;

use super::show::clean;
use super::{Failure, say};

/// Print a ready vocabulary of gestures and their meanings, draw it, or make training pictures of it
///
/// Ready are `spatial` (directions, and whom they concern) and `rescue` (search and rescue); any other is a file, written as those in
/// configs/vocabularies. `gestalt teach new --vocabulary NAME` teaches one to a running swarm.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// `spatial`, `rescue`, or a file (JSON5)
    #[arg(value_name = "NAME|FILE", default_value = "spatial")]
    name: String,
    /// SVG or PNG file to draw it in
    #[cfg(feature = "opencv")]
    #[arg(long, value_name = "FILE.svg|FILE.png")]
    out: Option<PathBuf>,
    /// Folder for training pictures of drawn hands, a folder per gesture, as `gestalt train` reads them
    #[cfg(feature = "opencv")]
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    /// How many people show each gesture there, each to one camera, of each model in turn
    #[cfg(feature = "opencv")]
    #[arg(long, value_name = "N", default_value_t = 60, requires = "pictures",
        value_parser = clap::value_parser!(u32).range(1..=1000))]
    people: u32,
    /// What the hands wear there: cyan or orange gloves, or `skin`
    #[cfg(feature = "opencv")]
    #[arg(long, value_name = "GLOVE", default_value = "cyan", requires = "pictures", value_parser = super::choice::glove())]
    glove: Glove,
    /// What people, light and places follow from
    #[cfg(feature = "opencv")]
    #[arg(long, value_name = "N", default_value_t = 1, requires = "pictures")]
    seed: u64,
    /// Print it as one JSON object
    #[arg(long)]
    json: bool,
}

#[cfg(feature = "opencv")]
const EXAMPLES: &str = "Examples:
  gestalt vocabulary rescue --out rescue.png
  gestalt vocabulary spatial --pictures out/spatial --people 30";
#[cfg(not(feature = "opencv"))]
const EXAMPLES: &str = "Examples:
  gestalt vocabulary rescue
  gestalt vocabulary spatial --json";

/// Runs the verb.
///
/// # Errors
/// For what is no vocabulary, and when a picture cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let book = GestureBook::find(&args.name)?;
    #[cfg(feature = "opencv")]
    if let Some(out) = &args.out {
        gestalt_draw::check(out)?;
        let hands = crate::picture::vocabulary::hands(&book)?;
        gestalt_draw::write(&crate::picture::vocabulary::draw(&book, &hands)?, out)?;
    }
    #[cfg(feature = "opencv")]
    if let Some(folder) = &args.pictures {
        let kept = keep(&book, folder, args.people, args.glove, args.seed)?;
        eprintln!("{kept} pictures → {}", folder.display());
    }
    if args.json {
        let gestures: Vec<_> = book
            .gestures
            .iter()
            .map(|gesture| json!({"name": gesture.name, "meaning": gesture.meaning, "show": gesture.show}))
            .collect();
        return say(&format!("{}\n", json!({"title": book.title, "gestures": gestures})));
    }
    let widest = book.gestures.iter().map(|gesture| gesture.name.chars().count()).max().unwrap_or(0);
    let mut words = format!("{}\n", clean(&book.title));
    for gesture in &book.gestures {
        let [name, meaning, show] =
            [&gesture.name, &gesture.meaning, &gesture.show].map(|words| clean(words));
        let _ = writeln!(words, "  {name:widest$}  {meaning} {show}");
    }
    say(&words)
}

/// Keeps pictures of each gesture, shown by so many people, each to a camera in a place of its own.
#[cfg(feature = "opencv")]
fn keep(book: &GestureBook, folder: &Path, people: u32, glove: Glove, seed: u64) -> Result<usize, Failure> {
    use crate::capture::Album;
    use gestalt_vision::source::encode_jpeg;
    use gestalt_vision::source::rendered::TrainingFrames;

    const QUALITY: i32 = 92;
    /// Robots around a hand see it from as far aside as this.
    const BEARING_DEG: f64 = 45.0;
    let frames = TrainingFrames::new(Vec::new(), glove, BEARING_DEG, seed).showing(book.poses());
    // Drawn again by the same seed, each picture would be there twice.
    let is_kept = |folder: &Path| std::fs::read_dir(folder).is_ok_and(|mut kept| kept.next().is_some());
    if let Some(kept) = book.gestures.iter().map(|it| folder.join(&it.name)).find(|it| is_kept(it)) {
        return Err(format!(
            "{} holds pictures already: choose another folder, or remove it",
            kept.display()
        )
        .into());
    }
    let wanted = people as usize * book.gestures.len();
    let shown = super::progress::bar("pictures", wanted);
    for frame in frames.take(wanted) {
        let frame = frame?;
        let gesture = &book.gestures[usize::from(frame.class)];
        let mut album = Album::open(folder, &gesture.name, Some(frame.group + 1))?;
        album.keep(&encode_jpeg(&frame.image, QUALITY)?)?;
        shown.inc(1);
    }
    shown.finish_and_clear();
    Ok(wanted)
}
