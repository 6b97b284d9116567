"""Readings on a grid, and the feed of a flight: what is lost, late or wrong; the recording gives the same."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from psabench.boards.bins.device import MESSAGES, UnitIncrements, Weights
from psabench.errors import BadInput
from psabench.koi.flight_data import Fix, FlightFound
from psabench.koi.wire.feed import FlightFeed
from psabench.koi.wire.increments import BRIDGE_S, END_S, IncrementGrid
from psabench.koi.wire.recording import FlightRecorder, Frame, Look, read_events
from psabench.link.protocol_files import message
from psabench.link.signals import Floats
from pvt_packets import pvt

NODE, SMALL = 11, 1e-8
WEIGHTS = Weights(gyro_rad=SMALL, accel_mps=SMALL, age_s=0.0)
IDS = [int(message(name).frame_id) for name in (*MESSAGES, "BINS_BARO")]


# ---- the grid


def readings(stamps: list[int], whole: list[bool] | None = None) -> UnitIncrements:
    """With time stamps in units of 10 ms; the increment is the stamp."""
    t = np.array(stamps, float)
    rows = SMALL * np.stack([t, 2.0 * t, -t], axis=1)
    good = np.ones(len(t), bool) if whole is None else np.array(whole)
    return UnitIncrements(
        end_s=0.01 * t % (2**32 * 1e-6), dtheta_rad=rows, dv_mps=3.0 * rows, seq=t.astype(int), whole=good
    )


def take(grid: IncrementGrid, stamps: list[int], whole: list[bool] | None = None) -> list[float]:
    got = grid.take(readings(stamps, whole), came(len(stamps), grid.now_s))
    assert got.dv_mps == pytest.approx(3.0 * got.dtheta_rad)
    return [float(x) for x in np.round(got.dtheta_rad[:, 0] / SMALL, 6)]


def came(count: int, from_s: float) -> Floats:
    return np.asarray(from_s + 0.01 * np.arange(count), np.float64)


def test_readings_in_a_row_are_passed_on() -> None:
    grid = IncrementGrid()
    assert take(grid, [5, 6, 7]) + take(grid, [8, 9]) == [5.0, 6.0, 7.0, 8.0, 9.0]
    assert grid.now_s == 0.05
    assert (grid.counts.gaps, grid.counts.filled, grid.counts.doubts) == (0, 0, [])


def test_a_gap_is_bridged_by_a_line_and_time_goes_on() -> None:
    """Within a batch, between two, and where readings are not whole."""
    grid = IncrementGrid()
    assert take(grid, [1, 2, 6]) + take(grid, [10]) == [float(k) for k in range(1, 11)]
    assert take(grid, [11, 12, 13], [True, False, True]) == [11.0, 12.0, 13.0]
    assert grid.now_s == pytest.approx(0.13)
    assert (grid.counts.gaps, grid.counts.filled, grid.counts.not_whole, grid.counts.doubts) == (3, 7, 1, [])


def test_a_long_gap_is_a_doubt() -> None:
    rows = round(BRIDGE_S / 0.01)
    grid = IncrementGrid()
    take(grid, [1, 2 + rows])
    assert grid.counts.doubts == []
    take(grid, [2 + rows + 1 + rows + 1])
    assert grid.counts.doubts == ["increments: expected gaps of at most 0.2 s, got one of 0.21 s at about 0.2 s"]
    assert grid.counts.longest_s == pytest.approx(BRIDGE_S + 0.01)


def test_repeated_and_older_readings_are_not_used() -> None:
    grid = IncrementGrid()
    assert take(grid, [5, 6, 6, 3, 7]) == [5.0, 6.0, 7.0]
    assert (grid.counts.repeated, grid.counts.backwards, grid.counts.doubts) == (1, 1, [])


def test_readings_of_no_motion_are_bridged() -> None:
    """A bit of the angle or of the velocity that a gateway has inverted."""
    grid, got = IncrementGrid(), readings(list(range(1, 21)))
    got.dtheta_rad[5, 1] += 2.0**30 * 1e-9
    got.dv_mps[9, 2] -= 5.0
    made = grid.take(got, came(20, 0.0))
    assert np.round(made.dtheta_rad[:, 0] / SMALL, 6).tolist() == [float(k) for k in range(1, 21)]
    assert np.abs(made.dv_mps).max() < 1e-4
    assert (grid.counts.impossible, grid.counts.filled, grid.counts.doubts) == (2, 2, [])


def test_a_clock_that_was_set_is_followed_with_a_doubt() -> None:
    """The unit's time goes back by a minute: after ten readings its time is believed, and the flight is not."""
    grid = IncrementGrid()
    take(grid, list(range(6000, 6100)))
    take(grid, list(range(10, 60)))
    assert grid.now_s == pytest.approx(1.5)
    assert len(grid.counts.doubts) == 1
    assert "expected time stamps that ascend by 10 ms, got -60.8" in grid.counts.doubts[0]


