"""Windows out of two streams: which frames belong to which reading, and what is missing; how long each may take."""

from __future__ import annotations

import itertools
from dataclasses import fields, replace
from types import SimpleNamespace
from typing import Any

import can
import numpy as np
import pytest
from psabench.boards.gyro.device import Flag, Gyro, Phase
from psabench.boards.psa2.device import Psa2
from psabench.boards.psa2.frames import FrameReader, Frames
from psabench.boards.readings import ReadingReader, Readings
from psabench.errors import LinkError
from psabench.procedures.platform_bench import Table
from psabench.procedures.wire_platform import SLICE_S, WirePlatform, _ahead, _LevelScale, _Tape

from tests.py.boards.test_frames import pair
from tests.py.boards.test_readings import reading

PER_STEP = 3  # frames
STEP_S = 0.01


def streams(first_seq: int, steps: int, phase: Any, lose: frozenset[int] = frozenset()) -> tuple[Any, Any]:
    """Stand-ins of both units: each step has three frames whose X tells the step, and the reading after them."""
    gyro, level = ReadingReader(Gyro.layout, 9), FrameReader(5)
    for k in range(steps):
        seqs = [first_seq + PER_STEP * k + j for j in range(PER_STEP)]
        for m in itertools.chain.from_iterable(pair((1000 * (k % 8000), -k, 0), q) for q in seqs if q not in lose):
            level.on_message(m)
        raw = {"STEP": k, "PHASE": int(phase(k)), "POSITION": 1 + (k >= 40), "LEVEL_SEQ": seqs[-1] % 2**16, "MODE": 4}
        for m in reading(Gyro.layout, raw, 9, k * STEP_S):
            assert isinstance(m, can.Message)
            gyro.on_message(m)
    return SimpleNamespace(frames=gyro), SimpleNamespace(frames=level)


def taken(r: Readings, f: Frames, first: int, last: int) -> tuple[Any, Any]:
    """Stand-ins that have these steps of what was taken from others."""
    one, three = slice(first, last), slice(PER_STEP * first, PER_STEP * last)
    columns = {k: v[one] for k, v in r.columns.items()}
    readings = Readings(t_rx_s=r.t_rx_s[one], t_sample_s=r.t_sample_s[one], columns=columns, units=r.units)
    frames = replace(f, **{x.name: getattr(f, x.name)[three] for x in fields(f)})
    return tuple(SimpleNamespace(frames=SimpleNamespace(take=lambda x=x: x)) for x in (readings, frames))  # type: ignore[return-value]


def window(k: int) -> Phase:
    return Phase.WINDOW if 10 <= k < 30 or 50 <= k < 60 else Phase.SETTLING


@pytest.mark.parametrize("first_seq", [0, 100, 2**16 - 40, 2**16 - 100])
def test_each_reading_gets_the_frames_since_the_one_before(first_seq: int) -> None:
    tape = _Tape(STEP_S)
    tape.add(*streams(first_seq, 80, window))
    lsb = 10.0 / 2**23
    for first, last in ((10, 30), (50, 60)):
        span = tape.window()
        assert span is not None
        x_v, y_v, missing = tape.means(span)
        assert missing == 0
        assert np.allclose(x_v, 1000 * lsb * np.arange(first, last), rtol=0, atol=1e-12)
        assert np.allclose(y_v, -lsb * np.arange(first, last), rtol=0, atol=1e-12)
        assert np.array_equal(tape.readings["STEP"][span], np.arange(first, last))
        tape.drop(span.stop)
    assert tape.window() is None


