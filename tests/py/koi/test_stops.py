"""When a unit is at rest."""

from __future__ import annotations

import numpy as np
import pytest
from psabench.koi.stops import StopDetector

G = np.array([0.0, 0.0, -0.0981])  # of a sample, m/s


def seconds(rates: list[float], accels: list[float], speeds: list[float]) -> list[bool]:
    d = StopDetector()
    rows = zip(rates, accels, speeds, strict=True)
    return [
        d.take(np.tile([0.0, 0.0, r * 0.01], (100, 1)), np.tile(G + np.array([a * 0.01, 0.0, 0.0]), (100, 1)), 0.01, v)
        for r, a, v in rows
    ]


def test_a_flight_begins_at_rest() -> None:
    assert seconds([0.0] * 3, [0.0] * 3, [0.0] * 3) == [True] * 3


@pytest.mark.parametrize(
    ("rates", "accels", "speeds"),
    [
        ([0.0, 0.01, 0.0, 0.0, 0.0], [0.0] * 5, [0.0] * 5),  # it turns
        ([0.0] * 5, [0.0, 1.0, 1.0, 1.0, 1.0], [0.0] * 5),  # the force changes once
        ([0.0] * 5, [0.0] * 5, [0.0, 3.0, 0.1, 0.1, 0.1]),  # it moves
    ],
)
def test_after_motion_two_quiet_seconds_are_rest(rates: list[float], accels: list[float], speeds: list[float]) -> None:
    assert seconds(rates, accels, speeds) == [True, False, False, True, True]


def test_sway_in_wind_is_rest() -> None:
    """0.05 deg by 2.5 s, about an axis along which gravity does not show it much."""
    sway = [np.radians(0.05) * 2 * np.pi / 2.5 * np.cos(2 * np.pi * t / 2.5) for t in range(20)]
    assert all(seconds(sway, [0.0] * 20, [0.05] * 20))
