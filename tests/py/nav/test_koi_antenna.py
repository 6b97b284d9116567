"""An antenna that is not where the unit is: what the filter takes off, and how attitude errors come in."""

from __future__ import annotations

import math

import numpy as np
import pytest
from koi_flight import DT_S, LEGS, Truth, error_between, errors_of, state_of, with_errors
from psabench.native.flight_model import Flight
from psabench.native.koi import Kind, Koi, KoiConfig, Reason, koi_default, koi_layout
from psabench.native.nav import Refused
from psabench.native.strapdown import State

ARM_M = np.array([6.0, -2.0, -3.0])  # ahead, right, down
NEAR_S = 1e-3  # of the differences that make a velocity


@pytest.fixture(scope="module")
def truth() -> Truth:
    """To the end of the first turn in flight."""
    path = Flight(LEGS, heading_deg=30.0)
    return Truth.of(path, 0, path.leg_ns[12] // 10**9 * 10**9)


def config() -> KoiConfig:
    cfg = koi_default()
    cfg.antenna_m[:] = ARM_M
    return cfg


def antenna_at(truth: Truth, t_s: float) -> tuple[State, np.ndarray]:
    """Place and velocity, of the aircraft's alone."""
    s = truth.times(np.array([t_s - NEAR_S, t_s, t_s + NEAR_S]))
    arms = [state_of(s, i).C_nb @ ARM_M for i in range(3)]
    place = with_errors(state_of(s, 1), np.concatenate([arms[1], np.zeros(6)]))
    return place, s.v_enu_mps[1] + (arms[2] - arms[0]) / (2.0 * NEAR_S)


def pushed(truth: Truth, begin: int, cfg: KoiConfig, p: np.ndarray | None = None) -> Koi:
    """Ten seconds from here, of a unit without errors."""
    koi = Koi(cfg, 0.0, truth.state(begin), p=p)
    koi.push(truth.dtheta_rad[begin : begin + 1000], truth.dv_mps[begin : begin + 1000])
    return koi


def quickest(truth: Truth, order: int = 0) -> int:
    """Where the antenna is fastest about the unit, or (1) gains most: ten seconds before it."""
    arm_m = np.diff(np.cross(truth.dtheta_rad, ARM_M)[::10], order, axis=0)
    return 10 * int(np.argmax(np.linalg.norm(arm_m[100:], axis=1)))


@pytest.mark.parametrize(("late_s", "order"), [(0.0, 0), (0.08, 1)])
def test_an_antenna_is_where_the_unit_turns_it(truth: Truth, late_s: float, order: int) -> None:
    begin = quickest(truth, order)
    t_s = (begin + 1000) * DT_S - late_s
    place, v_mps = antenna_at(truth, t_s)
    assert np.linalg.norm(v_mps - truth.times(np.array([t_s])).v_enu_mps[0]) > (0.3 if order else 0.7)
    koi = pushed(truth, begin, config())
    assert koi.take(Kind.POSITION, 10.0 - late_s, [place.lat_rad, place.lon_rad, place.h_m]) is Reason.ACCEPTED
    off_m = koi.state.taken[Kind.POSITION].innovation[:, 0]
    koi = pushed(truth, begin, config())
    assert koi.take(Kind.VELOCITY, 10.0 - late_s, v_mps) is Reason.ACCEPTED
    off_mps = koi.state.taken[Kind.VELOCITY].innovation[:, 0]
    print(f"{np.abs(off_m).max():.4f} m, {np.abs(off_mps).max():.4f} m/s")
    assert np.abs(off_m).max() < 0.01
    assert np.abs(off_mps).max() < 0.01


def test_stops_and_heights_are_the_units(truth: Truth) -> None:
    begin = quickest(truth)
    off = {}
    for known in (False, True):
        koi = pushed(truth, begin, config() if known else koi_default())
        koi.take(Kind.HEIGHT, 10.0, [truth.state(begin + 1000).h_m])
        koi.take(Kind.STOP, 10.0)
        off[known] = [koi.state.taken[kind].innovation for kind in (Kind.HEIGHT, Kind.STOP)]
    assert np.array_equal(off[False], off[True])


@pytest.mark.parametrize(("kind", "first"), [(Kind.POSITION, 0), (Kind.VELOCITY, 3)])
def test_errors_of_attitude_move_the_antenna(truth: Truth, kind: Kind, first: int) -> None:
    """S = H P H' + R with H by central differences of the antenna's place and velocity; an arm of 70 m."""
    cfg, begin, sd = config(), quickest(truth), np.array([0.01, 0.02, 0.03])
    cfg.antenna_m[:] = 10.0 * ARM_M
    p = np.zeros((koi_layout(cfg)["dt"].stop,) * 2)
    p[4:7, 4:7] = np.outer(sd, sd) * (0.5 * np.eye(3) + 0.5)
    koi = pushed(truth, begin, cfg, p)
    at, p = koi.state.hybrid, koi.p
    rate_b = truth.dtheta_rad[begin + 999] / DT_S
    arm = 10.0 * ARM_M if kind is Kind.POSITION else np.cross(rate_b, 10.0 * ARM_M)
    h = np.zeros((3, koi.n))
    for j, row in enumerate(1e-3 * np.eye(9)):
        low, high = (with_errors(at, errors_of(sign * row, at)) for sign in (-1.0, 1.0))
        h[:, j] = (error_between(high, low)[first : first + 3] + (high.C_nb - low.C_nb) @ arm) / 2e-3
    koi.take(kind, 10.0, [at.lat_rad, at.lon_rad, at.h_m] if first == 0 else at.v_n_mps, [0.01] * 3)
    want = np.diag(h @ p @ h.T) + 0.01**2
    assert koi.state.taken[kind].innovation[:, 1] == pytest.approx(want, rel=1e-3)


def test_an_arm_beyond_reason_is_refused() -> None:
    cfg = koi_default()
    cfg.antenna_m[1] = math.inf
    with pytest.raises(Refused, match=r"antenna_m\[1\]"):
        koi_layout(cfg)
