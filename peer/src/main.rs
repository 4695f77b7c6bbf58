//! The command line of Gestalt: see `gestalt --help`.

use std::process::ExitCode;

use gestalt_peer::heaps::Allocator;
use gestalt_peer::{cli, open_files};

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

fn main() -> ExitCode {
    let command = cli::Command::of_this_process();
    cli::start_log();
    open_files::raise_limit();
    match command.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // One line with every cause, whatever line breaks the causes have, and nothing that a terminal would obey.
            let line = error.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
            eprintln!("gestalt: {}", cli::clean(&line));
            ExitCode::FAILURE
        }
    }
}
