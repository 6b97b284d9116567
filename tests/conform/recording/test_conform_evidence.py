"""Logs of lines and frames as the checks ask them."""

from __future__ import annotations

import numpy as np
import pytest
from psabench.conform.capture.log import CanFrame, CanLog, LineLog
from psabench.conform.sources.samples import line_log
from psabench.link.vcd import Vcd, Wire


def log_of(levels: list[tuple[int, int]], gaps: list[int] | None = None) -> LineLog:
    """A log of one line L: (instant, level)."""
    t, v = zip(*levels, strict=True)
    wire = Wire(np.array(t, np.int64), np.array(v, np.uint8))
    return LineLog(recording=Vcd(1, t[0], t[-1] + 100, {"L": wire}), gaps_ns=np.array(gaps or [], np.int64))


def test_pulses_are_whole_stays_at_a_level() -> None:
    log = log_of([(0, 0), (10, 1), (30, 0), (50, 1), (70, 0), (90, 1)])
    begin, end = log.pulses("L", 0)
    assert (begin.tolist(), end.tolist()) == ([30, 70], [50, 90])  # the first began before the recording
    begin, end = log.pulses("L", 1)
    assert (begin.tolist(), end.tolist()) == ([10, 50], [30, 70])  # the last does not end in it


def test_a_gap_makes_a_pulse_unknown() -> None:
    log = log_of([(0, 1), (10, 0), (30, 1), (50, 0), (70, 1)], gaps=[20])
    begin, end = log.pulses("L", 0)
    assert (begin.tolist(), end.tolist()) == ([50], [70])
    assert log.known(np.array([30, 0]), np.array([60, 60])).tolist() == [True, False]


def test_an_edge_at_a_gap_may_be_older() -> None:
    log = log_of([(0, 1), (10, 0), (30, 1), (50, 0), (70, 1)], gaps=[30])
    assert log.pulses("L", 0)[0].tolist() == [50]
    assert log.pulses("L", 1)[0].tolist() == []


def test_the_longest_stretch_without_a_gap() -> None:
    log = log_of([(0, 1), (10, 0), (30, 1), (50, 0), (70, 1)], gaps=[20, 60]).unbroken()
    assert (log.start_ns, log.end_ns, len(log.gaps_ns)) == (60, 170, 0)
    assert (log["L"].t_ns.tolist(), log["L"].level.tolist()) == ([60, 70], [0, 1])
    assert log.unbroken() is log


def test_a_line_without_an_edge_has_no_pulse() -> None:
    for level in (0, 1):
        begin, end = log_of([(0, 1)]).pulses("L", level)
        assert len(begin) == len(end) == 0


def test_a_line_that_is_not_there_is_named_with_those_that_are() -> None:
    with pytest.raises(KeyError, match="line: expected L, got CLK"):
        log_of([(0, 1)])["CLK"]


def test_samples_become_edges_at_the_first_sample_that_shows_them() -> None:
    log = line_log(bytes([1, 1, 0, 0x80, 4, 5, 5]), "psa2", 1e6)
    assert log.falls("Int").tolist() == [2000]
    assert log.rises("Int").tolist() == [5000]
    assert log.rises("CLK").tolist() == [4000]
    assert log.gaps_ns.tolist() == [3000]
    assert (log.start_ns, log.end_ns, log.resolution_ns) == (0, 7000, 1000.0)
    assert log["Data"].level.tolist() == [0]


def test_samples_are_the_same_in_any_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    data = np.random.default_rng(7).integers(0, 8, 1000, np.uint8).tobytes()
    whole = line_log(data, "psa2", 8e6)
    monkeypatch.setattr("psabench.conform.sources.samples.BLOCK", 7)
    parts = line_log(data, "psa2", 8e6)
    for name, wire in whole.recording.wires.items():
        assert np.array_equal(wire.t_ns, parts[name].t_ns)
        assert np.array_equal(wire.level, parts[name].level)


def test_frames_are_found_by_message_and_node() -> None:
    mine = CanFrame(t_s=1.0, can_id=0x187, data=bytes(8))
    others = CanFrame(t_s=1.0, can_id=0x185, data=bytes(8)), CanFrame(t_s=2.0, can_id=0x187, data=b"", error=True)
    log = CanLog(frames=(mine, *others)).of("PSA2_XY", "psa2", 7)
    assert log.frames == (mine,)
    assert log.raw("PSA2_XY")["SEQ"].tolist() == [0]


def test_a_frame_of_another_length_is_no_such_message() -> None:
    log = CanLog(frames=(CanFrame(t_s=0.5, can_id=0x185, data=bytes(7)),))
    with pytest.raises(ValueError, match=r"PSA2_XY at 0\.500000 s: expected 8 bytes, got 7"):
        log.raw("PSA2_XY")
