//! `gestalt completions` and `gestalt man`: what a shell and a reader need to know of all the verbs.

use std::path::PathBuf;

use clap::CommandFactory;
use clap_complete::Shell;

use super::{Command, Failure, say};

/// Print shell completions
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt completions bash > ~/.local/share/bash-completion/completions/gestalt
  gestalt completions fish > ~/.config/fish/completions/gestalt.fish")]
pub struct CompletionsArgs {
    /// Shell to complete for
    #[arg(value_enum)]
    shell: Shell,
}

/// Write man pages to a folder
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  gestalt man ~/.local/share/man/man1
  gestalt man /usr/local/share/man/man1")]
pub struct ManArgs {
    /// Folder to write to: gestalt.1, gestalt-peer.1, …
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

/// Prints the completions.
///
/// # Errors
/// When stdout cannot be written.
pub fn completions(args: &CompletionsArgs) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Command::command(), "gestalt", &mut script);
    say(&String::from_utf8(script)?)
}

/// Writes the pages.
///
/// # Errors
/// When the folder cannot be made or written.
pub fn man(args: &ManArgs) -> Result<(), Failure> {
    let failed = |cause| format!("cannot write man pages to {}: {cause}", args.folder.display());
    std::fs::create_dir_all(&args.folder).map_err(failed)?;
    clap_mangen::generate_to(Command::command(), &args.folder).map_err(failed)?;
    say(&format!("{}\n", args.folder.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_verb_has_a_page_and_a_completion() {
        let folder = tempfile::tempdir().unwrap();
        man(&ManArgs { folder: folder.path().join("man1") }).unwrap();
        let mut script = Vec::new();
        clap_complete::generate(Shell::Bash, &mut Command::command(), "gestalt", &mut script);
        let script = String::from_utf8(script).unwrap();
        for verb in Command::command().get_subcommands() {
            let name = verb.get_name();
            let page = std::fs::read_to_string(folder.path().join(format!("man1/gestalt-{name}.1"))).unwrap();
            assert!(page.contains("Examples:"), "{name}");
            assert!(script.contains(name), "{name}");
        }
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        assert!(man(&ManArgs { folder: file }).unwrap_err().to_string().contains("file"));
    }
}
