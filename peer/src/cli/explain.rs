//! `gestalt explain`: pictures of what the rules pick.

use std::path::PathBuf;

use super::{Failure, say};
use gestalt_lab::explain::{self, Subject};

/// Draw what each rule picks among the same points of the plane, as the rules themselves pick it
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Which rules
    #[arg(value_enum)]
    subject: Rules,
    /// The drawing
    #[arg(long, value_name = "FILE.svg")]
    out: PathBuf,
}

/// Which rules to explain.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Rules {
    /// Which samples are shared
    Selection,
    /// Which samples are forgotten
    Forgetting,
}

/// Draws and says where.
///
/// # Errors
/// When the drawing cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let subject = match args.subject {
        Rules::Selection => Subject::Selection,
        Rules::Forgetting => Subject::Forgetting,
    };
    explain::draw(subject, &args.out)?;
    say(&format!("{}\n", args.out.display()))
}
