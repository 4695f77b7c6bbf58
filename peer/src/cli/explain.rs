//! `gestalt explain`: pictures of what the rules pick.

use std::path::PathBuf;

use super::{Failure, say};
use gestalt_lab::explain::{self, Subject};

/// Draw which samples each rule picks among the same points of the plane
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt explain selection --out selection.svg
  gestalt explain forgetting --out forgetting.png")]
pub struct Args {
    /// Rules to explain
    #[arg(value_enum)]
    subject: Rules,
    /// Picture to write (SVG or PNG, by the file extension)
    #[arg(long, value_name = "FILE.svg|FILE.png")]
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