def test_the_time_stamp_wraps() -> None:
    """After 71.6 min."""
    grid, first = IncrementGrid(), 2**32 // 10_000 - 5
    take(grid, list(range(first, first + 5)))
    got = readings(list(range(first + 5, first + 20)))
    grid.take(got, came(15, 0.0))
    assert grid.now_s == pytest.approx(0.20)
    assert (grid.counts.gaps, grid.counts.backwards) == (0, 0)


def test_after_a_minute_without_readings_the_rest_is_not_used() -> None:
    grid, away = IncrementGrid(), round(END_S / 0.01) + 100
    take(grid, [1, 2, 3])
    got = grid.take(readings(list(range(away, away + 20))), came(20, 100.0))
    assert grid.ended
    assert len(got.dtheta_rad) == 0
    assert len(grid.counts.doubts) == 1


# ---- the feed


class Ears:
    """A host that remembers."""

    def __init__(self) -> None:
        self.rows = np.empty((0, 3))
        self.fixes, self.heights, self.doubts = list[tuple[Fix, int]](), list[tuple[float, float, int]](), list[str]()

    def push(self, dtheta_rad: Floats, dv_mps: Floats) -> None:
        assert len(dtheta_rad) == len(dv_mps) > 0
        self.rows = np.concatenate([self.rows, dtheta_rad])

    def take_fix(self, fix: Fix) -> None:
        self.fixes.append((fix, len(self.rows)))

    def take_height(self, t_s: float, h_m: float) -> None:
        self.heights.append((t_s, h_m, len(self.rows)))

    def doubt(self, text: str) -> None:
        self.doubts.append(text)

    def finish(self) -> FlightFound:
        raise AssertionError


def frames(number: int) -> Iterator[Frame]:
    """A reading, number from 1: gyro and accelerometers count it, the height is number mm."""
    t_s, n = 0.01 * number + 0.009, number & 0xFFFF
    bodies = (
        struct.pack("<ii", n, n),
        struct.pack("<iHBB", n, n, 0, 1),
        struct.pack("<ii", n, n),
        struct.pack("<iI", n, (10_000 * number) % 2**32),
        struct.pack("<i", number),
    )
    for k, (ident, body) in enumerate(zip(IDS, bodies, strict=True)):
        yield Frame(round(t_s + 1e-4 * k, 6), ident, body)


