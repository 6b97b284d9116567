"""Checks of PSD-1 on cycles made by hand: good ones pass, each wrong one fails as the requirement that it breaks."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from psabench.boards.psd1.conform import active_control as psd1_control
from psabench.boards.psd1.conform import check_can as psd1_can
from psabench.boards.psd1.conform import check_cycle as psd1_cycle
from psabench.boards.psd1.conform import check_serial as psd1_serial
from psabench.boards.psd1.conform.capture_cycles import PINS
from psabench.conform.capture.log import CanFrame, CanLog, Capture, LineLog
from psabench.conform.dut import Addresses, Dut
from psabench.conform.profile import variant
from psabench.conform.verdict import Failed, Inconclusive
from psabench.link.vcd import Vcd, Wire

PERIOD, CLOCK, CYCLES = 972_800, 800, 14
WORDS = (0xA5C3, 0x1234, 0x8001)
NODE = 6
Test = Callable[[Capture], str]


@dataclass
class Board:
    """What may be wrong with it, ns."""

    a0_to_rfx: int = 400
    first_rise: int = 700
    pulses: int = 16
    low: int = 13_600
    fl2_late: int = 0
    clear_late: int = 0
    strobe_wait: int = 1000
    strobe: int = 800
    change: int = 100
    dr_rise: int = 100
    lsb_first: bool = False
    order: tuple[int, ...] = (0, 1, 2)
    gap: int = 0  # between the end of FL2 and the next transfer
    wrong_data: int = 0
    address_off: int = 0
    a0_falls_early: bool = False
    stray_sclk: bool = False
    clock_high: int = 400
    period: int = PERIOD
    edges: dict[str, list[tuple[int, int]]] = field(default_factory=dict)

    def put(self, name: str, t: int, level: int) -> None:
        self.edges.setdefault(name, []).append((t, level))

    def capture(self, profile: str = "psd1", can: CanLog | None = None) -> Capture:
        rest = {"FL1": 0, "INT0": 1, "DR": 1, "RFX": 1, "RFY": 1, "RFZ": 1, "TFS": 1, "CS": 1, "RW": 1}
        for k in range(CYCLES):
            self.cycle(1_000_000 + k * self.period)
        end = 1_000_000 + CYCLES * self.period
        for t in range(400, end, CLOCK):
            self.put("CLK_1M25", t, 1)
            self.put("CLK_1M25", t + self.clock_high, 0)
        wires = {}
        for name in PINS:
            moves = sorted(self.edges.get(name, []))
            levels = [rest.get(name, 0), *(v for _, v in moves)]
            times = [0, *(t for t, _ in moves)]
            wires[name] = Wire(np.array(times, np.int64), np.array(levels, np.uint8))
        lines = LineLog(recording=Vcd(1, 0, end, wires))
        return Capture(variant=variant("psd1", profile), node=NODE, stimulus="stream", lines=lines, can=can or CanLog())

    def cycle(self, begin: int) -> None:
        a0 = begin + (400 - begin) % CLOCK
        self.put("DR", a0 - 400, 0)
        self.put("A0", a0, 1)
        t = a0 + self.a0_to_rfx
        for axis in self.order:
            t = self.transfer(t, axis)
        if not self.a0_falls_early:
            self.put("A0", t - self.gap, 0)
        if self.stray_sclk:
            self.put("SCLK", t + 5000, 1)
            self.put("SCLK", t + 5400, 0)

    def transfer(self, t: int, axis: int) -> int:
        name, word = f"RF{'XYZ'[axis]}", WORDS[axis]
        bits = [word >> k & 1 for k in (range(16) if self.lsb_first else range(15, -1, -1))]
        self.put(name, t, 0)
        level = 0
        for k in range(self.pulses):
            bit = bits[k % 16]
            at = t + 300 if k == 0 else t + self.first_rise + 400 + 800 * (k - 1) + self.change
            if bit != level:
                self.put("SDAT", at, bit)
                level = bit
            self.put("SCLK", t + self.first_rise + 800 * k, 1)
            self.put("SCLK", t + self.first_rise + 400 + 800 * k, 0)
        if axis == 0:
            self.put("DR", t + self.first_rise + 400 + 800 * 15 + self.dr_rise, 1)
        t += self.low
        if level:
            self.put("SDAT", t, 0)
        self.put(name, t, 1)
        self.put("FL2", t + self.fl2_late, 1)
        if self.a0_falls_early and axis == 2:
            self.put("A0", t, 0)
        return self.read(t, axis, word)

    def read(self, t: int, axis: int, word: int) -> int:
        down = t + self.strobe_wait
        up = down + self.strobe
        self.put("CS", down, 0)
        self.put("CS", up, 1)
        for prefix, value, width in (("AB", axis ^ self.address_off, 4), ("D", word ^ self.wrong_data, 16)):
            for k in range(width):
                if value >> k & 1:
                    self.put(f"{prefix}{k}", down, 1)
                    self.put(f"{prefix}{k}", up, 0)
        clear = up + CLOCK - (up - t) % CLOCK  # RFx rose with a fall of the clock
        self.put("FL2", clear + self.clear_late, 0)
        return clear + self.clear_late + self.gap


CHECKS: list[Test] = [
    psd1_cycle.words_are_read_in_turn,
    psd1_cycle.a_cycle_begins_with_its_three_conditions,
    psd1_cycle.a0_rises_with_the_clock,
    psd1_cycle.a0_rises_with_the_first_clock_that_it_can,
    psd1_cycle.rfx_falls_half_a_clock_after_a0,
    psd1_cycle.the_clock_runs_without_a_gap,
    psd1_cycle.a0_falls_where_the_profile_says,
    psd1_cycle.a_cycle_has_its_length,
    psd1_cycle.a_cycle_begins_only_after_the_last_has_ended,
    psd1_cycle.nothing_moves_between_cycles,
    psd1_cycle.cycles_come_at_their_rate,
    psd1_cycle.a_cycle_follows_each_fall_of_dr,
    psd1_cycle.fl2_rests_at_its_level,
    psd1_serial.the_first_bit_comes_in_time,
    psd1_serial.the_most_significant_bit_comes_first,
    psd1_serial.the_first_edge_of_sclk_is_a_rise,
    psd1_serial.sclk_is_the_clock_delayed,
    psd1_serial.a_transfer_has_its_pulses,
    psd1_serial.bits_change_after_the_fall_of_sclk,
    psd1_serial.rfx_is_low_for_its_time,
    psd1_serial.rfx_rises_with_a_fall_of_the_clock,
    psd1_serial.fl2_is_set_as_rfx_rises,
    psd1_serial.one_converter_at_a_time,
    psd1_serial.sclk_rests_low,
    psd1_serial.dr_rises_after_the_last_bit_of_x,
    psd1_serial.fl2_is_cleared_by_the_clock_after_the_strobe,
    psd1_serial.fl2_of_z_is_cleared_likewise,
    psd1_serial.rfy_falls_as_fl2_of_x_is_cleared,
    psd1_serial.rfz_falls_as_fl2_of_y_is_cleared,
    psd1_serial.the_built_in_host_keeps_its_times,
    psd1_serial.words_are_on_the_bus_at_their_address,
]


@pytest.mark.parametrize("check", CHECKS, ids=lambda c: c.__name__)
def test_a_good_board_passes(check: Test) -> None:
    assert check(Board().capture())


BAD: list[tuple[Board, Test]] = [
    (Board(order=(1, 0, 2)), psd1_cycle.words_are_read_in_turn),
    (Board(a0_to_rfx=1200), psd1_cycle.rfx_falls_half_a_clock_after_a0),
    (Board(clock_high=300), psd1_cycle.the_clock_runs_without_a_gap),
    (Board(a0_falls_early=True), psd1_cycle.a0_falls_where_the_profile_says),
    (Board(strobe_wait=1900), psd1_cycle.a_cycle_has_its_length),
    (Board(stray_sclk=True), psd1_cycle.nothing_moves_between_cycles),
    (Board(stray_sclk=True), psd1_serial.sclk_rests_low),
    (Board(period=PERIOD + 1600), psd1_cycle.cycles_come_at_their_rate),
    (Board(first_rise=600), psd1_serial.the_first_edge_of_sclk_is_a_rise),
    (Board(first_rise=600), psd1_serial.sclk_is_the_clock_delayed),
    (Board(pulses=15), psd1_serial.a_transfer_has_its_pulses),
    (Board(change=230), psd1_serial.bits_change_after_the_fall_of_sclk),
    (Board(change=5), psd1_serial.bits_change_after_the_fall_of_sclk),
    (Board(low=14_400), psd1_serial.rfx_is_low_for_its_time),
    (Board(low=13_601), psd1_serial.rfx_rises_with_a_fall_of_the_clock),
    (Board(fl2_late=3), psd1_serial.fl2_is_set_as_rfx_rises),
    (Board(clear_late=800), psd1_serial.fl2_is_cleared_by_the_clock_after_the_strobe),
    (Board(clear_late=800), psd1_serial.fl2_of_z_is_cleared_likewise),
    (Board(gap=800), psd1_serial.rfy_falls_as_fl2_of_x_is_cleared),
    (Board(gap=800), psd1_serial.rfz_falls_as_fl2_of_y_is_cleared),
    (Board(strobe_wait=1010), psd1_serial.the_built_in_host_keeps_its_times),
    (Board(strobe=700), psd1_serial.the_built_in_host_keeps_its_times),
    (Board(lsb_first=True), psd1_serial.the_most_significant_bit_comes_first),
    (Board(wrong_data=1), psd1_serial.words_are_on_the_bus_at_their_address),
    (Board(address_off=2), psd1_serial.words_are_on_the_bus_at_their_address),
    (Board(dr_rise=300), psd1_serial.dr_rises_after_the_last_bit_of_x),
]


@pytest.mark.parametrize(("board", "check"), BAD, ids=lambda v: getattr(v, "__name__", "board"))
def test_a_bad_board_is_found(board: Board, check: Test) -> None:
    with pytest.raises(Failed):
        check(replace(board, edges={}).capture())


@pytest.mark.parametrize("check", CHECKS, ids=lambda c: c.__name__)
def test_lines_that_never_move_are_no_pass_and_no_crash(check: Test) -> None:
    wires = {name: Wire(np.zeros(1, np.int64), np.zeros(1, np.uint8)) for name in PINS}
    lines = LineLog(recording=Vcd(1, 0, 10**8, wires))
    with pytest.raises((Failed, Inconclusive)):
        check(Capture(variant=variant("psd1"), node=NODE, stimulus="stream", lines=lines))


def frames(words: list[tuple[int, int, int]], flags: int = 7) -> CanLog:
    made = [
        CanFrame(t_s=k * 1e-3, can_id=0x186, data=b"".join(w.to_bytes(2, "little") for w in row) + bytes([k, flags]))
        for k, row in enumerate(words)
    ]
    return CanLog(frames=tuple(made))


def test_words_on_can_are_those_of_sdat() -> None:
    good = Board().capture(can=frames([WORDS] * (CYCLES - 2)))
    assert psd1_serial.words_of_the_line_are_those_on_can(good)
    assert psd1_serial.each_cycle_is_told_once(good)
    other = Board().capture(can=frames([(1, 2, 3)] * (CYCLES - 2)))
    for check in (psd1_serial.words_of_the_line_are_those_on_can, psd1_serial.each_cycle_is_told_once):
        with pytest.raises(Failed, match="on CAN"):
            check(other)


def test_strobes_that_are_not_told_are_found() -> None:
    e = Capture(variant=variant("psd1"), node=NODE, stimulus="messages", can=frames([WORDS] * 9, flags=3))
    with pytest.raises(Failed, match="READ_Z"):
        psd1_can.strobes_are_told(e)
    assert psd1_can.strobes_are_told(replace(e, can=frames([WORDS] * 9)))


def test_a_converter_out_of_step_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Y loses a word more than the others after each Res of a board that waits for its host, who is never late."""
    with Dut.open(variant("psd1", "psd1_host"), Addresses()) as s:
        assert psd1_control.converters_are_in_step_after_res(s)
        counters, looks = s.unit.counters, itertools.count()

        def off() -> dict[str, int]:
            found, k = dict(counters()), next(looks)
            return found | {name: found[name] + k for name in ("Lost Y", "Stretched cycles")}

        monkeypatch.setattr(s.unit, "counters", off)
        with pytest.raises(Failed):
            psd1_control.converters_are_in_step_after_res(s)
