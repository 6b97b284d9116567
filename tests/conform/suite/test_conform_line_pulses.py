"""What holds for all lines of a board alike, on lines made by hand: a glitch, a line that is stuck or upside down.

The lines stay at each level for just as long as the requirement wants it at least.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from psabench.boards.gyro.conform import check as gyro
from psabench.boards.pik.conform import check as pik
from psabench.boards.pmka.conform import check_lines as pmka_lines
from psabench.boards.psd1.conform.capture_cycles import PINS as PSD1_PINS
from psabench.conform.capture.log import CanFrame, CanLog, Capture, LineLog
from psabench.conform.capture.pulses import all_move, bus_moves, none_is_too_short, shortest
from psabench.conform.check import line_pulses
from psabench.conform.profile import variant
from psabench.conform.proves import row_for
from psabench.conform.verdict import Failed, Inconclusive
from psabench.link.busport import Cycle
from psabench.link.protocol_files import dbc_node, message
from psabench.link.vcd import Vcd, Wire

PSA2_PINS = ("SClk", "DRD_A", "DIn", "DOutX", "DOutY", "DOutZ", "SYNC_T", "CST", "DRD_T", "DInT", "DOutT")
PINS: Mapping[str, tuple[str, ...]] = {
    "psa2": PSA2_PINS,
    "psd1": PSD1_PINS,
    "pmka": pmka_lines.PINS,
    "pik": ("CLK", *pik.PINS),
    "pik6": ("CLK", *pik.PINS),
    "gyro": gyro.LINES,
}
MOVES = {"psd1": "PSD1-SIG-02", "pmka": "PMKA-SIG-03", "pik": "PIK-SIG-02", "pik6": "PIK-SIG-02", "gyro": "GYRO-SIG-02"}
STAYS, BEGIN_NS, GLITCH_NS, LONG_NS = 5, 400_000, 100, 50_000


said = cache(variant)


def wire(*moves: tuple[int, int]) -> Wire:
    """Instants and the levels from then on, the first that of the begin."""
    return Wire(np.array([t for t, _ in moves], np.int64), np.array([v for _, v in moves], np.uint8))


def capture(board: str, wires: Mapping[str, Wire], resolution_ns: float = 1.0) -> Capture:
    end_ns = max(int(w.t_ns[-1]) for w in wires.values()) + LONG_NS
    lines = LineLog(recording=Vcd(1, 0, end_ns, dict(wires)), resolution_ns=resolution_ns)
    return Capture(variant=said(board), node=dbc_node(said(board).family), stimulus="stream", lines=lines)


def least_ns(board: str, name: str) -> tuple[int, int]:
    """How long it stays low and high at least; long where nothing is said."""
    found = [LONG_NS, LONG_NS]
    for line, level, ns in shortest(row_for(capture(board, {"x": wire((0, 0))}), *line_pulses.SHORT)):
        if name.lower() == line or name.lower().rstrip("0123456789") == line:
            found[level] = int(np.ceil(ns))
    return found[0], found[1]


def good(board: str, resolution_ns: float = 1.0) -> Capture:
    wires = {}
    for name in PINS[board]:
        low_ns, high_ns = least_ns(board, name)
        steps = np.cumsum([BEGIN_NS, *[high_ns, low_ns] * STAYS])
        wires[name] = wire((0, 0), *((int(t), 1 - k % 2) for k, t in enumerate(steps)))
    return capture(board, wires, resolution_ns)


def with_wire(e: Capture, name: str, w: Wire) -> Capture:
    old = e.wires.recording
    return e.with_lines(replace(e.wires, recording=replace(old, wires=dict(old.wires) | {name: w})))


def disturbed(e: Capture, name: str, level: int, width_ns: int = GLITCH_NS) -> Capture:
    """With a pulse to this level in the middle of the first stay at the other; before all edges for a high one."""
    w = e.wires[name]
    begin, end = e.wires.pulses(name, 0) if level else e.wires.pulses(name, 1)
    at = int(begin[0] + end[0]) // 2
    t_ns = np.sort(np.concatenate([w.t_ns, [at, at + width_ns]]))
    k = int(np.searchsorted(t_ns, at))
    return with_wire(e, name, Wire(t_ns, np.insert(w.level, k, np.array([level, 1 - level], np.uint8))))


def short(e: Capture) -> str:
    return none_is_too_short(e, row_for(e, *line_pulses.SHORT))


@pytest.mark.parametrize("board", PINS)
@pytest.mark.parametrize("resolution_ns", [1.0, 125.0])
def test_stays_that_are_as_short_as_they_may_be_conform(board: str, resolution_ns: float) -> None:
    assert "none too short" in short(good(board, resolution_ns))


@pytest.mark.parametrize(("board", "name"), [(b, n) for b in PINS for n in PINS[b]])
def test_a_pulse_of_100_ns_is_found_on_every_line(board: str, name: str) -> None:
    e = good(board)
    for level in (0, 1):
        limits = shortest(row_for(e, *line_pulses.SHORT))
        mine = {lv for line, lv, _ in limits if name.lower() == line or name.lower().rstrip("0123456789") == line}
        assert mine, name
        if level in mine:
            with pytest.raises(Failed, match=rf"{name} (low|high) for") as found:
                short(disturbed(e, name, level))
            assert found.value.lines == (name,)


@pytest.mark.parametrize("name", ["CLK", "FXP", "LATCH", "CS"])
def test_what_begins_before_the_recording_is_whole_is_no_fault(name: str) -> None:
    e = good("pik")
    rest = 1 if name in ("LATCH", "CS") else 0
    assert short(with_wire(e, name, wire((0, rest), (250_000, 1 - rest), (250_100, rest))))
    with pytest.raises(Failed, match=name):
        short(with_wire(e, name, wire((0, rest), (350_000, 1 - rest), (350_100, rest))))


def test_a_pulse_that_a_gap_cuts_is_no_fault() -> None:
    e = with_wire(good("pik6"), "FXP", wire((0, 0), (500_000, 1), (500_000 + GLITCH_NS, 0)))
    assert short(e.with_lines(replace(e.wires, gaps_ns=np.array([500_050], np.int64))))
    with pytest.raises(Failed, match="FXP high"):
        short(e.with_lines(replace(e.wires, gaps_ns=np.array([600_000], np.int64))))


def test_clocks_may_be_off() -> None:
    e = good("pmka")

    def fast(by: float) -> Capture:
        old = e.wires.recording.wires
        return capture("pmka", {n: Wire(np.floor(w.t_ns * (1 - by)).astype(np.int64), w.level) for n, w in old.items()})

    assert short(fast(180e-6))
    with pytest.raises(Failed):
        short(fast(0.01))


@pytest.mark.parametrize("board", PINS)
def test_lines_that_nobody_recorded_or_moved_are_not_judged(board: str) -> None:
    still = capture(board, {name: wire((0, 0)) for name in PINS[board]})
    with pytest.raises(Inconclusive, match="moves"):
        short(still)
    with pytest.raises(Inconclusive, match="no line"):
        short(capture(board, {"x": wire((0, 0))}))


@pytest.mark.parametrize("board", MOVES)
def test_a_line_that_is_stuck_is_found(board: str) -> None:
    e = good(board)
    row = row_for(e, MOVES[board])
    assert all_move(e, row)
    due = [limit.removesuffix("_edges") for limit in row.limits if limit.endswith("_edges")]
    mine = [n for n in PINS[board] if n.lower() in due or n.lower().rstrip("0123456789") in due]
    assert len(mine) >= len(due)
    for name in mine:
        for level in (0, 1):
            with pytest.raises(Failed, match=f"0 edges of {name}, always {level}"):
                all_move(with_wire(e, name, wire((0, level))), row)


def test_the_line_of_control_words_moves_in_the_set_up() -> None:
    e = good("psd1")
    assert line_pulses.lines_of_the_set_up_move(e)
    with pytest.raises(Failed, match="TFS"):
        line_pulses.lines_of_the_set_up_move(with_wire(e, "TFS", wire((0, 1))))


@pytest.mark.parametrize("board", ["psd1", "pmka"])
def test_a_line_of_the_bus_that_a_cycle_does_not_move_is_found(board: str) -> None:
    write = Cycle(True, 0x5, 0x8001, 1_000_000)
    e = replace(good(board), cycles=(write,))
    assert "6 lines" in bus_moves(e)  # CS, RW, AB0, AB2, D0, D15
    for name, level in (("CS", 1), ("RW", 1), ("AB2", 0), ("D15", 1)):
        with pytest.raises(Failed, match=f"{name} always {level}"):
            bus_moves(with_wire(e, name, wire((0, level))))
    assert bus_moves(with_wire(e, "D3", wire((0, 0))))
    with pytest.raises(Inconclusive, match="no cycle"):
        bus_moves(replace(e, cycles=()))


@pytest.mark.parametrize(("board", "tclk_ns"), [("pik", 287_356), ("pik6", 25_000)])
def test_a_clock_that_rests_high_is_upside_down(board: str, tclk_ns: int) -> None:
    half = tclk_ns // 2
    begin = [(k * half, k % 2) for k in range(1, 20)]
    off_ns = begin[-1][0] + half
    after = [(off_ns + 20_000_000 + k * half, 1 - k % 2) for k in range(20)]
    moves = [(0, 0), *begin, (off_ns, 0), *after]
    assert "CLK 0" in pik.the_clock_rests_low(capture(board, {"CLK": wire(*moves)}))
    with pytest.raises(Failed, match="CLK 1"):
        pik.the_clock_rests_low(capture(board, {"CLK": wire(*((t, 1 - v) for t, v in moves))}))
    with pytest.raises(Inconclusive, match="moves on"):
        pik.the_clock_rests_low(capture(board, {"CLK": wire((0, 0), *begin)}))
    with pytest.raises(Inconclusive, match="does not move"):
        pik.the_clock_rests_low(capture(board, {"CLK": wire((0, 0))}))


def unit(lost: range, shown: range, steps: int = 60) -> Capture:
    """Readings of a gyro unit, LEVEL_LOST in some of them and FAULT high in some."""
    period_ns, high_ns = 10_000_000, 100_000
    frames = []
    for k in range(steps):
        for name in ("GYRO_RATES", "GYRO_ANGLES", "GYRO_LEVEL"):
            m = message(name)
            told = dict.fromkeys((s.name for s in m.signals), 0)
            if name == "GYRO_ANGLES":
                told |= {"STEP": k, "LEVEL_LOST": int(k in lost)}
            frames.append(CanFrame(t_s=k * 0.01, can_id=m.frame_id, data=bytes(m.encode(told, scaling=False))))
    step = [(0, 0), *((1_000_000 + k * period_ns + h, 1 - int(h > 0)) for k in range(steps) for h in (0, high_ns))]
    fault = [(0, 0), *((1_000_000 + k * period_ns, v) for k, v in ((shown.start, 1), (shown.stop, 0)))]
    return capture("gyro", {"STEP": wire(*step), "FAULT": wire(*fault)}).with_can(CanLog(frames=tuple(frames)))


def test_fault_is_high_while_a_flag_is_set() -> None:
    assert "FAULT in 20 steps" in gyro.fault_shows_the_flags(unit(range(10, 30), range(10, 30)))
    e = unit(range(10, 30), range(10, 30))
    for level in (0, 1):
        with pytest.raises(Failed, match="as the flags tell"):
            gyro.fault_shows_the_flags(with_wire(e, "FAULT", wire((0, level))))
    with pytest.raises(Failed):  # upside down
        gyro.fault_shows_the_flags(with_wire(e, "FAULT", Wire(e.wires["FAULT"].t_ns, 1 - e.wires["FAULT"].level)))
    with pytest.raises(Failed):
        gyro.fault_shows_the_flags(unit(range(0), range(10, 30)))
    with pytest.raises(Inconclusive, match="lost"):
        gyro.fault_shows_the_flags(e.with_lines(replace(e.wires, gaps_ns=np.array([5_000_000], np.int64))))
