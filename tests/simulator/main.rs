//! The simulator of `examples/simulator`, built as its README says, and run: a C++ program that drives minds through the C interface.

mod built;
mod picture;
mod showing;
mod swarm;

fn main() -> std::process::ExitCode {
    gestalt_trials::run(gestalt_trials::trials![
        [Works, Enki] swarm::ten_marxbots_in_range_hold_one_decision_in_each_of_twenty_showings,
        [Works, Enki] swarm::over_radio_ranges_those_agree_who_can_reach_each_other,
        [Works, Enki] swarm::the_same_seed_gives_the_same_trace_byte_for_byte,
        [Works, Enki, Valgrind] swarm::valgrind_finds_no_error_and_no_leak,
        [Works, Enki] swarm::what_cannot_be_run_is_said,
        [Works, Enki] swarm::the_radio_alone_survives_garbage_under_sanitizers,
        [Works] swarm::views_are_the_same_twice_and_bounded,
    ])
}
