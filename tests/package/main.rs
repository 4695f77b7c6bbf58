//! What a package needs: a robot that tells its service manager how it is, units that systemd takes, and a `.deb` that lintian takes.

mod deb;
mod notify;
mod unit;

fn main() -> std::process::ExitCode {
    gestalt_trials::run(gestalt_trials::trials![
        [Waits] notify::a_robot_says_that_it_is_ready_that_it_lives_and_that_it_ends,
        [Waits] notify::a_robot_that_hangs_says_nothing,
        [Waits] notify::an_address_that_is_none_keeps_it_from_starting,
        [Works] unit::the_units_start_the_program_as_its_command_line_wants_it,
        [Works] unit::the_folder_of_robots_is_there_before_one_starts_as_the_units_have_it,
        [Works, Systemd] unit::systemd_takes_the_units_and_finds_them_hardened,
        [Works, Debian] deb::the_package_is_whole_and_lintian_finds_no_error,
    ])
}