def test_a_turn_may_take_longer_than_the_frames_take_to_wrap() -> None:
    steps = 12000  # three frames each: more than half a turn of the counter
    gyro, level = streams(0, steps + 40, lambda k: Phase.WINDOW if steps <= k < steps + 20 else Phase.SLEWING)
    tape = _Tape(STEP_S)
    readings, frames = gyro.frames.take(), level.frames.take()
    for first in range(0, steps + 40, 4000):
        tape.add(*taken(readings, frames, first, first + 4000))
    span = tape.window()
    assert span is not None
    _, y_v, missing = tape.means(span)
    assert missing == 0
    assert np.allclose(y_v, -10.0 / 2**23 * np.arange(steps, steps + 20), rtol=0, atol=1e-12)


def test_a_window_right_after_another_has_all_its_frames() -> None:
    tape = _Tape(STEP_S)
    tape.add(*streams(0, 80, lambda k: Phase.WINDOW if 10 <= k < 60 else Phase.IDLE))
    for first, last in ((10, 40), (40, 60)):  # the position changes there
        span = tape.window()
        assert span is not None
        x_v, _, missing = tape.means(span)
        assert missing == 0
        assert np.allclose(x_v, 1000 * 10.0 / 2**23 * np.arange(first, last), rtol=0, atol=1e-12)
        tape.drop(span.stop)


def test_a_window_that_is_not_over_is_none_yet() -> None:
    tape = _Tape(STEP_S)
    assert tape.window() is None
    assert tape.latest("MODE", 4) == 4
    tape.add(*streams(0, 20, window))
    assert tape.window() is None
    assert tape.latest("POSITION", 0) == 1


def test_lost_frames_are_counted_in_their_window_alone() -> None:
    lose = frozenset(range(10, 12)) | frozenset([3 * 20 + 1]) | frozenset(range(3 * 25, 3 * 26))
    tape = _Tape(STEP_S)
    tape.add(*streams(0, 40, window, lose))
    span = tape.window()
    assert span is not None
    x_v, _, missing = tape.means(span)
    assert missing == 4
    assert np.isfinite(x_v).all()


def test_no_frame_at_all_is_a_failure() -> None:
    tape = _Tape(STEP_S)
    tape.add(*streams(0, 40, window, frozenset(range(3 * 40))))
    span = tape.window()
    assert span is not None
    with pytest.raises(LinkError, match="expected frames of the level unit"):
        tape.means(span)


def test_frames_ahead_of_a_number_over_the_wrap() -> None:
    seq = np.array([2**16 - 2, 2**16 - 1, 0, 1])
    assert _ahead(seq, 2**16 - 1).tolist() == [-1, 0, 1, 2]
    long = np.arange(70000) % 2**16
    assert _ahead(long, 5)[-1] == 69999 - 5


def test_volts_are_angles() -> None:
    """sin(beta) of channel Y, -sin(gamma) cos(beta) of channel X, by the scale of object 2109h."""
    scale = _LevelScale(zero_x_v=0.01, zero_y_v=-0.02, scale_x_v_per_g=-1.2, scale_y_v_per_g=-1.1)
    beta, gamma = np.radians([0.3, -2.0]), np.radians([5.0, -4.0])
    x_v = 0.01 - 1.2 * (-np.sin(gamma) * np.cos(beta))
    y_v = -0.02 - 1.1 * np.sin(beta)
    found = scale.angles(x_v, y_v)
    assert np.allclose(found[0], beta, atol=1e-12)
    assert np.allclose(found[1], gamma, atol=1e-12)


# ---- how long it waits


class SilentGyro(SimpleNamespace):
    """A gyro unit that sends nothing; beta is the next of those given, then always the last."""

    @property
    def beta_deg(self) -> float:
        return float(self.betas_deg.pop(0) if len(self.betas_deg) > 1 else self.betas_deg[0])


