"""Ways of showing it wrongly on the pins and on Int, Data and CLK, by check. Each must be seen as broken."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from psa2_bad import (
    Bad,
    after_res,
    channel_on_the_line_flipped,
    drd_a_after_cst,
    flip,
    gone,
    inverted,
    less,
    mirrored,
    moved,
    pulse,
    signal,
    slower,
    slower_clk,
    still,
    swap_axes,
    swapped,
    three_words,
    without,
)
from psabench.boards.psa2.conform.check_setup import port_traffic

WRONG_PINS: Mapping[str, Sequence[Bad]] = {
    # set-up
    "res_rests_high_and_acts_low": [inverted("Res"), still("Res", 1)],
    "a_reset_brings_all_lines_to_rest": [pulse("CLK", after_res), pulse("Int", after_res), inverted("Data")],
    "the_set_up_is_made_once": [moved("SYNC_A", -65_000_000)],
    "config0_is_written_first": [inverted("DIn"), pulse("DRD_A", after_res)],
    "bufen_is_written_second": [inverted("DInT"), still("DRD_T", 1)],
    "acal_is_written_third": [inverted("DInT"), still("DRD_T", 1)],
    "one_message_writes_bufen_and_acal": [inverted("DInT"), still("DRD_T", 1)],
    "drate_is_written_after_status": [inverted("DInT"), still("DRD_T", 1)],
    "sync_t_follows_the_write_to_drate": [
        moved("SYNC_T", -40_000_000),
        moved("SYNC_T", 20_000_000),
        still("SYNC_T", 1),
    ],
    "sync_a_ends_the_set_up": [still("SYNC_A", 0), moved("SYNC_A", -63_200_000), moved("SYNC_A", 64_000_000)],
    "each_step_waits_for_its_event": [still("DRD_T", 1), moved("DRD_A", 1_000_000)],
    "the_write_to_drate_calibrates": [moved("DRD_T", 500_000), still("DRD_T", 1)],
    "drd_a_falls_after_res": [moved("DRD_A", 50_000), still("DRD_A", 1)],
    "config0_restarts_the_converters": [moved("DRD_A", 100_000)],
    "the_first_frame_comes_when_the_filters_have_settled": [moved("SYNC_A", -100_000), moved("Int", -2_000_000)],
    "the_gain_is_written_after_the_set_up": [inverted("DIn"), moved("SYNC_A", 200_000)],
    "no_frame_before_the_set_up_is_over": [pulse("Int", after_res)],
    "int_is_quiet_while_the_set_up_lasts": [pulse("Int", after_res)],
    "nothing_but_the_set_up_is_sent": [inverted("DInT"), moved("SYNC_T", -40_000_000), pulse("SYNC_T", after_res)],
    "the_accelerometer_converters_get_one_message": [inverted("DIn")],
    "power_up_begins_anew": [
        gone("HEARTBEAT"),
        signal("PSA2_XY", "SEQ", lambda v: v + 1),
        lambda e: pulse("CLK", lambda x: int(x.wires.falls("Res")[-1]) + 5_000_000)(e),
    ],
    # lines
    "the_board_has_its_lines": [without("DRD_T"), without("CLK"), still("DOutZ", 0)],
    "lines_stand_at_their_rest_levels": [inverted("SYNC_A"), inverted("CST"), inverted("Int"), inverted("DInT")],
    "sync_a_is_high_for_its_time": [moved("SYNC_A", 10, 0), still("SYNC_A", 0), inverted("SYNC_A")],
    "sync_a_moves_on_falling_edges_of_fclk": [moved("SYNC_A", 122), moved("SYNC_A", 60, 0), still("SYNC_A", 0)],
    "sync_t_is_low_for_its_time": [moved("SYNC_T", 10, 1), inverted("SYNC_T")],
    "cst_frames_every_burst_of_its_port": [moved("CST", 20, 1), moved("CST", -1000, 0), moved("CST", 1000, 0)],
    "the_accelerometer_port_is_spi_mode_0": [moved("DIn", 488), moved("DOutY", 488), moved("DOutX", 150)],
    "the_temperature_port_is_spi_mode_1": [moved("DInT", 488), moved("DOutT", 100)],
    "sclk_has_its_frequency_and_rests_low": [slower(2000.0), slower(-2000.0)],
    "command_bytes_keep_their_gap": [slower(-200_000.0)],
    "data_wait_after_rdata": [slower(-200_000.0)],
    "dout_stands_still_while_the_other_port_is_used": [
        pulse("DOutZ", lambda e: int(e.wires.falls("CST")[3]) + 3000, 400)
    ],
    "clk_is_a_division_of_the_crystal": [slower_clk],
    # pairs
    "wire_b_is_the_inverse_of_a": [inverted("CLK_B"), moved("Data_B", 50), still("Int_B", 0), less("CLK_B", 30, 1)],
    "receivers_give_what_is_on_the_pairs": [inverted("Int"), moved("CLK", -30), moved("Int", 1000), still("Data", 1)],
    # reading
    "every_conversion_is_read": [pulse("DRD_A", lambda e: int(e.wires.falls("DRD_A")[9]) + 500_000)],
    "a_read_has_its_bits": [pulse("SClk", lambda e: int(port_traffic(e).reads[7].fall_ns[-1]) + 488, 488)],
    "drd_a_rises_with_the_first_bit_of_a_read": [moved("DRD_A", 300, 1), moved("DRD_A", -300, 1), still("DRD_A", 0)],
    "int_falls_after_the_read": [moved("Int", 3000), moved("Int", -3000)],
    "every_conversion_gives_a_frame": [
        less("Int", 30, 0),
        pulse("Int", lambda e: int(e.wires.rises("Int")[9]) + 100_000),
    ],
    "frames_come_every_data_period": [moved("Int", 2000, 0, 40), less("Int", 30, 0), slower(300.0)],
    "three_axes_are_read_at_once": [swapped("DOutX", "DOutY"), inverted("DOutZ")],
    "a_frame_has_the_codes_of_the_read_before_it": [swapped("DOutX", "DOutY"), flip("Data", "CLK", 900)],
    # temperatures and parts
    "the_scan_goes_by_its_steps": [inverted("DInT"), still("SYNC_T", 1), still("DRD_T", 1)],
    "bursts_keep_clear_of_the_next_conversion": [drd_a_after_cst],
    "bursts_keep_clear_at_the_highest_rate": [drd_a_after_cst],
    "drd_t_rises_when_a_temperature_is_read": [inverted("DRD_T"), moved("DRD_T", 60_000, 1)],
    "a_temperature_on_can_is_of_its_channel": [signal("PSA2_ZT", "CHANNEL", lambda v: v + 1 & 3)],
    "a_temperature_on_the_line_is_of_its_channel": [channel_on_the_line_flipped],
    "a_temperature_settles_in_its_time": [moved("SYNC_T", 30_000)],
    "accelerometer_converters_get_commands_that_they_have": [inverted("DIn"), less("SClk", 8, 1)],
    "the_temperature_converter_gets_commands_that_it_has": [inverted("DInT")],
    "transfers_keep_the_limits_of_the_accelerometer_converters": [
        slower(-600_000.0),
        moved("DIn", 460),
        moved("SClk", 400, 0),
    ],
    "transfers_keep_the_limits_of_the_temperature_converter": [
        slower(-600_000.0),
        moved("DInT", 470),
        moved("CST", -300, 1),
    ],
    "temperature_codes_are_the_upper_bits_that_were_read": [inverted("DOutT"), signal("PSA2_ZT", "T", lambda v: v + 1)],
    # the line
    "words_come_least_significant_bit_first": [inverted("Data"), mirrored],
    "words_are_the_codes": [flip("Data", "CLK", 900), signal("PSA2_XY", "X", lambda v: v ^ 1, 7)],
    "the_first_word_is_that_of_the_lowest_address": [swap_axes],
    "words_are_in_their_order": [swap_axes, signal("PSA2_ZT", "T", lambda v: v + 1)],
    "can_and_line_carry_the_same": [flip("Data", "CLK", 900), signal("PSA2_ZT", "T", lambda v: v + 1)],
    "word_t_has_the_temperature_code": [signal("PSA2_ZT", "T", lambda v: v + 1), flip("Data", "CLK", 96)],
    "word_t_has_the_channel": [signal("PSA2_ZT", "CHANNEL", lambda v: v ^ 1)],
    "word_t_has_the_status": [signal("PSA2_ZT", s, lambda v: 1 - v) for s in ("SETTLED", "CLIP", "OVERRUN", "T_NEW")],
    # Int, Data and CLK
    "a_transfer_has_four_words": [three_words],
    "words_have_their_bits_at_their_clock": [slower(400.0), less("CLK", 77, 1)],
    "words_are_apart": [moved("CLK", 100, 1, 64)],
    "clk_runs_only_with_data": [
        pulse("CLK", lambda e: int(e.wires.rises("Int")[5]) + 50_000, 250),
        less("CLK", 77, 1),
    ],
    "clk_rests_low": [inverted("CLK")],
    "data_stand_still_around_each_rise_of_clk": [moved("Data", 150), still("Data", 0)],
    "data_rest_low": [inverted("Data")],
    "clk_is_high_for_half_of_its_period": [moved("CLK", 60, 0)],
    "int_is_low_long_enough": [moved("Int", 500, 0)],
    "int_is_low_for_its_periods_of_clk": [moved("Int", 100, 0), moved("Int", -100, 0)],
    "int_rises_with_the_last_fall_of_clk": [moved("Int", 100, 1), moved("Int", 500, 1)],
    "int_rests_high": [inverted("Int"), still("Int", 0)],
    "int_changes_on_the_grid_of_clk": [moved("Int", 100, 1), moved("Int", 100, 0)],
}
