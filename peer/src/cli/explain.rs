//! `gestalt explain`: pictures of what the rules pick.

use std::path::PathBuf;

use super::{Failure, say};
use crate::explain::{self, Subject};

/// Draw what each rule picks among the same points of the plane, as the rules themselves pick it
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Which rules
    #[arg(value_enum)]
    subject: Subject,
    /// The drawing
    #[arg(long, value_name = "FILE.svg")]
    out: PathBuf,
}

/// Draws and says where.
///
/// # Errors
/// When the drawing cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    explain::draw(args.subject, &args.out)?;
    say(&format!("{}\n", args.out.display()))
}
