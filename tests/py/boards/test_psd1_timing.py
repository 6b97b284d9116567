"""Every interval of PSD-1's cycle of reading on its lines (sources 4.5, rows 1 to 21; limits of the AD7712: 3.4).

A recording of psa-emu at 1 ns, with a host whose strobes come at random; all figures are whole nanoseconds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import psd1_bench
import pytest
from chip_bench import Recording
from psabench.link.vcd import read_vcd
from psd1_bench import HALF_NS, Strobe
from verilog_bench import seed_of_test

CYCLES = 60
BITS = 16
SHORTEST = [[Strobe(True, 0, 200, axis)] for axis in range(3)]  # a host that reads at once


@dataclass(frozen=True, slots=True)
class Transfer:
    """One word's way from a converter to the host, in ns."""

    axis: int
    word: int  # as the host read it
    a0_ns: int  # rise, of the cycle
    end_ns: int  # fall of A0
    rf_fall_ns: int
    rf_rise_ns: int
    rises_ns: tuple[int, ...]  # of SCLK
    falls_ns: tuple[int, ...]
    fl2_rise_ns: int
    fl2_fall_ns: int
    cs_fall_ns: int  # of the strobe that took the word
    cs_rise_ns: int


@dataclass(frozen=True, slots=True)
class Run:
    recording: Recording
    transfers: list[Transfer]

    def level(self, line: str, t_ns: int) -> int:
        return self.recording.level(line, t_ns)

    def of(self, axis: int) -> list[Transfer]:
        return [t for t in self.transfers if t.axis == axis]

    def changes_ns(self, line: str) -> list[int]:
        return sorted(self.recording.edges_ns(line, 0) + self.recording.edges_ns(line, 1))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    seed = seed_of_test()
    rows = list(psd1_bench.random_strobes(np.random.default_rng(seed), CYCLES))
    strobes = [*SHORTEST, *rows, *SHORTEST, *SHORTEST]
    path, words = psd1_bench.record(tmp_path_factory.mktemp("psd1"), seed % 2**31, strobes)
    recording = Recording(read_vcd(path))
    cycles = psd1_bench.cycles(recording.vcd)[: len(words)]
    assert len(cycles) == len(words) == CYCLES + 3
    found = [
        follow(recording, cycle, axis, word)
        for cycle, of_cycle in zip(cycles, words, strict=True)
        for axis, word in enumerate(of_cycle)
    ]
    return Run(recording, found)


def follow(r: Recording, cycle: psd1_bench.Cycle, axis: int, word: int) -> Transfer:
    """The transfer and the strobe of one word."""
    rf = f"RF{'XYZ'[axis]}"
    rf_fall = r.nth_ns(rf, 0, cycle.start_ns)
    rf_rise = r.nth_ns(rf, 1, rf_fall)
    fl2_rise = r.nth_ns("FL2", 1, rf_rise)
    fl2_fall = r.nth_ns("FL2", 0, fl2_rise)
    rises, falls = (tuple(r.between_ns("SCLK", level, rf_fall, rf_rise)) for level in (1, 0))
    cs_rise = next(t for t in r.between_ns("CS", 1, fl2_rise, fl2_fall) if bus(r, "AB", 4, t - 1) == axis)
    cs_fall = [t for t in r.edges_ns("CS", 0) if t < cs_rise][-1]
    of_cycle = (axis, word, cycle.start_ns, cycle.end_ns)
    return Transfer(*of_cycle, rf_fall, rf_rise, rises, falls, fl2_rise, fl2_fall, cs_fall, cs_rise)


def bus(recording: Recording, prefix: str, width: int, t_ns: int) -> int:
    return sum(recording.level(f"{prefix}{i}", t_ns) << i for i in range(width))


@dataclass(frozen=True, slots=True)
class Interval:
    """A row of sources 4.5: from one edge to another, exactly so long; of one axis, or (None) of each."""

    row: str
    what: str
    start: Callable[[Transfer], int]
    end: Callable[[Transfer], int]
    ns: int
    axis: int | None = None


def rise(n: int) -> Callable[[Transfer], int]:
    """Of SCLK, from 1."""
    return lambda t: t.rises_ns[n - 1]


def fall(n: int) -> Callable[[Transfer], int]:
    return lambda t: t.falls_ns[n - 1]


def transfer(t: Transfer) -> int:
    return t.rf_fall_ns


