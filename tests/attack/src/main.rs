//! Plays every attack with twenty seeds and prints the table; ends with status 1 if one comes to something else than it says.
//!
//! `attack [NUMBER…]` plays those alone, `--seeds N` with other seeds.

use std::process::ExitCode;

fn main() -> ExitCode {
    let (mut seeds, mut numbers) = (20, Vec::new());
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--seeds" => match arguments.next().and_then(|seeds| seeds.parse().ok()) {
                Some(given) => seeds = given,
                None => {
                    eprintln!("--seeds needs a number");
                    return ExitCode::from(2);
                }
            },
            _ => numbers.push(argument),
        }
    }
    if gestalt_attack::table::print(&numbers, seeds) { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
