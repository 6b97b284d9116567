"""Timing of the converters on the lines of a PSA-2: a recording of psa-emu at 1 ns (sources 1.4 to 1.6, 2.2 to 2.7).

What the converters do is held against their figures, what the board's controller does against the limits they set.
"""

from __future__ import annotations

import os
import subprocess
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import pytest
from chip_bench import Clock, Recording, no_complaints
from psabench.link.vcd import read_vcd

EMU = Path(os.environ.get("PSA_EMU") or Path(__file__).resolve().parents[3] / "build/psa-emu")
A = Clock(4_096_000)  # tCLK of the accelerometer converters
T = Clock(7_680_000)  # tau of the temperature converter
T_DR, PERIOD_A = 258_436, 4096  # at 1000 SPS
T18, PERIOD_T = 1382 + 256 * 300, 256 * 300  # at 100 SPS
END_NS = 250_000_000


@dataclass(frozen=True, slots=True)
class Byte:
    """A byte on DIn or DInT, with the rising and falling edges of its eight clocks."""

    value: int
    rises_ns: tuple[int, ...]
    falls_ns: tuple[int, ...]


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    path = tmp_path_factory.mktemp("board") / "run.vcd"
    words = f"--can none --pace free --for {END_NS // 10**6}ms --seed 1 --quiet --vcd {path} --vcd-unit 1".split()
    run = subprocess.run([str(EMU), *words], capture_output=True, text=True, timeout=100, check=False)
    assert run.returncode == 0, run.stderr
    return Recording(read_vcd(path))


def clocked(r: Recording, line: str, temperature: bool) -> list[Byte]:
    """What went to the converters of one kind: the temperature converter listens while CST is low."""
    rises, falls = r.edges_ns("SClk", 1), r.edges_ns("SClk", 0)
    mine = [(up, down) for up, down in zip(rises, falls, strict=True) if (r.level("CST", up) == 0) == temperature]
    bytes_ = []
    for i in range(0, len(mine) - len(mine) % 8, 8):
        ups, downs = zip(*mine[i : i + 8], strict=True)
        at = downs if temperature else ups  # modes 1 and 0; the line changes at the other edge
        value = sum(r.level(line, t - 1) << (7 - n) for n, t in enumerate(at))
        bytes_.append(Byte(value, ups, downs))
    return bytes_


def found(bytes_: list[Byte], *wanted: int) -> list[Byte]:
    """The first place where these bytes are in a row."""
    values = [b.value for b in bytes_]
    for i in range(len(values)):
        if values[i : i + len(wanted)] == list(wanted):
            return bytes_[i : i + len(wanted)]
    raise AssertionError(f"{' '.join(f'{w:02X}' for w in wanted)} was not sent")


def test_drd_a_comes_t_dr_after_reset_after_the_write_and_after_sync_a(recording: Recording) -> None:
    r = recording
    write = found(clocked(r, "DIn", False), 0x41, 0x00, 0x56)
    starts = {
        "Res": r.edges_ns("Res", 1)[0],
        "CONFIG0 = 56h": write[-1].rises_ns[-1],
        "SYNC_A": r.edges_ns("SYNC_A", 1)[0],
    }
    no_complaints(A.complaint(what, t, r.nth_ns("DRD_A", 0, t), T_DR) for what, t in starts.items())


def test_drd_a_falls_every_millisecond_and_rises_at_the_first_falling_edge_of_sclk(recording: Recording) -> None:
    r = recording
    falls = [t for t in r.edges_ns("DRD_A", 0) if t > r.edges_ns("SYNC_A", 1)[0]]
    assert len(falls) > 55
    no_complaints(A.complaint("period", a, b, PERIOD_A) for a, b in pairwise(falls))
    assert [t for t in falls[:-1] if r.nth_ns("DRD_A", 1, t) != r.nth_ns("SClk", 0, t)] == []


def test_reads_end_before_the_next_word_and_begin_100_ns_after_drd_a(recording: Recording) -> None:
    r = recording
    falls = [t for t in r.edges_ns("DRD_A", 0) if t > r.edges_ns("SYNC_A", 1)[0]]
    for a, b in pairwise(falls):
        clocks = [t for t in r.between_ns("SClk", 1, a, b) if r.level("CST", t) == 1]
        assert len(clocks) == 24
        assert clocks[0] - a >= 100
        assert b - clocks[-1] >= A.edge_ns(4)