class SilentBench:
    """Both units, and a clock that only waits move; the run never comes to its first window."""

    def __init__(self, *betas_deg: float) -> None:
        self.betas_deg = list(betas_deg)
        self.time_s = 100.0
        self.level_unit = Psa2.__new__(Psa2)
        self.level_unit.node = SimpleNamespace(node_id=5)  # type: ignore[assignment]
        self.level_unit.frames = FrameReader(5)
        self.units = {"level": self.level_unit}
        self.wait_away = self.wait

    def wait(self, dwell_s: float) -> None:
        self.time_s += dwell_s

    def board(self, _: object) -> Any:
        settings = {
            "settle_limit_s": 30.0,
            "tolerance_arcmin": 1.0,
            "scale_x_v_per_g": 1.0,
            "scale_y_v_per_g": 1.0,
            "m1_per_s": 1.0,
        }
        return SilentGyro(
            betas_deg=self.betas_deg,
            level_node=5,
            step_s=STEP_S,
            frames=ReadingReader(Gyro.layout, 9),
            flags=Flag(0),
            get=lambda name: settings.get(name, 0.0),
            set=lambda **_: None,
            start=lambda: None,
            stop=lambda: None,
        )


def drop_window(_: object) -> None:
    """No one follows the windows."""


@pytest.mark.parametrize(
    ("more", "want_s"),
    [
        ({}, 40.0 + 10.0 + 10.0 + 30.0 + 10.0),
        ({"slew_dps": 18.0}, 20.0 + 10.0 + 10.0 + 30.0 + 10.0),
        ({"settle_s": 17.0}, 40.0 + 10.0 + 17.0 + 30.0 + 10.0),
        ({"settle_limit_s": 43.0}, 40.0 + 10.0 + 10.0 + 43.0 + 10.0),
        ({"window_s": 25.0}, 40.0 + 10.0 + 10.0 + 30.0 + 25.0),
    ],
)
def test_a_position_may_take_its_turn_its_settling_with_the_limit_and_its_window(
    more: dict[str, float], want_s: float
) -> None:
    """360 deg at slew_dps and ten seconds, settle_s, settle_limit_s, window_s: then it is given up, not before."""
    bench = SilentBench()
    table = Table(angles_deg=(0.0, 90.0), **more)  # type: ignore[arg-type]
    with pytest.raises(LinkError, match=f"position 1 was not measured in {want_s:.0f} s: no reading"):
        WirePlatform(bench).measure(table, drop_window)  # type: ignore[arg-type]
    assert want_s < bench.time_s - 100.0 <= want_s + SLICE_S


def test_a_calibration_may_take_its_settling_with_the_limit_and_its_length() -> None:
    bench = SilentBench()
    with pytest.raises(LinkError, match="position 1 was not measured in 112 s: no reading"):
        WirePlatform(bench).calibrate(60.0, 12.0)  # type: ignore[arg-type]
    assert 112.0 < bench.time_s - 100.0 <= 112.0 + SLICE_S


@pytest.mark.parametrize(
    ("m1_per_s", "timeout_s", "want_s"), [(1.0, 120.0, 25.0), (0.5, 120.0, 40.0), (1.0, 20.0, 20.0)]
)
def test_levelling_may_take_fifteen_time_constants_or_what_is_left(
    m1_per_s: float, timeout_s: float, want_s: float
) -> None:
    """15/m1 and ten seconds of the torquer's own, or timeout_s, which is less; one degree off reads 60'."""
    bench = SilentBench(1.0)
    platform = WirePlatform(bench)  # type: ignore[arg-type]
    platform._m1_per_s = m1_per_s
    with pytest.raises(LinkError, match=f"a level platform within {want_s:g} s, got 60.0' off"):
        platform.level(timeout_s)
    assert want_s <= bench.time_s - 100.0 < want_s + 0.2


def test_a_platform_is_level_after_ten_looks_in_a_row() -> None:
    """Nine within the tolerance, one beyond it, then ten."""
    bench = SilentBench(*[0.001] * 9, 0.5, *[-0.001] * 10)
    WirePlatform(bench).level(60.0)  # type: ignore[arg-type]
    assert bench.time_s - 100.0 == pytest.approx(20 * 0.1)
