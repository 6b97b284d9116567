"""What the gyrocompass library refuses and what it flags."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from nav_reference import DEG, SOME_NOISE, off_deg, positions
from psabench.errors import BadInput
from psabench.native import nav
from psabench.native.nav import Flag, Method, Noise, Position, Status


def good() -> list[Position]:
    return positions(50 * DEG, 0.5, np.arange(4) * 90 * DEG)


@pytest.mark.parametrize(
    ("rows", "options", "status", "word"),
    [
        (good()[:2], {}, Status.TOO_FEW, "too few"),
        ([], {}, Status.TOO_FEW, "too few"),
        (good(), {"method": Method.CLOSED3}, Status.TOO_FEW, "exactly three"),
        (good()[:3], {"ramp": True, "method": Method.LSQ}, Status.TOO_FEW, "four with a ramp"),
        (good() * 17, {}, Status.TOO_FEW, "64 at most"),
        ([good()[0], good()[2], good()[0]], {}, Status.COINCIDENT, "coincide"),
        ([replace(p, delta_rad=0.3 * DEG * i) for i, p in enumerate(good())], {}, Status.COINCIDENT, "coincide"),
        (good(), {"latitude_rad": 90 * DEG}, Status.LATITUDE, "85 degrees"),
        (good(), {"latitude_rad": -85.1 * DEG}, Status.LATITUDE, "85 degrees"),
        (good(), {"latitude_rad": math.nextafter(nav.LATITUDE_LIMIT_RAD, 2.0)}, Status.LATITUDE, "85 degrees"),
        (good(), {"latitude_rad": math.nan}, Status.NOT_FINITE, "not finite"),
        ([replace(p, gamma_rad=math.inf) for p in good()], {}, Status.NOT_FINITE, "not finite"),
        ([replace(p, gamma_rad=1.0) for p in good()], {}, Status.RANGE, "gamma_rad of position 1 is 1; want a tilt"),
        (good(), {"noise": Noise(angle_sd_rad=-1.0)}, Status.RANGE, "noise.angle_sd_rad is -1; want a standard"),
        ([replace(p, t_mid_s=0.0) for p in good()], {"noise": SOME_NOISE}, Status.TIMES, "follow one another"),
        ([replace(p, window_s=30.0) for p in good()], {"noise": SOME_NOISE}, Status.TIMES, "follow one another"),
        ([replace(p, window_s=0.0) for p in good()], {"noise": SOME_NOISE}, Status.TIMES, "follow one another"),
    ],
)  # fmt: skip
def test_what_cannot_be_answered_is_refused_in_words(
    rows: list[Position], options: dict[str, object], status: Status, word: str
) -> None:
    with pytest.raises(nav.Refused, match=word) as refused:
        nav.gyrocompass(rows, **({"latitude_rad": 50 * DEG} | options))  # type: ignore[arg-type]
    assert refused.value.status is status
    assert isinstance(refused.value, BadInput)


def test_the_highest_latitude_is_taken() -> None:
    rows = positions(nav.LATITUDE_LIMIT_RAD, 0.5, np.arange(4) * 90 * DEG)
    assert nav.gyrocompass(rows, latitude_rad=nav.LATITUDE_LIMIT_RAD).alpha1_rad == pytest.approx(0.5)


def test_the_other_functions_refuse_too() -> None:
    with pytest.raises(nav.Refused, match="coincide"):
        nav.attitude_from_level([0.0, math.pi, 2 * math.pi], [0.1, -0.1, 0.1])
    with pytest.raises(nav.Refused, match="too few"):
        nav.attitude_from_level([0.0, 1.0], [0.1, 0.1], bias=True)
    with pytest.raises(nav.Refused, match="not finite"):
        nav.cardan([0.0, math.nan], pitch_rad=0.0, roll_rad=0.0)
    with pytest.raises(nav.Refused, match="too few"):
        nav.window_slope([1.0, 2.0], [1.0, 2.0], 0.01)
    with pytest.raises(nav.Refused, match="too few"):
        nav.gyrocompass_printed(good(), 50 * DEG)
    with pytest.raises(ValueError, match="expected arrays of the same length"):
        nav.window_slope([1.0, 2.0, 3.0], [1.0, 2.0], 0.01)


@pytest.mark.parametrize(
    ("step_deg", "warned"), [(30, True), (39, True), (41, False), (90, False), (170, False), (178, True)]
)
def test_a_poor_geometry_is_flagged(step_deg: float, warned: bool) -> None:
    rows = positions(50 * DEG, 0.5, np.arange(3) * step_deg * DEG)
    r = nav.gyrocompass(rows, latitude_rad=50 * DEG, method=Method.CLOSED3)
    step = step_deg * DEG
    assert r.geometry == pytest.approx(abs(4 * math.sin(step / 2) ** 2 * math.sin(step)), rel=1e-3)
    assert (Flag.POOR_GEOMETRY in r.flags) is warned
    assert any("below 40" in w for w in r.warnings) is warned


def test_a_wrong_latitude_is_seen_when_it_is_large() -> None:
    """hypot(s, c) is cos(true)/cos(given): half a degree at 50 deg is 1 %; heading does not suffer."""
    rows = positions(50 * DEG, 0.5, np.arange(3) * 90 * DEG)
    near = nav.gyrocompass(rows, latitude_rad=50.3 * DEG, method=Method.CLOSED3)
    far = nav.gyrocompass(rows, latitude_rad=50.7 * DEG, method=Method.CLOSED3)
    assert Flag.POOR_QUALITY not in near.flags
    assert Flag.POOR_QUALITY in far.flags
    assert far.quality == pytest.approx(math.cos(50 * DEG) / math.cos(50.7 * DEG) - 1, rel=1e-3)
    assert off_deg(far, 0.5) < 0.01
