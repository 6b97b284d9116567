"""Every check of PSA-2 and PSA-1: it passes on what a board shows, and fails on each way of showing it wrongly.

The good evidence is an emulator's, one scene each; the bad is made from it (psa2_bad.py).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import pytest
from psa2_bad import (
    Bad,
    after_res,
    answered,
    each,
    flip,
    gone,
    inverted,
    less,
    moved,
    pulse,
    short,
    signal,
    slower,
    still,
    swapped,
    told,
    without,
)
from psabench.conform import suite
from psabench.conform.checks.psa2_setup import port_traffic
from psabench.conform.evidence import CanLog, Evidence
from psabench.conform.outcome import Broken, TooLittle
from psabench.conform.plan import plan_of, scenes
from psabench.conform.proof import proofs
from psabench.conform.requirements import requirements
from psabench.conform.scenes.psa2_can import Answer
from psabench.conform.subject import Addresses, Subject
from psabench.conform.variant import variant

suite.load()

REFUSED, BUSY, NOTHING = Answer(abort=0x06090030), Answer(abort=0x08000022), Answer()
MODULES = ("psa2_setup", "psa2_serial", "psa2_parts", "psa2_stream", "psa2_words", "psa2_forms", "psa2_registers",
           "psa2_trouble", "psa2_analog", "psa2_frame")  # fmt: skip
CHECKS = {p.test.__name__: p.test for p in proofs() if p.test.__module__.rpartition(".")[2] in MODULES}
OTHER = {  # checks of rows that hold for another variant, or want another link
    "one_message_writes_bufen_and_acal": ("psa2", "intent"),
    "the_accelerometer_converters_get_one_message": ("psa1", None),
    "bursts_damage_words_where_nothing_gates_them": ("psa2", "ungated"),
    "clk_is_a_division_of_the_crystal": ("psa2", "w24"),
}
FD = ("form_2_is", "form_3_is", "a_block_begins", "fd_frames_are")


class Stage:
    """Scenes of several variants, each played once."""

    def __init__(self) -> None:
        self.subjects: dict[tuple[str, str | None, str], Subject] = {}
        self.shown: dict[tuple[Any, str], Evidence] = {}

    def evidence(self, check: str) -> Evidence:
        board, profile = OTHER.get(check, ("psa2", None))
        key = board, profile, "slcan" if check.startswith(FD) else "socketcand:0"
        if key not in self.subjects:
            self.subjects[key] = Subject.open(variant(board, profile), Addresses(adapter=key[2]), seed=3)
        name = plan_of(CHECKS[check]).scene
        if (key, name) not in self.shown:
            self.shown[key, name] = scenes("psa2")[name].make(self.subjects[key])
        return self.shown[key, name]

    def close(self) -> None:
        for s in self.subjects.values():
            s.close()


@pytest.fixture(scope="module")
def stage() -> Iterator[Stage]:
    made = Stage()
    yield made
    made.close()


def dropped(e: Evidence) -> Evidence:
    """One sample is missing, with both halves."""
    return gone("PSA2_ZT", 50)(gone("PSA2_XY", 50)(e))


def marked(sub: int, value: int) -> Bad:
    """A register of converter Y reads otherwise."""
    return answered("read", (0x2003, sub), Answer(value))


def temp_register(sub: int, value: int) -> Bad:
    return answered("read", (0x2001, sub), Answer(value))


def counted(sub: int, more: int) -> Bad:
    return told("after", lambda old: dict(old) | {sub: Answer(old[sub].value + more)})


def of_rows(change: Callable[[tuple[Any, ...]], tuple[Any, ...]]) -> Callable[[list[Any]], list[Any]]:
    return lambda rows: [change(rows[0]), *rows[1:]]


def mirror(nth: int) -> Bad:
    """The nth mirror shows another value."""

    def change(rows: list[Any]) -> list[Any]:
        index, sub, answer, seq = rows[nth]
        return [*rows[:nth], (index, sub, Answer(answer.value + 3), seq), *rows[nth + 1 :]]

    return told("mirrors", change)


def last_abort(row: tuple[Any, ...]) -> tuple[Any, ...]:
    return (*row[:-1], NOTHING)


def no_emcy(e: Evidence) -> Evidence:
    return gone("EMCY")(e)


def same_gain(e: Evidence) -> Evidence:
    """Codes that no write changes."""
    early = e.can.frames[: e.facts["cut"]["gain"]]  # type: ignore[index]
    return e.with_can(CanLog(frames=early * 4))


def doubled(axis: str, message: str) -> Bad:
    return signal(message, axis, lambda v: 2 * v)


def late_half(e: Evidence) -> Evidence:
    """The step stands in Z one frame later."""
    found = list(e.frames_of("PSA2_ZT").frames)
    shifted = [found[0], *found[:-1]]
    it = iter(shifted)
    return each("PSA2_ZT", lambda f: replace(f, data=next(it).data[:3] + f.data[3:]))(e)


def boxcar(e: Evidence) -> Evidence:
    """A step in the codes without a filter."""
    begin = e.facts["cut"]["gain"]  # type: ignore[index]
    frames = list(e.can.frames)
    first, last = frames[0:2], frames[-3:-1]
    del first
    xy = [f for f in frames if f.can_id == e.frames_of("PSA2_XY").frames[0].can_id]
    zt = [f for f in frames if f.can_id == e.frames_of("PSA2_ZT").frames[0].can_id]
    del last
    for k, f in enumerate(frames):
        if f.can_id == xy[0].can_id:
            frames[k] = replace(f, data=(xy[0] if k < begin else xy[-1]).data[:6] + f.data[6:])
        elif f.can_id == zt[0].can_id:
            frames[k] = replace(f, data=(zt[0] if k < begin else zt[-1]).data[:3] + f.data[3:])
    return e.with_can(CanLog(frames=tuple(frames)))


def twice_the_pulses(e: Evidence) -> Evidence:
    return pulse("SYNC_A", lambda x: int(x.wires.rises("SYNC_A")[0]) + 5_000_000)(e)


# Ways of showing it wrongly, by check. Each must be seen as broken.
WRONG: Mapping[str, Sequence[Bad]] = {
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
    "the_board_has_its_lines": [without("DRD_T"), without("CLK")],
    "lines_stand_at_their_rest_levels": [inverted("SYNC_A"), inverted("CST"), inverted("Int"), inverted("DInT")],
    "sync_a_is_high_for_its_time": [moved("SYNC_A", 10, 0), still("SYNC_A", 0), inverted("SYNC_A")],
    "sync_t_is_low_for_its_time": [moved("SYNC_T", 10, 1), inverted("SYNC_T")],
    "cst_frames_every_burst_of_its_port": [moved("CST", 20, 1), moved("CST", -1000, 0), moved("CST", 1000, 0)],
    "the_accelerometer_port_is_spi_mode_0": [moved("DIn", 488), moved("DOutY", 488), moved("DOutX", 150)],
    "the_temperature_port_is_spi_mode_1": [moved("DInT", 488), moved("DOutT", 100)],
    "sclk_has_its_frequency_and_rests_low": [slower(4000.0), slower(-4000.0)],
    "command_bytes_keep_their_gap": [lambda e: slower(-200_000.0)(e)],
    "data_wait_after_rdata": [slower(-200_000.0)],
    "dout_stands_still_while_the_other_port_is_used": [
        pulse("DOutZ", lambda e: int(e.wires.falls("CST")[3]) + 3000, 400)
    ],
    "clk_is_a_division_of_the_crystal": [
        lambda e: slower(0.0)(rewired_clk(e, 1.05)),
    ],
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
    "bursts_keep_clear_of_the_next_conversion": [
        lambda e: pulse("DRD_A", lambda x: int(x.wires.rises("CST")[4]) + 3000)(e)
    ],
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
    "words_come_least_significant_bit_first": [inverted("Data"), lambda e: mirrored(e)],
    "words_are_the_codes": [flip("Data", "CLK", 900), signal("PSA2_XY", "X", lambda v: v ^ 1, 7)],
    "words_are_in_their_order": [lambda e: swap_axes(e)],
    "can_and_line_carry_the_same": [flip("Data", "CLK", 900), signal("PSA2_ZT", "T", lambda v: v + 1)],
    "word_t_has_the_temperature_code": [signal("PSA2_ZT", "T", lambda v: v + 1), flip("Data", "CLK", 96)],
    "word_t_has_the_channel": [signal("PSA2_ZT", "CHANNEL", lambda v: v ^ 1)],
    "word_t_has_the_status": [signal("PSA2_ZT", s, lambda v: 1 - v) for s in ("SETTLED", "CLIP", "OVERRUN", "T_NEW")],
    # CAN
    "xy_and_zt_alternate": [gone("PSA2_ZT"), gone("PSA2_ZT", 20), gone("PSA2_XY", 20)],
    "messages_have_their_lengths": [short("PSA2_XY"), short("PSA2_ZT", 9), signal("PSA2_ZT", "CHANNEL", lambda v: 9)],
    "no_frame_before_its_transfer_has_ended": [
        each("PSA2_XY", lambda f: replace(f, t_s=f.t_s - 300e-6)),
        each("PSA2_XY", lambda f: replace(f, t_s=f.t_s + 600e-6)),
    ],
    "seq_rises_by_one": [signal("PSA2_XY", "SEQ", lambda v: v + 1, 77), dropped],
    "tstamp_goes_by_the_data_period": [
        signal("PSA2_ZT", "TSTAMP", lambda v: 2 * v),
        signal("PSA2_ZT", "TSTAMP", lambda v: v + 5, 99),
    ],
    "tstamp_is_the_fall_of_drd_a": [signal("PSA2_ZT", "TSTAMP", lambda v: v + 1)],
    "samples_come_whole": [gone("PSA2_XY", 5)],
    "overrun_tells_of_lost_conversions": [signal("PSA2_ZT", "OVERRUN", lambda v: 1, 60), dropped],
    "frames_are_counted": [counted(1, 9), counted(1, -9)],
    "overruns_are_counted": [counted(2, 1), signal("PSA2_ZT", "OVERRUN", lambda v: 1, 60)],
    "seq_begins_with_0": [signal("PSA2_XY", "SEQ", lambda v: v + 1), gone("HEARTBEAT")],
    "channels_take_turns": [signal("PSA2_ZT", "CHANNEL", lambda v: v ^ 1), signal("PSA2_ZT", "T_NEW", lambda v: 0)],
    "temperatures_come_at_their_rate": [
        signal("PSA2_ZT", "T_NEW", lambda v: 1),
        signal("PSA2_ZT", "T_NEW", lambda v: 0),
        signal("PSA2_ZT", "TSTAMP", lambda v: 2 * v),
    ],
    "the_scan_waits_for_a_calibration": [
        signal("PSA2_ZT", "T_NEW", lambda v: 1),
        signal("PSA2_ZT", "T_NEW", lambda v: 0),
        told("opcode", lambda _: REFUSED),
    ],
    # forms and modes
    "the_fast_form_drops_bits": [
        signal("PSA2_FAST", "X", lambda v: v + 1),
        signal("PSA2_FAST", "Z", lambda v: v << 1),
        gone("PSA2_FAST"),
        told("answer 1", lambda _: REFUSED),
    ],
    "tog_alternates": [signal("PSA2_FAST", "TOG", lambda v: 0), signal("PSA2_FAST", "TOG", lambda v: 1 - v, 9)],
    "form_2_is_one_fd_frame_a_sample": [
        each("PSA2_FRAME", lambda f: replace(f, fd=False)),
        gone("PSA2_FRAME"),
        signal("PSA2_FRAME", "TSTAMP", lambda v: v + 9, 7),
        short("PSA2_FRAME"),
    ],
    "form_3_is_one_fd_frame_every_five_samples": [
        each("PSA2_BLOCK", lambda f: replace(f, fd=False)),
        signal("PSA2_BLOCK", "TSTAMP", lambda v: v + 9, 3),
    ],
    "a_block_begins_anew_after_a_stop": [told("stamp", lambda a: Answer(a.value + 100_000)), gone("PSA2_BLOCK")],
    "a_form_switches_its_tpdos": [told("off 2", lambda old: [Answer(a.value ^ 1 << 31) for a in old])],
    "fd_frames_are_those_of_two_forms": [each("PSA2_XY", lambda f: replace(f, fd=True))],
    "each_sync_takes_one_sample": [gone("PSA2_XY", 3), signal("PSA2_XY", "SEQ", lambda v: 1)],
    "a_sample_of_a_sync_is_not_older_than_it": [signal("PSA2_ZT", "TSTAMP", lambda v: v - 1000)],
    "every_nth_frame_is_sent": [signal("PSA2_XY", "SEQ", lambda v: v + 1), signal("PSA2_XY", "SEQ", lambda v: 2 * v)],
    "the_frame_period_follows_dr": [
        signal("PSA2_ZT", "TSTAMP", lambda v: 2 * v),
        told("answer 3", lambda _: REFUSED),
        signal("PSA2_XY", "SEQ", lambda v: 4),
    ],
    "sync_starts_the_filters_anew": [
        signal("PSA2_XY", "SEQ", lambda v: 2 * v),
        signal("PSA2_ZT", "TSTAMP", lambda v: v >> 2),
    ],
    "sync_pulses_sync_a": [still("SYNC_A", 0), twice_the_pulses, moved("SYNC_A", 1_000_000)],
    "filters_settle_in_their_time_at_each_rate": [moved("DRD_A", 3000), still("SYNC_A", 0)],
    # registers
    "ofc_is_zero": [marked(6, 1), marked(8, 1)],
    "fsc_is_one": [marked(9, 1), marked(11, 0x41)],
    "config0_is_the_articles": [marked(2, 0x52), answered("read", (0x2003, 2), BUSY)],
    "status_is_what_its_writes_left": [temp_register(1, 0x32), temp_register(1, 0x36)],
    "drate_is_100_a_second": [temp_register(4, 0x92)],
    "config1_is_the_boards": [marked(3, 0x08)],
    "accelerometer_converters_have_their_reset_values": [marked(k, 0xEE) for k in range(2, 12)],
    "the_temperature_converter_has_its_reset_values": [temp_register(k, 0x0E) for k in (1, 3, 4, 5)],
    "accelerometer_converters_keep_what_is_written": [told("written", of_rows(lambda r: (*r[:4], [Answer(0)] * 3)))],
    "the_temperature_converter_keeps_what_is_written": [
        told("written", lambda rows: [(*r[:3], REFUSED, r[4]) if r[0] == 0x2001 else r for r in rows])
    ],
    "one_write_reaches_three_converters": [told("written", of_rows(lambda r: (*r[:4], [r[4][0], Answer(0), r[4][2]])))],
    "a_register_read_is_what_the_converter_says": [marked(4, 0), temp_register(3, 0x21), inverted("DOutY")],
    "register_reads_cost_no_conversion": [dropped, counted(2, 1)],
    "a_read_only_register_is_not_written": [told("read-only", of_rows(last_abort))],
    "reserved_values_are_refused": [
        told("reserved", of_rows(lambda r: (*r[:4], NOTHING, r[5]))),
        told("reserved", of_rows(lambda r: (*r[:5], Answer(r[2])))),
    ],
    "opcodes_that_want_more_are_refused": [told("opcodes", of_rows(last_abort))],
    "refused_opcodes_never_reach_a_converter": [told("opcodes", lambda rows: [(0x2010, 1, 0x11, REFUSED), *rows])],
    "an_unknown_form_is_refused": [told("form", lambda _: NOTHING)],
    "no_access_before_the_set_up_is_over": [told("early", lambda old: [Answer(0x52), *old[1:]])],
    "one_access_at_a_time": [told("busy", lambda _: []), told("busy", lambda _: [0x06090030])],
    "a_sync_that_could_not_pulse_is_counted": [told("missed", lambda old: (old[0], old[0]))],
    "opcodes_are_taken": [told("answers", lambda old: [REFUSED, old[1]]), temp_register(4, 0x82), marked(2, 0x56)],
    "opcodes_are_sent_to_their_group": [inverted("DIn"), inverted("DInT")],
    "a_reset_opcode_is_followed_by_no_set_up": [marked(2, 0x56), marked(3, 0x09)],
    "the_board_says_who_it_is": [
        answered("read", (0x1008, 0), Answer("PSA-3")),
        answered("read", (0x1018, 2), Answer(1)),
        answered("read", (0x1018, 3), Answer(1)),
    ],
    "object_2021h_is_the_word_width": [answered("read", (0x2021, 0), Answer(24))],
    "mirrors_show_the_sample": [mirror(k) for k in (0, 3, 4, 5, 6, 10, 15)],
    "objects_have_type_rights_default_and_limits": [
        told("rows", lambda rows: [replace(rows[0], raw=b"\0"), *rows[1:]]),
        told("rows", lambda rows: [replace(rows[0], write=0), *rows[1:]]),
        told("rows", lambda rows: [replace(rows[0], abort=0x06020000), *rows[1:]]),
    ],
    # trouble
    "a_form_that_does_not_fit_is_refused": [
        told("form", lambda _: NOTHING),
        told("form read", lambda _: Answer(0)),
        no_emcy,
        told("form text", lambda _: Answer("")),
    ],
    "a_rate_that_does_not_fit_is_refused": [told("rate", lambda _: NOTHING), told("config0", lambda _: Answer(0x66))],
    "a_refused_rate_never_reaches_the_converters": [inverted("DIn")],
    "worst_case_times_are_those_of_the_table": [told("rate text", lambda _: Answer("no"))],
    "a_silent_temperature_converter_is_told": [
        no_emcy,
        gone("EMCY", 0),
        gone("EMCY", 1),
        signal("EMCY", "SOURCE", lambda v: 1),
        told("opcode", lambda _: REFUSED),
    ],
    "axes_go_on_without_temperatures": [dropped, signal("PSA2_ZT", "T_NEW", lambda v: 1)],
    "time_outs_are_counted": [counted(9, -1)],
    "an_access_without_data_ready_is_aborted": [told("access", lambda _: Answer(0x34))],
    # codes
    "codes_are_volts": [signal("PSA2_XY", "X", lambda v: v + v // 1000), signal("PSA2_ZT", "Z", lambda v: 0)],
    "codes_have_the_sign_of_the_volts": [signal("PSA2_XY", "Y", lambda v: -v)],
    "ofc_and_fsc_act_as_they_should": [told("offset", lambda _: [REFUSED]), lambda e: same_numbers(e)],
    "codes_stop_at_their_limits": [
        signal("PSA2_ZT", "CLIP", lambda v: 0),
        signal("PSA2_ZT", "CLIP", lambda v: 1),
        signal("PSA2_XY", "X", lambda v: v - 1 if v > 8_000_000 else v),
        signal("PSA2_XY", "Y", lambda v: 8_388_607 if v < -8_000_000 else v),
    ],
    "a_step_settles_in_its_time": [same_gain, boxcar],
    "the_filter_stops_above_its_band": [boxcar],
    "the_filter_has_its_corner": [boxcar],
    "three_axes_move_together": [late_half],
    "settled_tells_of_a_new_gain": [
        signal("PSA2_ZT", "SETTLED", lambda v: 1),
        signal("PSA2_ZT", "SETTLED", lambda v: 0),
        signal("PSA2_ZT", "SETTLED", lambda v: 0, 5),
    ],
    "a_write_changes_all_codes": [
        same_gain,
        told("read", lambda old: [Answer(0x09), *old[1:]]),
        told("answer", lambda _: REFUSED),
    ],
    "noise_is_the_published_one": [lambda e: noisier(e)],
    "no_word_is_damaged_by_the_other_port": [signal("PSA2_XY", "X", lambda v: v ^ 1 << 20, 300)],
    "bursts_damage_words_where_nothing_gates_them": [
        lambda e: replace(e, can=CanLog(frames=e.can.frames[:1] * 0 + steady(e)))
    ],
    "temperature_codes_are_kelvins": [signal("PSA2_ZT", "T", lambda v: v + 30), told("temp_degc", lambda v: v + 1)],
    # Int, Data and CLK
    "words_have_their_bits_at_their_clock": [slower(400.0), less("CLK", 77, 1)],
    "words_are_apart": [moved("CLK", 100, 1, 64)],
    "clk_runs_only_with_data": [pulse("CLK", lambda e: int(e.wires.rises("Int")[5]) + 50_000, 250), inverted("CLK")],
    "data_stand_still_around_each_rise_of_clk": [moved("Data", 150), still("Data", 0)],
    "data_rest_low": [inverted("Data")],
    "clk_is_high_for_half_of_its_period": [moved("CLK", 60, 0)],
    "int_is_low_long_enough": [moved("Int", 500, 0)],
    "int_is_low_for_its_periods_of_clk": [moved("Int", 100, 0), moved("Int", -100, 0)],
    "int_rises_with_the_last_fall_of_clk": [moved("Int", 100, 1), moved("Int", 100, 0)],
}


def rewired_clk(e: Evidence, factor: float) -> Evidence:
    """CLK runs slower than its frame allows, from its first rise on."""
    from psa2_bad import rewired

    w = e.wires["CLK"]
    t0 = w.t_ns[1]
    return rewired(e, "CLK", (t0 + (w.t_ns - t0) * factor).astype("int64"), w.level)


def mirrored(e: Evidence) -> Evidence:
    """Every word is sent most significant bit first."""
    import numpy as np
    from psa2_bad import rewired
    from psabench.conform.line_frames import transfers

    t = transfers(e.wires)
    bits = int(e.variant["word_bits"])
    rises, levels = t.grid_ns(bits).astype(np.int64), t.bits(bits)
    levels = levels.reshape(-1, 4, bits)[:, :, ::-1].reshape(-1)
    at = rises.reshape(-1)
    edges = np.stack((at - 200, at + 200), axis=1).reshape(-1)
    course = np.stack((levels, np.zeros_like(levels)), axis=1).reshape(-1)
    return rewired(e, "Data", np.concatenate(([e.wires.start_ns], edges)), np.concatenate(([0], course)))


def swap_axes(e: Evidence) -> Evidence:
    """X and Y are exchanged on CAN."""
    return each("PSA2_XY", lambda f: replace(f, data=f.data[3:6] + f.data[:3] + f.data[6:]))(e)


def same_numbers(e: Evidence) -> Evidence:
    """Codes that no register corrects."""
    x = iter([f.data for f in e.frames_of("PSA2_XY").frames[:50]] * 20)
    return each("PSA2_XY", lambda f: replace(f, data=next(x)[:6] + f.data[6:]))(e)


def noisier(e: Evidence) -> Evidence:
    """Twice the noise."""
    middle = int.from_bytes(e.frames_of("PSA2_XY").frames[0].data[:3], "little")
    return signal("PSA2_XY", "X", lambda v: middle + 2 * (v - middle))(e)


def steady(e: Evidence) -> tuple[Any, ...]:
    """Samples whose codes are all those of the first."""
    x, z = e.frames_of("PSA2_XY").frames[0], e.frames_of("PSA2_ZT").frames[0]
    made = each("PSA2_XY", lambda f: replace(f, data=x.data[:6] + f.data[6:]))(e)
    return each("PSA2_ZT", lambda f: replace(f, data=z.data[:3] + f.data[3:]))(made).can.frames


@pytest.mark.parametrize("name", CHECKS)
def test_a_check_passes_on_good_evidence(name: str, stage: Stage) -> None:
    assert CHECKS[name](stage.evidence(name))


@pytest.mark.parametrize(("name", "k"), [(n, k) for n, ways in WRONG.items() for k in range(len(ways))])
def test_a_check_sees_what_is_wrong(name: str, k: int, stage: Stage) -> None:
    with pytest.raises(Broken):
        CHECKS[name](WRONG[name][k](stage.evidence(name)))


def test_every_check_has_bad_evidence() -> None:
    assert set(CHECKS) == set(WRONG)


@pytest.mark.parametrize("name", CHECKS)
def test_a_check_says_broken_or_too_little_of_a_dead_board(name: str, stage: Stage) -> None:
    """No frame, no edge: an answer in words and never an exception of another kind."""
    e = stage.evidence(name).with_can(CanLog())
    if e.lines is not None:
        for line in e.wires.recording.wires:
            e = still(line, 1)(e)
    try:
        CHECKS[name](e)
    except (Broken, TooLittle):
        return


@pytest.mark.parametrize("name", CHECKS)
def test_a_check_says_broken_or_too_little_of_wrong_lengths(name: str, stage: Stage) -> None:
    e = stage.evidence(name)
    e = e.with_can(CanLog(frames=tuple(replace(f, data=f.data[: k % 3]) for k, f in enumerate(e.can.frames))))
    for fact in e.facts:
        if fact != "cut":
            e = told(fact, lambda _: REFUSED)(e) if isinstance(e.facts[fact], Answer) else e
    try:
        CHECKS[name](e)
    except (Broken, TooLittle):
        return


def test_every_observable_row_of_these_boards_has_a_check() -> None:
    proved = {i for p in proofs() for i in p.ids}
    rows = [r for r in requirements() if r.group == "psa2"]
    assert not [r.id for r in rows if not r.unobservable and r.id not in proved]
    assert not [r.id for r in rows if r.unobservable and r.id in proved]
