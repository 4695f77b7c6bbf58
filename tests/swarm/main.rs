//! Whole swarms on real Zenoh, one subject a file. Each line of the table says what a scenario does most of its time, and
//! what it needs of the machine; what waits runs side by side. The long ones come first.

mod announced;
mod asking;
mod cameras;
mod cells;
mod center;
mod churn;
mod clients;
mod cost;
mod cut_off;
mod doctor;
mod eyes;
mod false_answers;
mod field;
mod filmed;
mod foxglove;
mod in_process;
mod knocking;
mod knowledge;
mod learning;
mod liar;
mod line;
mod memory;
mod mixed;
mod motion;
mod naming;
mod paced;
mod page;
mod partition;
mod pause;
mod proofs;
mod python_examples;
mod recording;
mod respelling;
mod restarts;
mod ring;
mod ros;
mod ros_examples;
mod scouting;
mod siege;
mod soak;
mod stranger;
mod stream;
mod talking;
mod trouble;
mod unprinted;
mod wall;

fn main() -> std::process::ExitCode {
    if let Some(ended) = knocking::knocks_instead() {
        return ended;
    }
    gestalt_trials::run_in_real_time(gestalt_trials::trials![
        [Waits] cost::signatures_cost_a_link_less_than_as_much_again.await,
        [Works] mixed::footbots_on_board_and_parrots_of_a_centre_decide_twenty_gestures_alike,
        [Waits] in_process::twenty_robots_agree_in_each_of_twenty_rounds.await,
        [Waits, Namespaces] churn::a_grid_under_churn_never_ends_a_round_differently_and_agrees_in_calm,
        [Works] motion::gestures_start_rounds_and_all_robots_decide_them_alike.await,
        [Waits] asking::robots_that_see_different_gestures_ask_once_and_again_no_sooner_than_they_may.await,
        [Waits, Namespaces] knowledge::under_loss_cuts_a_death_and_a_late_joiner_all_end_with_the_same_knowledge,
        [Waits] memory::killed_at_any_moment_it_remembers_and_shares_nothing_twice.await,
        [Waits] restarts::no_sample_has_a_label_that_nobody_gave_it_after_all_were_killed,
        [Works, Namespaces] soak::liars_and_a_stranger_change_nothing_for_hours,
        [Works, Namespaces] center::a_stream_cut_and_a_centre_killed_come_back_to_a_centre_that_decides,
        [Waits] learning::ten_robots_on_a_ring_hold_what_the_source_says_and_tell_the_gestures_apart.await,
        [Waits] learning::the_size_follows_the_formula_over_real_links.await,
        [Works, Namespaces] center::a_stream_cut_and_a_centre_killed_come_back_to_robots_that_gossip,
        [Waits] clients::a_client_hears_each_decision_once_and_can_ask_and_instruct.await,
        [Waits] clients::a_decision_is_announced_once_though_the_spokesrobot_is_killed.await,
        [Waits, Namespaces] partition::a_part_without_the_majority_decides_nothing_and_says_why,
        [Waits, Queues] partition::a_part_that_is_not_heard_by_the_majority_decides_nothing_and_says_why,
        [Waits, Queues] partition::a_part_that_does_not_hear_the_majority_decides_nothing_and_says_why,
        [Waits, Queues] partition::parts_of_slow_neighbours_come_together_as_soon,
        [Waits, Namespaces] partition::the_parts_of_a_cut_swarm_decide_apart_and_agree_at_the_heal,
        [Waits, Namespaces] cut_off::a_robot_whose_neighbours_and_strangers_lose_power_lets_clients_in,
        [Waits, Namespaces] pause::a_line_that_stood_still_agrees_again,
        [Waits] trouble::votes_cost_little_while_a_round_is_open_and_nothing_otherwise.await,
        [Waits] recording::a_run_with_faults_is_recorded_whole_proven_and_counted_otherwise.await,
        [Waits] recording::a_recorder_that_is_killed_loses_less_than_a_second.await,
        [Waits, Mount] recording::a_full_disk_ends_the_recorder_and_not_the_swarm.await,
        [Waits, Mount] memory::a_full_disk_is_reported_and_the_robot_votes_on_and_recovers.await,
        [Works, Namespaces] center::foot_bots_and_parrots_of_a_centre_that_decides_are_one_ballot,
        [Works, Namespaces] center::foot_bots_and_parrots_of_a_centre_in_which_they_gossip_are_one_ballot,
        [Waits] doctor::faults_that_are_planted_are_each_named_with_their_fix.await,
        [Waits] doctor::a_healthy_swarm_is_found_well_within_five_seconds.await,
        [Waits] doctor::a_visit_leaves_no_trace_at_the_robots.await,
        [Waits, Mount] doctor::a_disk_without_room_and_one_that_is_read_only_are_told_apart.await,
        [Waits] cameras::a_robot_whose_camera_is_missing_relays_and_agrees.await,
        [Waits] cameras::a_camera_that_hangs_keeps_nobody.await,
        [Waits] unprinted::a_full_disk_under_the_output_takes_no_robot_and_no_centre_out_of_its_swarm.await,
        [Waits] cameras::a_streamed_camera_that_hangs_is_not_looked_at_until_it_goes_on.await,
        [Waits] cameras::pictures_that_vanish_and_come_back_are_taken_up_again.await,
        [Waits, Namespaces] line::the_eighth_in_a_line_decides_what_the_first_two_see,
        [Waits, Namespaces] ring::a_ring_goes_on_after_a_relay_is_killed,
        [Waits] in_process::what_the_first_two_of_a_line_see_the_last_decides.await,
        [Waits] naming::a_gesture_that_is_named_and_shown_five_times_is_known_to_all_of_a_line.await,
        [Waits] learning::a_correction_and_an_undo_reach_every_robot.await,
        [Waits] learning::forged_samples_are_refused_counted_and_named_and_nothing_is_trained_on_them.await,
        [Works] learning::a_robot_votes_and_decides_while_it_trains.await,
        [Waits] eyes::nobody_waits_for_a_source_that_panics.await,
        [Waits] stream::a_camera_that_is_missing_vanishes_and_returns_is_streamed_when_it_is_there.await,
        [Waits] stream::a_pipe_whose_writers_come_and_go_is_streamed_while_there_is_one.await,
        [Waits] stream::pictures_that_appear_late_and_bad_ones_among_them_are_streamed.await,
        [Waits] stream::one_frame_is_under_way_and_who_is_not_answered_asks_once_a_second.await,
        [Waits] stream::of_two_cameras_that_stream_as_one_robot_the_later_is_looked_at.await,
        [Waits] paced::a_camera_is_asked_seldom_between_rounds_and_in_one_as_often_as_its_frames_count.await,
        [Waits] paced::a_camera_that_is_slower_than_a_centre_is_patient_keeps_its_seat.await,
        [Waits] paced::a_camera_that_loses_acknowledgements_sends_seldom_and_keeps_nobody_waiting.await,
        [Waits] stream::a_peer_looks_through_a_camera_that_is_elsewhere.await,
        [Waits] stream::nonsense_on_the_keys_of_frames_is_counted_and_nothing_breaks.await,
        [Waits] stream::who_is_there_already_and_who_comes_too_many_is_refused_and_counted.await,
        [Waits] ros::a_ros_system_hears_what_a_swarm_decides_and_teaches_it.await,
        [Works] ros::a_robot_sees_through_a_camera_that_a_ros_driver_owns.await,
        [Waits, Rospy] ros_examples::rospy_echoes_a_decision.await,
        [Waits, Rclpy] ros_examples::rclpy_over_dds_echoes_a_decision.await,
        [Works] ros_examples::words_of_ros_mean_what_they_mean_to_the_program,
        [Works] ros_examples::examples_for_ros_take_no_late_decision_for_the_last,
        [Waits, Zenoh] python_examples::a_word_from_python_is_about_the_round_that_was_opened_for_it.await,
        [Waits] trouble::random_bytes_on_every_key_are_refused_by_name_and_the_swarm_goes_on.await,
        [Waits] trouble::well_formed_lies_are_refused_and_the_swarm_goes_on.await,
        [Waits] trouble::a_robot_with_anothers_id_is_reported_and_the_swarm_goes_on.await,
        [Waits] stranger::one_who_is_no_member_changes_nothing_and_every_lie_is_named.await,
        [Waits] stranger::what_its_robots_learn_is_said_by_its_members_and_passed_on_as_they_said_it.await,
        [Waits] wall::a_stranger_in_any_mode_neither_reads_nor_changes_anything.await,
        [Waits] wall::clients_with_a_key_are_let_in_and_do_what_they_may_and_no_more.await,
        [Waits] wall::who_is_expelled_counts_no_more_in_the_midst_of_a_round_and_comes_back_with_a_new_key.await,
        [Waits] wall::an_open_robot_and_a_sealed_one_do_not_link.await,
        [Waits] filmed::frames_are_their_robots_own_and_new_whatever_a_member_makes_of_them.await,
        [Waits] wall::junk_at_the_door_keeps_no_member_out.await,
        [Waits] page::what_the_page_shows_and_says_is_what_the_swarm_says_and_hears.await,
        [Waits, Websockets] foxglove::a_viewer_in_python_sees_what_zenoh_carries_teaches_and_sees_the_links.await,
        [Waits] foxglove::viewers_that_never_read_are_dropped_and_rounds_stay_as_quick.await,
        [Works, Browser] page::a_browser_shows_teaches_and_says_when_it_is_no_longer_live.await,
        [Works, Axe] page::axe_finds_nothing_serious_on_the_page.await,
        [Waits, Prometheus] page::metrics_are_read_by_promtool_and_by_python.await,
        [Waits] knocking::who_was_expelled_and_links_ten_times_a_second_changes_nothing_and_is_kept_waiting.await,
        [Waits] false_answers::robots_that_find_each_other_do_so_though_their_calls_are_answered_by_a_liar.await,
        [Waits] false_answers::a_client_of_a_sealed_swarm_attaches_to_its_robots_and_to_no_one_else.await,
        [Waits] false_answers::a_client_attaches_to_its_own_swarm_and_comes_back_to_it.await,
        [Works, Browser] talking::a_question_of_the_swarm_is_answered_by_its_button_and_a_new_gesture_is_named.await,
        [Waits] liar::who_gives_what_does_not_follow_is_known_to_all_and_counts_no_more.await,
        [Waits] liar::who_says_two_things_is_known_to_all_and_counts_no_more.await,
        [Works, Cryptography] stranger::a_decision_is_proven_by_two_programs_and_no_other_is,
        [Works, Cryptography] proofs::what_robots_decide_both_programs_prove_as_it_was_published,
        [Works, Cryptography] proofs::a_line_of_watch_is_its_decision_to_both_programs,
        [Works, Cryptography] proofs::what_a_member_makes_of_a_decision_both_programs_judge_alike,
        [Works, Cryptography] proofs::a_number_in_other_digits_both_programs_judge_alike,
        [Works, Cryptography] proofs::a_file_in_other_words_both_programs_judge_alike,
        [Waits] trouble::an_occupied_port_is_an_error_that_names_it.await,
        [Waits] trouble::a_black_hole_in_the_routing_delays_and_loses_nothing.await,
        [Alone, Namespaces] ring::a_round_in_which_a_relay_freezes_ends_the_same_everywhere,
        [Alone] paced::a_slow_centre_drops_frames_evenly_and_its_memory_stays_flat.await,
        [Alone] siege::two_thousand_half_open_connections_and_ghosts_slow_no_round_and_keep_no_member_out.await,
        [Alone] wall::who_opens_many_sessions_keeps_nobody_out.await,
        [Alone] cells::robots_form_cells_by_themselves_and_mend_when_a_relay_is_killed.await,
        [Works] cells::a_sealed_swarm_forms_cells_too.await,
        [Waits] cells::robots_hang_on_routers_that_are_there_as_they_are.await,
        [Alone] scouting::a_hundred_robots_in_hearing_keep_four_links_each_and_agree.await,
    ])
}