def test_sclk_keeps_the_limits_of_both_converters(recording: Recording) -> None:
    """2 .. 16 tCLK, 0.8 .. 10 tCLK; 4 tau, 200 ns; DIn and DInT still for 50 ns around the sampling edge."""
    r = recording
    for temperature, line in ((False, "DIn"), (True, "DInT")):
        changes = sorted(r.edges_ns(line, 0) + r.edges_ns(line, 1))
        for b in clocked(r, line, temperature):
            periods = [y - x for x, y in pairwise(b.rises_ns)]
            highs = [down - up for up, down in zip(b.rises_ns, b.falls_ns, strict=True)]
            lows = [up - down for up, down in zip(b.rises_ns[1:], b.falls_ns, strict=False)]
            least_ns, half_ns = (T.edge_ns(4), Fraction(200)) if temperature else (A.edge_ns(2), A.edge_ns(4) / 5)
            assert min(periods) >= least_ns
            assert min(highs + lows) >= half_ns
            assert max(periods) <= A.edge_ns(16)
            at = b.falls_ns if temperature else b.rises_ns
            near = [(t, c) for t in at for c in changes if abs(c - t) < 50]
            assert near == []


def test_bytes_of_commands_to_the_accelerometer_converters_are_24_clocks_apart(recording: Recording) -> None:
    bytes_ = clocked(recording, "DIn", False)
    write = found(bytes_, 0x41, 0x00, 0x56)
    for a, b in pairwise(write):
        assert b.rises_ns[0] - a.rises_ns[-1] >= A.edge_ns(24)


def test_drd_t_after_reset_and_after_the_article_s_set_up(recording: Recording) -> None:
    """Self-calibration of 596 us after Res, of 31.2 ms after DRATE = 82h under ACAL; t17 while no one reads."""
    r = recording
    bytes_ = clocked(r, "DInT", True)
    res_ns = r.edges_ns("Res", 1)[0]
    drate = found(bytes_, 0x53, 0x00, 0x82)
    written_ns = drate[-1].falls_ns[-1]
    first = r.nth_ns("DRD_T", 0, res_ns) - res_ns
    calibrated = r.nth_ns("DRD_T", 0, written_ns) - written_ns
    assert abs(first - 596_000) <= 500 + T.edge_ns(1)
    assert abs(calibrated - 31_200_000) <= 50_000 + T.edge_ns(1)
    assert r.level("DRD_T", written_ns) == 1
    unread = [t for t in r.edges_ns("DRD_T", 0) if t < 60_000_000]
    no_complaints(T.complaint("30 kSPS", a, b, 256) for a, b in pairwise(unread))
    no_complaints(T.complaint("t17", r.nth_ns("DRD_T", 1, a), b, 16) for a, b in pairwise(unread))


def test_drd_t_comes_t18_after_each_sync_t(recording: Recording) -> None:
    r = recording
    drate_ns = found(clocked(r, "DInT", True), 0x53, 0x00, 0x82)[-1].falls_ns[-1]
    rises = [t for t in r.edges_ns("SYNC_T", 1) if t > drate_ns]
    assert len(rises) > 10
    settled = [t for t in rises if t + T.edge_ns(T18) < END_NS]
    no_complaints(T.complaint("t18", t, r.nth_ns("DRD_T", 0, t), T18) for t in settled)
    lows = [(r.nth_ns("SYNC_T", 0, t), r.nth_ns("SYNC_T", 1, t + 1)) for t in rises[:-1]]
    assert [1 for down, up in lows if up - down < T.edge_ns(4)] == []


def test_commands_to_the_temperature_converter_keep_t6_t10_and_t11(recording: Recording) -> None:
    r = recording
    bytes_ = clocked(r, "DInT", True)
    reads = 0
    for a, b in pairwise(bytes_):
        gap_ns = b.rises_ns[0] - a.falls_ns[-1]
        if a.value == 0x01 and b.value == 0 and r.between_ns("CST", 1, a.rises_ns[0], b.rises_ns[0]) == []:
            reads += 1
            assert gap_ns >= T.edge_ns(50)
    assert reads > 10
    for up in r.edges_ns("CST", 1):
        before = [t for t in r.edges_ns("SClk", 0) if t < up]
        assert up - before[-1] >= T.edge_ns(8)