def flight(seconds: int, *, lost: frozenset[int] = frozenset(), baro: bool = True) -> Iterator[Frame | Look]:
    """Solutions each second, 40 ms late, seen 10 ms later at most; lost: numbers of frames."""
    count, sent, last_s = 0, 0, 0.0
    for number in range(1, 100 * seconds + 1):
        for frame in frames(number):
            sent += 1
            if sent in lost or (frame.arbitration_id == IDS[4] and not baro):
                continue
            count, last_s = count + 1, frame.timestamp
            yield frame
        if number % 100 == 5 and number > 100:
            yield Look(last_s, round(last_s - 0.01, 6), count, pvt(1000 * (number // 100)))


def fed(events: Iterator[Frame | Look]) -> tuple[FlightFeed, Ears]:
    ears = Ears()
    feed = FlightFeed(ears, WEIGHTS, NODE)
    for event in events:
        if isinstance(event, Look):
            feed.look(event)
        else:
            feed.on_message(event)
    feed._drain()
    return feed, ears


def test_a_quiet_flight_comes_through_whole() -> None:
    feed, ears = fed(flight(20))
    assert ears.rows[:, 0] == pytest.approx(SMALL * np.arange(1, 2001))
    assert [n for _, _, n in ears.heights] == [1 + 100 * k for k in range(20)]
    assert [t for t, _, _ in ears.heights] == pytest.approx([0.01 + k for k in range(20)])
    assert [h for _, h, _ in ears.heights] == pytest.approx([0.001 * (1 + 100 * k) for k in range(20)])
    off_s = [fix.t_s - k for k, (fix, _) in enumerate(ears.fixes, start=1)]
    assert len(off_s) == 19
    assert np.abs(np.array(off_s) - 0.015).max() < 1e-6
    assert all(fix.t_s < 0.01 * n for fix, n in ears.fixes)
    assert feed.notes() == []
    assert feed.silences == []


def test_a_lost_frame_is_a_reading_that_is_bridged_and_noted() -> None:
    """One of each kind; a lost height is no lost reading."""
    feed, ears = fed(flight(20, lost=frozenset({501, 1002, 1503, 2004, 2505})))
    assert ears.rows[:, 0] == pytest.approx(SMALL * np.arange(1, 2001))
    assert ears.doubts == []
    assert (feed.grid.counts.gaps, feed.grid.counts.filled) == (4, 4)
    notes = "\n".join(feed.notes())
    assert "increments: expected no gaps in the increments, got 4, 4 rows filled" in notes
    assert "readings whose frames come together" in notes
    assert len(ears.heights) == 20


def test_a_lost_height_comes_a_reading_later() -> None:
    _, ears = fed(flight(5, lost=frozenset({5 * 201})))
    assert [round(t, 6) for t, _, _ in ears.heights] == [0.01, 1.01, 2.02, 3.01, 4.01]


def test_a_unit_without_barometer_has_no_heights() -> None:
    assert fed(flight(5, baro=False))[1].heights == []


def test_half_a_second_lost_is_told_to_the_host() -> None:
    feed, ears = fed(flight(20, lost=frozenset(range(2000, 2250))))
    assert len(ears.doubts) == 1
    assert "gaps of at most 0.2 s, got one of 0.50 s" in ears.doubts[0]
    assert feed.grid.now_s == pytest.approx(20.0)


def test_a_silent_receiver_is_named_with_what_came_instead() -> None:
    def quiet() -> Iterator[Frame | Look]:
        for event in flight(30):
            if isinstance(event, Look) and 5.0 < event.t_s < 20.0:
                yield Look(event.t_s, event.begin_s, event.frames, b"\x00" * 10)
            else:
                yield event

    feed, ears = fed(quiet())
    assert len(ears.fixes) == 14
    (silence,) = feed.silences
    assert (silence.from_s, silence.to_s) == pytest.approx((4.05, 20.05))
    assert silence.size == 250
    assert any("none from 4 to 20 s, 250 bytes" in note for note in feed.notes())
    assert any("150 bytes of neither" in note for note in feed.notes())


# ---- the recording


def test_a_recording_gives_the_same_to_the_bit(tmp_path: Path) -> None:
    events = list(flight(10, lost=frozenset({77})))
    record(tmp_path, events)
    assert list(read_events(tmp_path)) == events
    first = (tmp_path / "can.log").read_text().splitlines()[0]
    assert first == "(0.019000) can0 18B#0100000001000000"


def record(folder: Path, events: list[Frame | Look]) -> None:
    with FlightRecorder(folder, {}) as recorder:
        for event in events:
            if isinstance(event, Look):
                recorder.look(event)
            else:
                recorder.on_message(event)


def cut(path: Path, size: int) -> None:
    path.write_bytes(path.read_bytes()[:-size])


def test_a_recording_that_was_cut_gives_what_is_whole(tmp_path: Path) -> None:
    """As after a kill: frames are missing that a look counts, then the last look itself is cut."""
    events = list(flight(10))
    record(tmp_path, events)
    cut(tmp_path / "can.log", 30_001)
    got = list(read_events(tmp_path))
    assert 3000 < len(got) < len(events)
    assert got == events[: len(got)]
    record(tmp_path, events)
    cut(tmp_path / "receiver.log", 11)
    last = max(k for k, event in enumerate(events) if isinstance(event, Look))
    assert list(read_events(tmp_path)) == events[:last] + events[last + 1 :]


@pytest.mark.parametrize(("name", "words"), [("can.log", "line of candump -L"), ("receiver.log", "gps#BEGIN#FRAMES")])
def test_a_damaged_line_is_named(name: str, words: str, tmp_path: Path) -> None:
    record(tmp_path, list(flight(3)))
    path = tmp_path / name
    path.write_text("rubbish\n" + path.read_text())
    with pytest.raises(BadInput, match=f"{name}: line 1: expected .*{words}"):
        list(read_events(tmp_path))
