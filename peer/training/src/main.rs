//! Trains the networks of Gestalt's eyes, from drawn hands and openly licensed pictures.

mod camera;
mod chance;
mod counting;
mod course;
mod diagnosis;
mod drawn;
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
mod sheets;
mod surfaces;
mod train;

use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

use clap::Parser;

use course::{Course, Taught};
use judge::Table;
use photos::Photos;

/// The names of the weights' files, as the program embeds them.
const FILES: [&str; 3] = ["finder.net", "refiner.net", "counter.net"];

/// Trains the networks of Gestalt's eyes
#[derive(Parser)]
#[command(after_help = "Examples:
  gestalt-training --data ../shared/data --out weights
  gestalt-training --data ../shared/data --out weights --leave-one-out --effort 0.5")]
struct Args {
    /// Folder of the data sets
    #[arg(long)]
    data: PathBuf,
    /// Folder for the weights, the classifier, and masks that are kept for the next time
    #[arg(long)]
    out: PathBuf,
    /// Judge how eyes carry over: for each set, train with the others and look at it
    #[arg(long, conflicts_with = "leave_out")]
    leave_one_out: bool,
    /// Train without a set, and judge it; repeatable
    #[arg(long, value_name = "SET")]
    leave_out: Vec<String>,
    /// A set to be judged besides; repeatable
    #[arg(long, value_name = "SET")]
    judge: Vec<String>,
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
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    let cache = args.out.join("masks");
    std::fs::create_dir_all(&cache)?;
    let course = Course { effort: args.effort, seed: args.seed, began: Instant::now() };
    let photos = |left_out: &[String]| Photos::read(&args.data, &cache, left_out);
    if args.diagnose {
        return diagnosis::print(&args.out, &args.data, &photos(&args.leave_out)?);
    }
    if args.show {
        return course.show(photos(&args.leave_out)?, &args.out);
    }
    let mut table = Table::default();
    if args.leave_one_out {
        for set in &photos::SETS[..photos::COUNTED] {
            let left_out = [(*set).to_owned()];
            table.judge(&course.take(photos(&left_out)?)?, &args.data, set)?;
        }
    } else {
        let taught = course.take(photos(&args.leave_out)?)?;
        write(&taught, &args.out)?;
        for set in args.leave_out.iter().chain(&args.judge) {
            table.judge(&taught, &args.data, set)?;
        }
    }
    print!("{table}");
    Ok(())
}

fn write(taught: &Taught, out: &std::path::Path) -> Result<(), Box<dyn Error>> {
    for (name, bytes) in FILES.iter().zip(&taught.weights) {
        std::fs::write(out.join(name), bytes)?;
    }
    taught.model.write(&out.join("hands.gestalt"))?;
    Ok(())
}
