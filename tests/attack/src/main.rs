//! Plays every attack with twenty seeds and prints the table; ends with status 1 if one comes to something else than it says, with 2 where an
//! argument names nothing that could be played.
//!
//! `attack [NUMBER…]` plays those alone, `--seeds N` with other seeds.

use std::process::ExitCode;

use gestalt_attack::arguments::Arguments;

fn main() -> ExitCode {
    match Arguments::read(std::env::args().skip(1)) {
        Ok(Arguments { numbers, seeds }) if gestalt_attack::table::print(&numbers, seeds) => {
            ExitCode::SUCCESS
        }
        Ok(_) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(2)
        }
    }
}
