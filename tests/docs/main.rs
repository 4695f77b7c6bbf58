//! Every shell block of the documentation, run word for word in a folder that has what it speaks of: photographs, a video, the
//! configurations. And a newcomer's way with real hands. What cannot run is named, with the reason.

mod blocks;
mod figures;
mod newcomer;
mod stage;

fn main() -> std::process::ExitCode {
    gestalt_trials::run(gestalt_trials::trials![
        [Works] blocks::those_of_the_readme_run_as_they_are_written,
        [Works] blocks::those_of_the_guides_run_as_they_are_written,
        [Works] blocks::all_others_run_as_they_are_written,
        [Waits] blocks::what_is_not_run_is_still_there,
        [Works] figures::those_of_the_rules_of_fusion_are_what_is_printed,
        [Works, Data] newcomer::photographs_and_a_video_lead_to_a_model_and_a_robot_that_decides,
    ])
}
