"""An hour's flight of emu/phys/flight from its exact increments closes by python-ins, a third-party package."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from psabench.native.flight_model import Flight
from pyins import earth, strapdown  # type: ignore[import-untyped]
from pyins.util import ACCEL_COLS, GYRO_COLS, TRAJECTORY_COLS  # type: ignore[import-untyped]

ROOT = Path(__file__).resolve().parents[3]
HOUR_NS = 3600 * 10**9
STEP_NS = 2_500_000
TAKEOFF = 13  # leg of the scenario
A_M = 6378137.0


@pytest.fixture(scope="module")
def scenario() -> Flight:
    """The legs of proto/scenarios/flight.yaml."""
    dump = subprocess.run([ROOT / "build/psa-emu", "flight", "--dump"], capture_output=True, check=True, text=True)
    resolved = json.loads(dump.stdout)["flight"]
    return Flight(resolved["legs"], heading_deg=resolved["heading_deg"])


def pva(path: Flight, t_ns: int) -> pd.Series:
    """The true state in python-ins' units: degrees, north-east-down."""
    s = path.states(np.array([t_ns]))
    east, north, up = s.v_enu_mps[0]
    angles = np.degrees([s.roll_rad[0], s.pitch_rad[0], s.heading_rad[0]])
    place = [np.degrees(s.lat_rad[0]), np.degrees(s.lon_rad[0]), s.h_m[0]]
    return pd.Series([*place, north, east, -up, *angles], index=TRAJECTORY_COLS)


def increments(path: Flight, from_ns: int) -> tuple[np.ndarray, np.ndarray]:
    """Of the hour and ten milliseconds before it, STEP_NS each.

    python-ins has gravity linear in height: what it lacks is added."""
    n = (HOUR_NS + 4 * STEP_NS) // STEP_NS
    begin_ns = from_ns - 4 * STEP_NS
    angle, speed = path.increments(begin_ns, STEP_NS, n)
    middle = path.states(begin_ns + np.arange(n) * STEP_NS + STEP_NS // 2)
    less = earth.gravity(np.degrees(middle.lat_rad), middle.h_m) - middle.g_mps2
    return angle, speed - middle.C_nb[:, 2, :] * (less * STEP_NS / 1e9)[:, None]


def navigated(start: pd.Series, angle: np.ndarray, speed: np.ndarray, steps: int) -> pd.Series:
    """Where python-ins ends from the sums of so many increments, the first of which lies before the start."""
    sums = np.hstack([angle, speed])[4 - steps :].reshape(-1, steps, 6).sum(axis=1)
    times_s = np.arange(len(sums)) * (steps * STEP_NS / 1e9)
    found = strapdown.Integrator(start)
    imu = pd.DataFrame(sums, index=times_s, columns=GYRO_COLS + ACCEL_COLS)
    found.integrate(strapdown.compute_increments_from_imu(imu, "increment"))
    return found.get_pva()


def miss(found: pd.Series, true: pd.Series) -> np.ndarray:
    """North, east, up, m; north, east, down, m/s; roll, pitch, heading, deg."""
    off = (found - true).to_numpy(copy=True)
    off[0] = np.radians(off[0]) * A_M
    off[1] = np.radians(off[1]) * A_M * np.cos(np.radians(true.lat))
    return np.asarray(off)


def test_an_hour_from_take_off_closes(scenario: Flight) -> None:
    """python-ins takes velocity and place of the beginning of an interval: its error is of first order in it and grows
    exponentially along the vertical. Two intervals give the limit."""
    from_ns = scenario.leg_ns[TAKEOFF]
    start, true = pva(scenario, from_ns), pva(scenario, from_ns + HOUR_NS)
    angle, speed = increments(scenario, from_ns)
    half, five, ten = (miss(navigated(start, angle, speed, steps), true) for steps in (1, 2, 4))
    assert np.abs(ten[:2]).max() < 1.0, ten
    assert np.abs(ten[3:5]).max() < 1e-3, ten
    limit = 2.0 * half - five
    print(f"10 ms: {ten}, limit: {limit}")
    assert np.abs(limit[:3]).max() < 1.0, limit
    assert np.abs(limit[3:6]).max() < 1e-3, limit
    assert np.abs(limit[6:]).max() * 3600.0 < 0.01, limit


def test_the_flight_is_as_described(scenario: Flight) -> None:
    """Ten minutes parked, an hour in the air, at rest again."""
    assert scenario.leg_ns[1] == 600 * 10**9
    path = scenario.states(np.arange(0, scenario.end_ns, 10**9))
    assert 3600 <= np.count_nonzero(path.h_m > 150.0) <= 3900
    assert np.hypot(path.v_enu_mps[:, 0], path.v_enu_mps[:, 1]).max() == pytest.approx(210.0, abs=1e-6)
    assert path.h_m.max() == pytest.approx(6150.0, abs=1e-6)
    end = scenario.states(np.array([scenario.end_ns]))
    assert np.abs(end.v_enu_mps).max() < 1e-9
    assert end.h_m[0] == pytest.approx(150.0, abs=1e-6)
