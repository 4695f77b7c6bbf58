//! How far a verb has come, on stderr.

use indicatif::{ProgressBar, ProgressStyle};

/// A bar over `total` steps; invisible where stderr is no terminal.
pub fn bar(what: &'static str, total: usize) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg:>10} [{bar:40}] {pos}/{len} {eta}")
        .expect("the template is a constant that every test of a verb uses");
    ProgressBar::new(total as u64).with_style(style.progress_chars("=> ")).with_message(what)
}
