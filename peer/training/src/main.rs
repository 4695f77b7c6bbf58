//! Trains the networks of Gestalt's eyes, from drawn hands and openly licensed pictures.

mod camera;
mod chance;
mod counting;
mod course;
mod diagnosis;
mod drawn;
mod folder;
mod frames;
mod image;
mod judge;
mod learning;
mod look;
mod losses;
mod mining;
mod model;
mod networks;
mod photos;
mod places;
mod pools;
mod robots;
mod scenery;
mod sets;
mod sheets;
mod surfaces;
mod train;

use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

use clap::Parser;

use course::Course;
use judge::Table;
use photos::Photos;
use sets::Sets;

/// Trains the networks of Gestalt's eyes
#[derive(Parser)]
#[command(after_help = "Examples:
  gestalt-training --data ../shared/data --out weights
  gestalt-training --data ../shared/data --out weights --leave-one-out --effort 0.5")]
struct Args {
    /// Folder of data sets; repeatable: each set is looked for in all of them, in order
    #[arg(long, required = true)]
    data: Vec<PathBuf>,
    /// Folder for the weights, the classifier, and masks that are kept for the next time
    #[arg(long)]
    out: PathBuf,
    /// Judge how eyes carry over: for each set, train with the others and look at it
    #[arg(long, conflicts_with = "leave_out")]
    leave_one_out: bool,
    /// Train without a set, and judge it; repeatable
    #[arg(long, value_name = "SET")]
    leave_out: Vec<String>,
    /// A set to be judged besides; repeatable. Pictures that the eyes were made with are left out of what is judged
    #[arg(long, value_name = "SET")]
    judge: Vec<String>,
    /// A file for a line about each picture that is judged: path, what it shows (`none`: no hand), how sure a hand is found there, and
    /// where one is, how likely each count
    #[arg(long, value_name = "FILE")]
    looks: Option<PathBuf>,
    /// Share of the usual steps and pictures
    #[arg(long, default_value_t = 1.0)]
    effort: f32,
    /// Seed of all chance: on one machine, the same seed gives the same weights
    #[arg(long, default_value_t = 2026)]
    seed: u64,
    /// Only draw sheets of what the networks would be shown
    #[arg(long)]
    show: bool,
    /// Only say where in a look things go wrong, set by set, with the weights that are in the folder
    #[arg(long)]
    diagnose: bool,
    /// Train nothing: with the weights that are in the folder, look at the sets to be judged
    #[arg(long, requires = "judge", conflicts_with_all = ["leave_out", "leave_one_out"])]
    judge_only: bool,
    /// Train only the classifier, for the networks that are in the folder
    #[arg(long, conflicts_with_all = ["leave_one_out", "judge_only"])]
    classifier_only: bool,
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    let cache = args.out.join("masks");
    std::fs::create_dir_all(&cache)?;
    let course = Course { effort: args.effort, seed: args.seed, began: Instant::now() };
    let sets = Sets::in_folders(&args.data)?;
    let photos = |left_out: &[String]| Photos::read(&sets, &cache, left_out);
    if args.diagnose {
        return diagnosis::print(&args.out, &sets, &photos(&args.leave_out)?);
    }
    if args.show {
        return course.show(photos(&args.leave_out)?, &args.out);
    }
    if let Some(file) = &args.looks {
        folder::check_file(file)?;
    }
    let mut table = Table::default();
    if args.judge_only {
        let taught = folder::read(&args.out)?;
        for set in &args.judge {
            table.judge(&taught, &sets, set)?;
        }
    } else if args.classifier_only {
        folder::check(&args.out)?;
        let (weights, seen) = (folder::weights(&args.out)?, folder::images(&args.out)?);
        let taught = course.classify(photos(&args.leave_out)?, weights, seen)?;
        folder::write(&taught, &args.out)?;
        for set in args.leave_out.iter().chain(&args.judge) {
            table.judge(&taught, &sets, set)?;
        }
    } else if args.leave_one_out {
        for set in sets.counted().filter(|set| sets.folder(set).is_some()) {
            let left_out = [set.to_owned()];
            table.judge(&course.take(photos(&left_out)?)?, &sets, set)?;
        }
    } else {
        folder::check(&args.out)?;
        let taught = course.take(photos(&args.leave_out)?)?;
        folder::write(&taught, &args.out)?;
        for set in args.leave_out.iter().chain(&args.judge) {
            table.judge(&taught, &sets, set)?;
        }
    }
    print!("{table}");
    if let Some(file) = args.looks {
        folder::write_file(&file, table.looks.as_bytes())?;
    }
    Ok(())
}