NUMBERS = range(1, BITS + 1)
INTERVALS = [
    Interval("2", "A0 to RFX", lambda t: t.a0_ns, transfer, 400, 0),
    *(Interval("4, 6, 8, 14, 18", f"RFx to rise {n}", transfer, rise(n), 700 + 800 * (n - 1)) for n in NUMBERS),
    *(Interval("5, 7, 9", f"RFx to fall {n}", transfer, fall(n), 1100 + 800 * (n - 1)) for n in NUMBERS),
    Interval("10, 15, 19", "RFx low", transfer, lambda t: t.rf_rise_ns, 13_600),
    Interval("10, 15, 19", "RFx high to FL2", lambda t: t.rf_rise_ns, lambda t: t.fl2_rise_ns, 0),
    Interval("10", "A0 to FL2 of X", lambda t: t.a0_ns, lambda t: t.fl2_rise_ns, 14_000, 0),
    Interval("21", "last FL2 to A0", lambda t: t.fl2_fall_ns, lambda t: t.end_ns, 0, 2),
]


@pytest.mark.parametrize("i", INTERVALS, ids=lambda i: f"row {i.row}: {i.what}")
def test_intervals_that_the_controller_keeps(i: Interval, run: Run) -> None:
    rows = run.transfers if i.axis is None else run.of(i.axis)
    assert {len(t.rises_ns) for t in rows} == {len(t.falls_ns) for t in rows} == {BITS}
    wrong = [(t.rf_fall_ns, i.end(t) - i.start(t)) for t in rows if i.end(t) - i.start(t) != i.ns]
    assert wrong == []


def on_clock(run: Run, instants: list[int], level: int) -> list[int]:
    """Those at which 1M25 does not go to this level."""
    return sorted({*instants} - {*run.recording.edges_ns("CLK_1M25", level)})


def test_row_1_a0_rises_with_the_clock_when_int0_fl1_and_dr_are_active(run: Run) -> None:
    starts = [t.a0_ns for t in run.of(0)]
    assert on_clock(run, starts, 1) == []
    before = {(line, run.level(line, t - 1)) for t in starts for line in ("INT0", "FL1", "DR", "A0")}
    assert before == {("INT0", 1), ("FL1", 0), ("DR", 0), ("A0", 0)}


def test_row_1_no_earlier_rise_of_the_clock_would_have_done(run: Run) -> None:
    """The rise before found DR high, or INT0 or FL1 not active, or came not after the end of the last cycle."""
    for t in run.of(0):
        early = t.a0_ns - 2 * HALF_NS - 1
        ready = run.level("INT0", early) == 1 and run.level("FL1", early) == 0 and run.level("DR", early) == 0
        assert not ready or run.level("A0", early) == 1, t


def test_rows_2_10_12_15_17_19_rfx_moves_with_falls_of_the_clock(run: Run) -> None:
    assert on_clock(run, [x for t in run.transfers for x in (t.rf_fall_ns, t.rf_rise_ns, t.fl2_fall_ns)], 0) == []


def test_rows_3_and_13_the_first_bit_is_there_400_ns_after_rfx(run: Run) -> None:
    late = {run.level("SDAT", t.rf_fall_ns + 400) ^ t.word >> 15 for t in run.transfers}
    moved = [c for t in run.transfers for c in run.recording.between_ns("SDAT", 1, t.rf_fall_ns + 400, t.rises_ns[0])]
    assert (late, moved) == ({0}, [])


def test_rows_4_to_8_the_bits_at_the_rises_of_sclk_are_the_word_that_the_host_reads(run: Run) -> None:
    for t in run.transfers:
        bits = [run.level("SDAT", at) for at in t.rises_ns]
        assert int("".join(map(str, bits)), 2) == t.word, t


def test_row_5_bits_change_within_220_ns_of_the_fall_and_hold_10(run: Run) -> None:
    edges = np.array(run.changes_ns("SDAT"))
    for t in run.transfers:
        inside = edges[(edges > t.rises_ns[0]) & (edges < t.rf_rise_ns)]
        falls = np.array(t.falls_ns)
        after = inside - falls[np.searchsorted(falls, inside, "right") - 1]
        assert inside.size == 0 or (after.min() >= 10 and after.max() <= 220), t


def test_row_9_dr_returns_within_110_ns_of_the_last_fall(run: Run) -> None:
    """Unless it has risen before, on the way to a word that follows."""
    waits = [(run.level("DR", t.falls_ns[-1] - 1), run.level("DR", t.falls_ns[-1] + 110)) for t in run.of(0)]
    assert {after for before, after in waits} == {1}
    assert sum(before == 0 for before, _ in waits) > CYCLES / 2


def test_rows_11_16_20_the_word_is_on_the_bus_while_the_strobe_is_low(run: Run) -> None:
    for t in run.transfers:
        seen = {bus(run.recording, "D", 16, at) for at in (t.cs_fall_ns, t.cs_rise_ns - 1)}
        assert (seen, bus(run.recording, "D", 16, t.cs_rise_ns)) == ({t.word}, 0)
        assert t.cs_fall_ns >= t.fl2_rise_ns
        assert run.level("RW", t.cs_fall_ns) == 1


