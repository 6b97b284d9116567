"""Recordings that are wrong in one way each, and good ones: what is said of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from psabench.sins.data_check import findings, signed_axes
from psabench.sins.increments import Increments
from scipy.spatial.transform import Rotation

DT_S, G_MPS2 = 0.01, 9.81


def recording(noise: float = 1.0, turn_dps: float = 10.0) -> Increments:
    """Rest of 2 s, turn of 9 s about x, which points north, rest; seed 5."""
    n, rng = 1300, np.random.default_rng(5)
    rate = np.zeros((n, 3))
    rate[200:1100, 0] = np.radians(turn_dps)
    turned = Rotation.from_rotvec(np.cumsum(rate * DT_S, axis=0))
    force = (turned.inv() * Rotation.from_euler("y", 5, degrees=True)).apply([0.0, 0.0, G_MPS2])
    return Increments(
        end_s=np.asarray(DT_S * np.arange(1, n + 1), np.float64),
        dt_s=DT_S,
        dtheta_rad=(rate + noise * rng.normal(0, 1e-6, (n, 3))) * DT_S,
        dv_mps=(force + noise * rng.normal(0, 1e-3, (n, 3))) * DT_S,
    )


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_nothing_is_said_of_a_good_recording(noise: float) -> None:
    assert findings(recording(noise)) == []


def test_a_stuck_and_a_saturated_channel_are_named() -> None:
    good = recording()
    stuck = good.dtheta_rad.copy()
    stuck[500:700, 1] = stuck[500, 1]
    assert findings(replace(good, dtheta_rad=stuck)) == ["gyro y sticks for 2.00 s from 5.01 s on"]
    limited = np.clip(good.dv_mps, -0.5 * G_MPS2 * DT_S, 0.5 * G_MPS2 * DT_S)
    said = findings(replace(good, dv_mps=limited))
    assert any(s.startswith("accelerometer z is at its limit for ") and s.endswith("saturated") for s in said)
    gyros = np.clip(good.dtheta_rad, -np.radians(9.0) * DT_S, np.radians(9.0) * DT_S)
    said = findings(replace(good, dtheta_rad=gyros))
    assert said[0] == "gyro x is at its limit for 900 intervals, the first at 2.01 s: saturated"
    assert findings(replace(good, dv_mps=0.0 * good.dv_mps)) == [
        "the accelerometers show less than 1 m/s^2: no gravity"
    ]


def counted(x: np.ndarray, quantum: float) -> np.ndarray:
    return np.asarray(np.floor(x / quantum) * quantum, np.float64)


def test_counts_with_noise_of_one_count_name_the_channel_as_well() -> None:
    """A quarter of the neighbours are equal; of a tenth of that noise nearly all are, and nothing is said."""
    good = recording()
    quantum = 1e-8  # 0.002 arcsec; the noise of an increment
    counts = counted(good.dtheta_rad, quantum)
    equal = np.mean(np.diff(counts[:, 1]) == 0.0)
    assert 0.2 < equal < 0.35
    assert findings(replace(good, dtheta_rad=counts)) == []
    stuck = counts.copy()
    stuck[500:700, 1] = 0.0
    assert findings(replace(good, dtheta_rad=stuck)) == ["gyro y sticks for 2.00 s from 5.01 s on"]
    limit = np.radians(9.0) * DT_S
    limited = counted(np.clip(good.dtheta_rad, -limit, limit), quantum)
    assert findings(replace(good, dtheta_rad=limited))[0] == (
        "gyro x is at its limit for 900 intervals, the first at 2.01 s: saturated"
    )
    coarse = counted(recording(noise=0.1).dtheta_rad + 0.5 * quantum, quantum)  # between two steps
    coarse[500:700, 1] = 0.0
    assert findings(replace(good, dtheta_rad=coarse)) == []


def long_recording(theta: np.ndarray) -> Increments:
    """Half a cycle of 4500 deg about x and a turn about y, of a unit with errors of scale and misalignment."""
    n, rng = 46_800, np.random.default_rng(6)
    rate = np.zeros((n, 3))
    rate[200:45_200, 0], rate[45_400:46_300, 1] = np.radians(10.0), np.radians(10.0)
    steps = Rotation.from_rotvec(rate * DT_S)
    force, at = np.empty((n, 3)), Rotation.identity()
    for k, step in enumerate(steps):
        at = at * step
        force[k] = at.inv().apply([0.0, 0.0, G_MPS2])
    noise = rng.normal(0, 1e-6, (n, 3)), rng.normal(0, 1e-3, (n, 3))
    return Increments(
        end_s=np.asarray(DT_S * np.arange(1, n + 1), np.float64),
        dt_s=DT_S,
        dtheta_rad=(rate @ (np.eye(3) + theta).T + noise[0]) * DT_S,
        dv_mps=(force + noise[1]) * DT_S,
    )


def test_a_unit_with_three_times_the_usual_errors_is_no_fault_and_swapped_axes_are() -> None:
    data = long_recording(np.full((3, 3), 3e-3))
    assert findings(data) == []
    (said,) = findings(replace(data, dv_mps=data.dv_mps[:, [1, 0, 2]]))
    assert "axes in another order; as " in said


def test_a_unit_that_does_not_turn() -> None:
    said = findings(recording(turn_dps=0.0))
    assert [f[:24] for f in said] == ["the unit does not turn: "]


@pytest.mark.parametrize("name", [name for name, _ in signed_axes()][1::5])
def test_another_order_of_axes_is_found_with_the_right_one(name: str) -> None:
    """Where a recording cannot tell two orders apart, one of those that agree is named: it turns the force back."""
    good, wrong = recording(), dict(signed_axes())[name]
    (said,) = findings(replace(good, dv_mps=good.dv_mps @ wrong.T))
    named = said.split("; as ")[1].split(" of ")[0]
    repaired = replace(good, dv_mps=good.dv_mps @ wrong.T @ dict(signed_axes())[named].T)
    assert findings(repaired) == []


def test_a_unit_that_is_carried_about_is_no_calibration() -> None:
    good = recording()
    pushed = good.dv_mps.copy()
    pushed[600:, 1] += 3.0 * DT_S
    (said,) = findings(replace(good, dv_mps=pushed))
    assert "does not rest on a table" in said
