"""The strapdown integration against motions in closed form, and against python-ins, a third-party package."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from psabench.errors import BadInput
from psabench.native import strapdown
from psabench.native.strapdown import State, Strapdown
from scipy.spatial.transform import Rotation

Floats = np.ndarray
EARTH_RADPS, A_M, E2 = 7.292115e-5, 6378137.0, 6.69437999014e-3
DT_S = 0.01
NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)


@dataclass(frozen=True)
class Flight:
    """Place and attitude as functions of t, which may be complex: an imaginary step gives exact derivatives."""

    def place(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        lat = math.radians(55.7) + 2e-5 * t + 1e-5 * np.sin(t / 20)
        lon = math.radians(37.5) + 4e-5 * t + 2e-5 * np.cos(t / 15)
        return lat, lon, 1000.0 + 50.0 * np.sin(t / 30)

    def angles(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """Heading, pitch, roll."""
        return (
            1.0 + 0.5 * np.sin(t / 25) + 0.01 * t,
            0.1 * np.sin(t / 7 + 1),
            0.4 * np.sin(t / 11) + 0.01 * np.sin(3 * t),
        )


def matrix(heading: Floats, pitch: Floats, roll: Floats) -> Floats:
    """C_nb, (n, 3, 3), as a product of three turns: about up, right, forward."""
    o, i = np.zeros_like(heading), np.ones_like(heading)

    def stack(rows: list[list[Floats]]) -> Floats:
        return np.stack([np.stack(r, -1) for r in rows], -2)

    c, s = np.cos, np.sin
    yaw = stack([[c(heading), s(heading), o], [-s(heading), c(heading), o], [o, o, i]])
    nose = stack([[i, o, o], [o, c(pitch), -s(pitch)], [o, s(pitch), c(pitch)]])
    bank = stack([[c(roll), o, s(roll)], [o, i, o], [-s(roll), o, c(roll)]])
    return np.asarray(yaw @ nose @ bank)


def slope(f: Callable[[Floats], Floats], t: Floats) -> Floats:
    return np.imag(f(t + 1e-30j)) / 1e-30


def velocity(flight: Flight, t: Floats) -> Floats:
    """East, north, up, (n, 3); complex where t is."""
    lat, _, h = flight.place(t)
    step = 1e-4  # of a central difference of sixth order: t may be complex already
    d = [(f, k) for k, f in ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))]
    lat_dot, lon_dot, h_dot = (
        sum(f * (flight.place(t + k * step)[i] - flight.place(t - k * step)[i]) for f, k in d) / step for i in range(3)
    )
    x = 1 - E2 * np.sin(lat) ** 2
    vertical, meridian = A_M / np.sqrt(x), A_M * (1 - E2) / x**1.5
    return np.stack([lon_dot * (vertical + h) * np.cos(lat), lat_dot * (meridian + h), h_dot], -1)


def gravity(lat: Floats, h: Floats) -> Floats:
    s2 = np.sin(lat) ** 2
    return np.asarray(9.7803253359 * (1 + 1.931852652458e-3 * s2) / np.sqrt(1 - E2 * s2) * (1 - 2 * h / A_M))


def felt(flight: Flight, t: Floats) -> tuple[Floats, Floats]:
    """Rate in inertial space and specific force in b, (n, 3) each, by the equations of motion in n."""
    lat, _, h = (np.real(x) for x in flight.place(t))
    v, C = velocity(flight, t), matrix(*flight.angles(t))
    x = 1 - E2 * np.sin(lat) ** 2
    vertical, meridian = A_M / np.sqrt(x) + h, A_M * (1 - E2) / x**1.5 + h
    u = np.stack([0 * lat, EARTH_RADPS * np.cos(lat), EARTH_RADPS * np.sin(lat)], -1)
    rho = np.stack([-v[:, 1] / meridian, v[:, 0] / vertical, v[:, 0] / vertical * np.tan(lat)], -1)
    force = slope(lambda z: velocity(flight, z), t) + np.cross(2 * u + rho, v)
    force[:, 2] += gravity(lat, h)
    turn = np.swapaxes(C, 1, 2) @ slope(lambda z: matrix(*flight.angles(z)), t)  # [w_nb x] in b
    w_nb = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], -1)
    to_b = np.swapaxes(C, 1, 2)
    return w_nb + np.einsum("nij,nj->ni", to_b, u + rho), np.einsum("nij,nj->ni", to_b, force)


def increments(flight: Flight, first_s: float, n: int) -> tuple[Floats, Floats]:
    """Integrals over n intervals by Gauss and Legendre, (n, 3) each."""
    middle = first_s + DT_S * (np.arange(n) + 0.5)
    angle, speed = np.zeros((n, 3)), np.zeros((n, 3))
    for node, weight in zip(NODES, WEIGHTS, strict=True):
        w, f = felt(flight, middle + node * DT_S / 2)
        angle += weight * w * DT_S / 2
        speed += weight * f * DT_S / 2
    return angle, speed


def state(flight: Flight, t_s: float) -> State:
    t = np.array([t_s])
    lat, lon, h = (float(x[0]) for x in flight.place(t))
    return State(lat_rad=lat, lon_rad=lon, h_m=h, v_n_mps=velocity(flight, t)[0], C_nb=matrix(*flight.angles(t))[0])


def test_a_flight_in_closed_form_comes_back() -> None:
    """Ten minutes of turns and climbs at 200 m/s with a vibration of the bank."""
    flight, n = Flight(), 60_000
    unit = Strapdown(state(flight, 0.0))
    unit.advance(*increments(flight, 0.0, n), DT_S)
    found, true = unit.state, state(flight, n * DT_S)
    assert abs(found.lat_rad - true.lat_rad) * A_M < 0.05
    assert abs(found.lon_rad - true.lon_rad) * A_M * math.cos(true.lat_rad) < 0.05
    assert abs(found.h_m - true.h_m) < 0.05
    assert np.abs(found.v_n_mps - true.v_n_mps).max() < 3e-4
    assert Rotation.from_matrix(found.C_nb @ true.C_nb.T).magnitude() < 1e-7


def test_a_unit_at_rest_stays_for_an_hour() -> None:
    lat, h, n = math.radians(-33.0), 500.0, 360_000
    C = strapdown.dcm(2.0, 0.3, -0.7)
    u = EARTH_RADPS * np.array([0.0, math.cos(lat), math.sin(lat)])
    angle = np.tile(C.T @ u * DT_S, (n, 1))
    speed = np.tile(C.T @ [0.0, 0.0, strapdown.gravity_mps2(lat, h)] * DT_S, (n, 1))
    unit = Strapdown(State(lat_rad=lat, lon_rad=3.0, h_m=h, v_n_mps=np.zeros(3), C_nb=C), height_fixed=True)
    path = unit.advance(angle, speed, DT_S)
    assert np.abs(path[:, 0] - lat).max() * A_M < 1e-4
    assert np.abs(path[:, 1] - 3.0).max() * A_M < 1e-4
    assert np.abs(path[:, 3:6]).max() < 1e-7
    assert np.abs(path[-1, 6:].reshape(3, 3) - C).max() < 1e-10


@pytest.mark.parametrize("height_fixed", [True, False])
def test_python_ins_goes_the_same_way_for_an_hour(height_fixed: bool) -> None:
    """On the same raw increments with the same formula of coning; limits 1 mm and 1e-6 m/s in the horizontal channel.

    With the free vertical channel, both differ by the digits of the ellipsoid's constants, which it makes grow.
    """
    import pandas as pd
    from pyins import strapdown as other  # type: ignore[import-untyped]

    n = 360_000
    t = DT_S * np.arange(n + 1)
    turn = np.stack([0.3 * np.sin(0.9 * t), 0.2 * np.sin(1.3 * t + 1), 0.1 * np.sin(0.1 * t)], -1) * DT_S
    push = np.stack([0.5 * np.sin(0.6 * t), 0.3 * np.cos(0.5 * t), 9.81 + 0.2 * np.sin(2 * t)], -1) * DT_S
    to_other = np.array(
        [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]
    )  # right, forward, up: forward, right, down
    names = [f"{s}_{a}" for s in ("gyro", "accel") for a in "xyz"]
    imu = pd.DataFrame(np.hstack([turn @ to_other.T, push @ to_other.T]), index=t, columns=names)
    names_of_theirs = ["lat", "lon", "alt", "VN", "VE", "VD", "roll", "pitch", "heading"]
    began = pd.Series([55.7, 37.5, 150.0, 30.0, -20.0, 0.0, 3.0, -5.0, 77.0], names_of_theirs)
    theirs = other.Integrator(began, with_altitude=not height_fixed)
    seen = theirs.integrate(other.compute_increments_from_imu(imu, "increment")).iloc[-n:]
    C = strapdown.dcm(*np.radians([77.0, -5.0, 3.0]))
    lat, lon = np.radians([55.7, 37.5])
    unit = Strapdown(
        State(lat_rad=lat, lon_rad=lon, h_m=150.0, v_n_mps=np.array([-20.0, 30.0, 0.0]), C_nb=C),
        height_fixed=height_fixed,
    )
    unit._at.dtheta_rad[:], unit._at.dv_mps[:] = turn[0], push[0]  # the interval before, which theirs knows
    path = unit.advance(turn[1:], push[1:], DT_S)
    metres = np.abs(np.degrees(path[:, :2]) - seen[["lat", "lon"]].to_numpy()).max() * 111_320
    speed = np.abs(path[:, [4, 3]] - seen[["VN", "VE"]].to_numpy()).max()
    print(f"{metres:.2e} m, {speed:.2e} m/s")
    assert metres < (1e-3 if height_fixed else 0.1)
    assert speed < (1e-6 if height_fixed else 1e-3)


def test_calls_of_one_interval_are_one_call_of_all() -> None:
    flight = Flight()
    angle, speed = increments(flight, 5.0, 50)
    whole, steps = Strapdown(state(flight, 5.0)), Strapdown(state(flight, 5.0))
    path = whole.advance(angle, speed, DT_S)
    rows = [steps.advance(angle[i : i + 1], speed[i : i + 1], DT_S)[0] for i in range(50)]
    assert np.array_equal(path, np.array(rows))
    assert np.array_equal(whole.state.row(), path[-1])


def test_coning_and_sculling_need_the_interval_before() -> None:
    """A coning motion of 0.1 rad at 5 Hz drifts about its axis unless neighbours are crossed."""

    def at(t: Floats) -> Rotation:
        return Rotation.from_rotvec(np.stack([0.1 * np.cos(10 * np.pi * t), 0.1 * np.sin(10 * np.pi * t), 0 * t], -1))

    n, fine = 1000, 64
    t = np.arange(n * fine + 1) * DT_S / fine
    small = (at(t[:-1]).inv() * at(t[1:])).as_rotvec()  # integral of the rate, but for a part of 1e-7 of coning
    angle = small.reshape(n, fine, 3).sum(axis=1)
    u = np.array([0.0, EARTH_RADPS, 0.0])  # on the equator
    for i, C in enumerate(at(t[:-1:fine]).as_matrix()):
        angle[i] += C.T @ u * DT_S
    speed = np.zeros((n, 3))
    begin = State(lat_rad=0.0, lon_rad=0.0, h_m=0.0, v_n_mps=np.zeros(3), C_nb=at(t[:1]).as_matrix()[0])

    def drift_rad(parts: int) -> float:
        """Of as many integrations, each of which begins without what was before."""
        here = begin
        for part in np.array_split(np.arange(n), parts):
            unit = Strapdown(here, height_fixed=True)
            unit.advance(angle[part], speed[part], DT_S)
            here = unit.state
        return float(Rotation.from_matrix(here.C_nb @ at(t[-1:]).as_matrix()[0].T).magnitude())

    assert drift_rad(1) < 0.03 * drift_rad(n)  # what the formula leaves at 0.3 rad of the motion an interval


@pytest.mark.parametrize(
    ("lat_deg", "gravity_mps2", "meridian_m", "vertical_m"),
    [(0.0, 9.7803253359, 6335439.3273, 6378137.0), (90.0, 9.8321849378, 6399593.6258, 6399593.6258)],
)
def test_the_ellipsoid_is_that_of_wgs_84(
    lat_deg: float, gravity_mps2: float, meridian_m: float, vertical_m: float
) -> None:
    """NIMA TR8350.2, tables 3.3 and 3.4."""
    assert strapdown.gravity_mps2(math.radians(lat_deg), 0.0) == pytest.approx(gravity_mps2, abs=2e-10)
    assert strapdown.radii_m(math.radians(lat_deg), 0.0) == pytest.approx((meridian_m, vertical_m), abs=1e-3)


def test_angles_of_a_matrix_are_those_it_was_made_of() -> None:
    east = strapdown.dcm(math.pi / 2, 0.0, 0.0)
    assert east[:, 1] == pytest.approx([1.0, 0.0, 0.0])  # forward
    assert strapdown.dcm(0.0, 0.2, 0.0)[2, 1] > 0.0  # the nose is up
    assert strapdown.dcm(0.0, 0.0, 0.2)[2, 0] < 0.0  # the right wing is down
    rng = np.random.default_rng(4)
    for angles in rng.uniform((-math.pi, -1.5, -math.pi), (math.pi, 1.5, math.pi), (100, 3)):
        C = strapdown.dcm(*angles)
        assert pytest.approx(matrix(*(np.array([x]) for x in angles))[0], abs=1e-14) == C
        assert strapdown.angles_rad(C) == pytest.approx(tuple(angles), abs=1e-12)


@pytest.mark.parametrize(
    ("change", "dt_s", "said"),
    [
        ({}, 0.0, "expected an interval above 0, up to 1 s, got 0.0"),
        ({}, math.nan, "expected an interval above 0, up to 1 s, got nan"),
        ({"lat_rad": 1.57}, DT_S, "interval 0 of 3: expected a latitude within 89.9 deg"),
        ({"h_m": math.inf}, DT_S, "expected finite numbers"),
    ],
)
def test_a_bad_start_is_refused(change: dict[str, float], dt_s: float, said: str) -> None:
    good = state(Flight(), 0.0)
    fields = {k: getattr(good, k) for k in State.__slots__} | change
    unit = Strapdown(State(**fields))
    before = unit.state.row()
    with pytest.raises(BadInput, match=said):
        unit.advance(*increments(Flight(), 0.0, 3), dt_s)
    assert np.array_equal(unit.state.row(), before, equal_nan=True)


def test_a_bad_interval_is_named_and_nothing_has_moved() -> None:
    flight = Flight()
    angle, speed = increments(flight, 0.0, 20)
    speed[7, 1] = math.nan
    unit = Strapdown(state(flight, 0.0))
    before = unit.state.row()
    with pytest.raises(BadInput, match="interval 7 of 20: expected finite numbers"):
        unit.advance(angle, speed, DT_S)
    assert np.array_equal(unit.state.row(), before)
    with pytest.raises(BadInput, match=r"expected increments of shapes \(n, 3\) and \(n, 3\)"):
        unit.advance(angle[:, :2], speed, DT_S)