def test_rows_12_17_20_fl2_is_cleared_by_the_first_fall_of_the_clock_after_the_strobe(run: Run) -> None:
    falls = np.array(run.recording.edges_ns("CLK_1M25", 0))
    wrong = [t for t in run.transfers if t.fl2_fall_ns != falls[np.searchsorted(falls, t.cs_rise_ns, "right")]]
    assert wrong == []


def test_rows_12_and_17_the_next_transfer_begins_as_fl2_is_cleared(run: Run) -> None:
    wrong = [(a, b) for a, b in pairwise(run.transfers) if b.axis > 0 and b.rf_fall_ns != a.fl2_fall_ns]
    assert wrong == []


def test_row_21_a_cycle_begins_again_with_a_rise_of_the_clock(run: Run) -> None:
    waits = [b.a0_ns - a.end_ns for a, b in pairwise(run.of(2))]
    assert min(waits) >= HALF_NS
    assert {w % (2 * HALF_NS) for w in waits} == {HALF_NS}


def test_the_shortest_cycle_takes_43600_ns(run: Run) -> None:
    """Sources 4.5: RFX 400, RFY 14 800, RFZ 29 200 and 42 800, the last FL2 43 600 ns after A0."""
    x, y, z = run.transfers[-3:]
    instants = (x.rf_fall_ns, y.rf_fall_ns, z.rf_fall_ns, z.rf_rise_ns, z.end_ns)
    assert tuple(t - x.a0_ns for t in instants) == (400, 14_800, 29_200, 42_800, 43_600)


@pytest.mark.parametrize(
    ("limit", "least_ns", "found"),
    [
        ("A0 to RFS, 2 tau", 200, lambda t: [t.rf_fall_ns - t.a0_ns]),
        ("RFS high to A0", 0, lambda t: [t.end_ns - t.rf_rise_ns]),
        ("SCLK period, 5 tau", 500, lambda t: [b - a for a, b in pairwise(t.rises_ns)]),
        ("SCLK high, 2 tau", 200, lambda t: [b - a for a, b in zip(t.rises_ns, t.falls_ns, strict=True)]),
        ("SCLK low, 2 tau", 200, lambda t: [b - a for a, b in zip(t.falls_ns, t.rises_ns[1:], strict=False)]),
        ("RFS low to SCLK, 4 tau", 400, lambda t: [t.rises_ns[0] - t.rf_fall_ns]),
        ("SCLK fall to RFS high", 10, lambda t: [t.rf_rise_ns - t.falls_ns[-1]]),
    ],
)
def test_limits_of_the_converters(limit: str, least_ns: int, found: Callable[[Transfer], list[int]], run: Run) -> None:
    assert min(ns for t in run.transfers for ns in found(t)) >= least_ns


def test_sdata_is_released_within_300_ns_of_rfs(run: Run) -> None:
    assert {run.level("SDAT", t.rf_rise_ns + 300) for t in run.transfers} == {0}


def test_dr_is_low_when_rfx_falls(run: Run) -> None:
    """DRDY low to RFS low at least 0 ns, as the controller can know it: at the rise of A0."""
    assert [t for t in run.of(0) if run.level("DR", t.a0_ns - 1) != 0] == []


def test_nothing_moves_but_the_clock_between_cycles(run: Run) -> None:
    """But for DR, and strobes of a host that has no word to read."""
    quiet = [line for line in psd1_bench.LINES if line not in ("CLK_1M25", "DR", "CS", "RW", "AB0", "AB1", "A0")]
    between = [(a.end_ns, b.a0_ns) for a, b in pairwise(run.of(2))]
    edges = {line: np.array(run.changes_ns(line)) for line in quiet}
    moved = [(line, a) for a, b in between for line in quiet if ((edges[line] > a) & (edges[line] < b)).any()]
    assert moved == []


def test_control_words_keep_the_limits_of_a_write(run: Run) -> None:
    """Set-up: A0 low, 24 SCLK, data held for 30 ns after the rise, TFS high 4 tau after the last fall."""
    r = run.recording
    falls, rises = r.edges_ns("TFS", 0), r.edges_ns("TFS", 1)
    assert len(falls) == len(rises) > 0
    assert on_clock(run, falls + rises, 0) == []
    sdat = np.array(run.changes_ns("SDAT"))
    for down, up in zip(falls, rises, strict=True):
        clocks, ends = r.between_ns("SCLK", 1, down, up), r.between_ns("SCLK", 0, down, up)
        assert [t - down for t in clocks] == [700 + 800 * n for n in range(24)]
        assert r.between_ns("A0", 1, down - 1, up + 1) == []
        assert r.level("A0", down) == 0
        assert up - ends[-1] >= 400
        held = [t for t in clocks if ((sdat > t) & (sdat < t + 30)).any()]
        assert held == []
