"""The world and the instruments of emu/phys against models written here, which share nothing with them.

Published figures: WGS 84 from NIMA TR8350.2, GRS 80 from Moritz (2000); docs/sources.md 5.1.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import physics
import pytest
from physics import FIXED, HEAD, TABLE, Array, Lab, doubles, ns

ARCSEC = math.radians(1 / 3600)
EARTH_RADPS = 7.292115e-5


@pytest.fixture(scope="module")
def lib(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    return physics.build(tmp_path_factory.mktemp("physics"))


# ---- gravity


@dataclass(frozen=True)
class Ellipsoid:
    """Level ellipsoid: semi-major axis m, flattening, GM m^3/s^2, rate rad/s."""

    a: float
    f: float
    gm: float
    w: float

    def gravity(self, latitude_rad: float, height_m: float) -> float:
        """Closed form in ellipsoidal coordinates (Heiskanen and Moritz, 2-7 and 2-8), from the four constants alone."""
        b = self.a * (1 - self.f)
        e2 = 1 - (b / self.a) ** 2
        big_e = math.sqrt(self.a**2 - b**2)
        n = self.a / math.sqrt(1 - e2 * math.sin(latitude_rad) ** 2)
        r, z = (n + height_m) * math.cos(latitude_rad), (n * (1 - e2) + height_m) * math.sin(latitude_rad)
        rest = r * r + z * z - big_e**2
        u = math.sqrt(0.5 * rest * (1 + math.sqrt(1 + 4 * big_e**2 * z * z / rest**2)))
        v = math.hypot(u, big_e)
        beta = math.atan2(z * v, u * r)
        sin, cos = math.sin(beta), math.cos(beta)

        def q(u: float) -> float:
            return 0.5 * ((1 + 3 * u * u / big_e**2) * math.atan(big_e / u) - 3 * u / big_e)

        q1 = 3 * (1 + u * u / big_e**2) * (1 - u / big_e * math.atan(big_e / u)) - 1
        wide = math.sqrt((u * u + big_e**2 * sin**2) / (v * v))
        spin = (self.w * self.a) ** 2
        along_u = -(self.gm / v**2 + spin * big_e / v**2 * q1 / q(b) * (0.5 * sin**2 - 1 / 6) - self.w**2 * u * cos**2)
        along_beta = (spin / v * q(u) / q(b) - self.w**2 * v) * sin * cos
        return math.hypot(along_u, along_beta) / wide


WGS84 = Ellipsoid(6378137.0, 1 / 298.257223563, 3986004.418e8, 7292115e-11)
GRS80 = Ellipsoid(6378137.0, 1 / 298.257222101, 3986005e8, 7292115e-11)


@pytest.mark.parametrize(
    ("ellipsoid", "latitude_deg", "printed"),
    [
        (GRS80, 0, 9.7803267715),
        (GRS80, 45, 9.806199203),
        (GRS80, 90, 9.8321863685),
        (WGS84, 0, 9.7803253359),
        (WGS84, 90, 9.8321849378),
    ],
)
def test_closed_form_gives_the_published_gravity(ellipsoid: Ellipsoid, latitude_deg: float, printed: float) -> None:
    assert ellipsoid.gravity(math.radians(latitude_deg), 0) == pytest.approx(printed, abs=6e-10)


@pytest.mark.parametrize("latitude_deg", [0, 30, 45, 60, 90])
def test_gravity_is_the_published_one_at_five_latitudes(lib: ctypes.CDLL, latitude_deg: float) -> None:
    latitude = math.radians(latitude_deg)
    for height_m in (-400, 0, 200, 1000, 3000, 8000):
        want = WGS84.gravity(latitude, height_m)
        assert lib.bridge_gravity(latitude, height_m) == pytest.approx(want, rel=1e-10), height_m
    printed = 9.7803253359 * (1 + 0.00193185265241 * math.sin(latitude) ** 2)  # Somigliana, TR8350.2 (4-1)
    printed /= math.sqrt(1 - 0.00669437999014 * math.sin(latitude) ** 2)
    assert lib.bridge_gravity(latitude, 0.0) == pytest.approx(printed, rel=1e-10)
    assert lib.bridge_gravity(-latitude, 500) == lib.bridge_gravity(latitude, 500)


# ---- the Earth's rate


@pytest.mark.parametrize(("latitude_deg", "azimuth_deg"), [(55.7, 0), (50.45, 30), (-33, 200), (0, 90), (90, 10)])
def test_a_gyro_at_rest_reads_the_earths_rate(lib: ctypes.CDLL, latitude_deg: float, azimuth_deg: float) -> None:
    latitude, azimuth = math.radians(latitude_deg), math.radians(azimuth_deg)
    lab = Lab(lib, latitude_rad=latitude, azimuth_rad=azimuth, axes=[[2], [1], [0]])
    north = [math.cos(azimuth), -math.sin(azimuth), 0]  # in the bench's axes: x ahead, y right, z down
    want = 15.041067 * (math.cos(latitude) * np.array(north) - math.sin(latitude) * np.array([0, 0, 1]))
    for on in (FIXED, TABLE):
        _, w = lab.kinematics(on, 1.0)
        assert np.degrees(w) * 3600 == pytest.approx(want, abs=1e-6)
    _, w = lab.kinematics(HEAD, 1.0)  # x ahead, y up, z to the right
    assert np.degrees(w) * 3600 == pytest.approx([want[0], -want[2], want[1]], abs=1e-6)


# ---- rotations of our own


def turn(axis: int, angle_rad: float) -> Array:
    """Rotation by Rodrigues' formula about a unit vector: coordinates in the turned frame to the frame before."""
    k = np.zeros((3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    k[j, i], k[i, j] = 1, -1
    out: Array = np.eye(3) + math.sin(angle_rad) * k + (1 - math.cos(angle_rad)) * (k @ k)
    return out


# along, nonorthogonality, wobble, order, phase
AXES = [[2, 0, 40, 1, 20], [1, 100, 60, 2, 0], [0, -250, 90, 3, 75]]
LATITUDE, AZIMUTH = math.radians(55.7), math.radians(25)


def moving_lab(lib: ctypes.CDLL) -> Lab:
    """Three axes with all their errors, each in another mode."""
    lab = Lab(lib, latitude_rad=LATITUDE, azimuth_rad=AZIMUTH, axes=AXES, tilt_arcsec=(30, -50), turn_s=2.0)
    assert lib.bridge_rate(lab.lab, 0, 90.0, 0) == 0
    assert lib.bridge_sine(lab.lab, 1, 20.0, 0.5, 0) == 0
    assert lib.bridge_position(lab.lab, 2, 3600.0, 120.0, 0) == 0
    return lab


def own_attitude(lab: Lab, t_s: float) -> Array:
    """C_nt from the angles alone, errors included: wobble tilts the axis about the two that follow it in x, y, z, x."""
    c = turn(2, AZIMUTH) @ turn(0, 30 * ARCSEC) @ turn(1, -50 * ARCSEC)
    for i, (along, square, wobble, order, phase_deg) in enumerate(AXES):
        angle = lab.axis(i, t_s)[0]
        if i:
            c = c @ turn(int(3 - along - AXES[i - 1][0]), square * ARCSEC)
        phase = order * angle + math.radians(phase_deg)
        c = c @ turn((int(along) + 1) % 3, wobble * ARCSEC * math.cos(phase))
        c = c @ turn((int(along) + 2) % 3, wobble * ARCSEC * math.sin(phase))
        c = c @ turn(int(along), angle)
    return c


def test_attitude_is_the_product_of_its_turns(lib: ctypes.CDLL) -> None:
    lab = moving_lab(lib)
    for t_s in (0.0, 0.3, 1.7, 5.0, 12.34):
        assert lab.attitude(t_s) == pytest.approx(own_attitude(lab, t_s), abs=1e-14)


def earth(t_s: float) -> Array:
    """C_in: north-east-down at t against the one at 0."""
    axis = np.array([math.cos(LATITUDE), 0, -math.sin(LATITUDE)])
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    angle = EARTH_RADPS * t_s
    out: Array = np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * (k @ k)
    return out


def numerical_feel(attitude: Callable[[float], Array], g: float, r: Array, t_s: float) -> tuple[Array, Array]:
    """f and w from attitudes C_nb alone, by central differences of six points in inertial space."""
    h = 2e-3
    steps = range(-3, 4)
    c = [earth(t_s + k * h) @ attitude(t_s + k * h) for k in steps]
    second = np.array([2, -27, 270, -490, 270, -27, 2]) / (180 * h * h)
    first = np.array([-1, 9, -45, 0, 45, -9, 1]) / (60 * h)
    acceleration = sum(w * (m @ r) for w, m in zip(second, c, strict=True))
    dc = sum(w * m for w, m in zip(first, c, strict=True))
    spin = c[3].T @ dc
    down = earth(t_s) @ np.array([0.0, 0.0, 1.0])
    return c[3].T @ (acceleration - g * down), np.array([spin[2, 1], spin[0, 2], spin[1, 0]])


@pytest.mark.parametrize("t_s", [0.111, 1.4, 4.9, 7.7, 20.0])
def test_table_kinematics_and_lever_arm_by_numerical_differentiation(lib: ctypes.CDLL, t_s: float) -> None:
    lab = moving_lab(lib)
    lever, at, askew = np.array([0.11, -0.07, 0.2]), np.array([0.03, 0.02, -0.015]), [0.01, -0.02, 0.005]
    c_tb = turn(0, askew[0]) @ turn(1, askew[1]) @ turn(2, askew[2])
    f, w = numerical_feel(lambda t: own_attitude(lab, t), lab.g_mps2, lever + c_tb @ at, t_s)
    got_f, got_w = lab.kinematics(TABLE, t_s, lever_m=lever.tolist(), askew_rad=askew, at_m=at.tolist())
    assert got_w == pytest.approx(c_tb.T @ w, abs=2e-9)
    assert got_f == pytest.approx(c_tb.T @ f, abs=2e-6)
    assert float(np.linalg.norm(f)) > lab.g_mps2 * 0.5  # something is measured at all
    assert float(np.abs(np.linalg.norm(f) - lab.g_mps2)) > 1e-3  # and the lever arm is in it


@pytest.mark.parametrize("face", [0, 1, 2, 3])
@pytest.mark.parametrize("t_s", [0.25, 1.1, 1.9, 3.0])
def test_head_and_lever_arm_by_numerical_differentiation(lib: ctypes.CDLL, t_s: float, face: int) -> None:
    lab = Lab(lib, latitude_rad=LATITUDE, azimuth_rad=AZIMUTH, turn_s=2.0)
    lib.bridge_head(lab.lab, 150.0, face, 0)
    quarter = (0, 2, -1, 1)[face]

    def attitude(t: float) -> Array:
        x = min(max(t / 2.0, 0.0), 1.0)
        angle = math.radians(150) * x * x * (3 - 2 * x)
        return turn(2, AZIMUTH) @ turn(0, -math.pi / 2) @ turn(2, angle)

    c_mb = turn(0, quarter * math.pi / 2)
    lever, at = np.array([0.05, 0.12, -0.03]), np.array([0.01, -0.02, 0.03])
    f, w = numerical_feel(attitude, lab.g_mps2, lever + c_mb @ at, t_s)
    got_f, got_w = lab.kinematics(HEAD, t_s, lever_m=lever.tolist(), at_m=at.tolist())
    assert got_w == pytest.approx(c_mb.T @ w, abs=2e-9)
    assert got_f == pytest.approx(c_mb.T @ f, abs=2e-7)


# ---- six positions

SIX = {  # angles of the axes z, y, x, deg -> the unit's axis that points down, and its sense
    (0, 90, 0): (0, -1),
    (0, -90, 0): (0, 1),
    (0, 0, 90): (1, 1),
    (0, 0, -90): (1, -1),
    (0, 0, 0): (2, 1),
    (0, 180, 0): (2, -1),
}


def test_six_positions_close(lib: ctypes.CDLL) -> None:
    lab = Lab(lib, latitude_rad=LATITUDE, azimuth_rad=0.3, axes=[[2], [1], [0]])
    u0_v, k = 2.5, [0.1, 0.001, -0.0007]
    volts: dict[tuple[int, int], float] = {}
    felt = []
    for i, (angles, which) in enumerate(SIX.items()):
        t_s = 100.0 * i
        for axis, deg in enumerate(angles):
            assert lib.bridge_position(lab.lab, axis, float(deg), 0.0, ns(t_s)) == 0
        f, w = lab.kinematics(TABLE, t_s + 99)
        want = np.zeros(3)
        want[which[0]] = -which[1] * lab.g_mps2
        assert f == pytest.approx(want, abs=1e-12)
        volts[which] = lab.accelerometer_v(TABLE, t_s + 99, u0_v, k)
        felt.append((f, w))
    assert sum(f for f, _ in felt) == pytest.approx(np.zeros(3), abs=1e-12)
    for axis in range(3):
        up, down = volts[(axis, -1)], volts[(axis, 1)]
        assert (down + up) / 2 == pytest.approx(u0_v, abs=1e-15)
        assert (down - up) / (2 * lab.g_mps2) == pytest.approx(k[axis], rel=1e-12)
    assert sum(volts.values()) == pytest.approx(6 * u0_v, rel=1e-15)
    for _, w in felt:
        assert float(np.linalg.norm(w)) == pytest.approx(EARTH_RADPS, rel=1e-12)


# ---- a profile of the calibration article: +10 deg/s for half a cycle, then -10 deg/s


def test_a_cycle_of_the_article_comes_back(lib: ctypes.CDLL) -> None:
    lab = Lab(lib, axes=[[0]])
    times, rates = doubles([0, 450, 900]), doubles([10, -10, 0])
    assert lib.bridge_profile(lab.lab, 0, times, rates, 3, 0) == 0
    ramp = 10 / 400  # the default axis: 400 deg/s^2
    angle, rate, _ = np.degrees(lab.axis(0, 450.0))
    assert (angle, rate) == (pytest.approx(10 * (450 - ramp / 2)), pytest.approx(10))
    angle, rate, _ = np.degrees(lab.axis(0, 1000.0))
    assert rate == 0
    assert angle == pytest.approx(10 * (450 - ramp / 2) - 10 * (450 - ramp) + 10 * ramp / 2, abs=1e-9)


def test_readout_noise_delay_and_zero(lib: ctypes.CDLL) -> None:
    row = [2.0, 0, 0, 0, 0, 0, 0, 5.0, 0.0, 0.05, 36.0]  # 5" rms, no steps, 50 ms late, zero 36"
    lab = Lab(lib, axes=[row])
    assert lib.bridge_rate(lab.lab, 0, 10.0, 0) == 0
    shown, true = [], []
    for i in range(4000):
        t_s = 2.0 + i * 0.01
        shown.append(lib.bridge_readout_deg(lab.lab, 0, ns(t_s)))
        true.append(math.degrees(lab.axis(0, t_s - 0.05)[0]))
    noise = (np.array(shown) - np.array(true)) * 3600 - 36
    assert float(np.std(noise)) == pytest.approx(5.0, rel=0.05)  # 4.5 sigma
    assert abs(float(np.mean(noise))) < 4 * 5 / math.sqrt(4000)
    assert abs(float(np.mean(noise[1:] * noise[:-1]))) < 4 * 25 / math.sqrt(4000)


# ---- the chamber


@pytest.mark.parametrize(
    ("tau_c", "tau_e"), [(180.0, 360.0), (240.0, 900.0), (300.0, 300.0), (400.0, 60.0), (90.0, 90.001)]
)
def test_thermal_lags_against_integration(lib: ctypes.CDLL, tau_c: float, tau_e: float) -> None:
    """Heat, change the ramp on the way, turn back before the set point, hold: by Runge and Kutta's method."""
    commands = [(60.0, "set", 85.0), (1500.0, "ramp", 4.0), (1800.0, "set", -60.0), (4000.0, "ramp", 0.5)]
    oven = lib.bridge_oven(25.0, 5.0, 3.0, tau_c, tau_e)
    air, ramp, target = 25.0, 1.0, 25.0
    case = element = 25.0
    h, t = 0.5, 0.0
    todo = list(commands)
    out = (ctypes.c_double * 3)()
    while t < 9000:
        if todo and t == todo[0][0]:
            _, what, value = todo.pop(0)
            call = lib.bridge_oven_set if what == "set" else lib.bridge_oven_ramp
            assert call(oven, value, ns(t)) == 0
            target, ramp = (value, ramp) if what == "set" else (target, value)
        speed = min(ramp, 5.0 if target > air else 3.0) / 60
        step = math.copysign(min(speed * h, abs(target - air)), target - air)

        def slope(x: float, c: float, e: float, a: float = air, d: float = step) -> tuple[float, float]:
            return ((a + d * x / h) - c) / tau_c, (c - e) / tau_e

        k1 = slope(0, case, element)
        k2 = slope(h / 2, case + h / 2 * k1[0], element + h / 2 * k1[1])
        k3 = slope(h / 2, case + h / 2 * k2[0], element + h / 2 * k2[1])
        k4 = slope(h, case + h * k3[0], element + h * k3[1])
        case += h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
        element += h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
        air += step
        t += h
        if t % 50 == 0 and not any(t == at for at, _, _ in todo):
            lib.bridge_oven_degc(oven, ns(t), out)
            assert list(out) == pytest.approx([air, case, element], abs=3e-4), t  # a ramp ends within a step
    lib.bridge_oven_free(oven)


def test_on_a_long_ramp_the_lags_are_rate_times_tau(lib: ctypes.CDLL) -> None:
    oven = lib.bridge_oven(-60.0, 5.0, 3.0, 60.0, 120.0)
    out = (ctypes.c_double * 3)()
    assert lib.bridge_oven_set(oven, 85.0, 0) == 0
    lib.bridge_oven_degc(oven, ns(8000.0), out)
    assert list(out) == pytest.approx([-60 + 8000 / 60, -60 + 7940 / 60, -60 + 7820 / 60], abs=1e-9)
    lib.bridge_oven_free(oven)


# ---- Allan deviation of each noise term, 30 seeds

DT_S = 0.01


def allan(x: Array, m: int) -> tuple[float, int]:
    """Allan variance over m samples, not overlapping, and how many differences it is the mean of."""
    means = x[: x.size // m * m].reshape(-1, m).mean(axis=1)
    return 0.5 * float(np.mean(np.diff(means) ** 2)), means.size - 1


def flicker_variance(b: float, m: int) -> float:
    """Allan variance of nine sampled Gauss-Markov processes 5 times apart from 0.05 s, exactly."""
    total = 0.0
    for i in range(9):
        rho = math.exp(-DT_S / (0.05 * 5**i))
        lags = np.arange(1, m)
        same = (m + 2 * float(np.sum((m - lags) * rho**lags))) / m**2
        both = rho * ((1 - rho**m) / (1 - rho)) ** 2 / m**2
        total += b * b * math.log(5) / math.pi * (same - both)
    return total


TERMS: dict[str, tuple[list[float], Callable[[int], float], float]] = {
    # terms of bridge_noise, variance over m samples, correlation of neighbouring differences widens the band by
    "white": ([1e-3, 0, 0, 0, 0], lambda m: 1e-6 / (2 * m * DT_S), 1.5),
    "bias instability": ([0, 1e-3, 0, 0, 0], lambda m: flicker_variance(1e-3, m), 1.6),
    "random walk": ([0, 0, 1e-3, 0, 0], lambda m: 1e-6 * DT_S * (2 * m * m + 1) / (6 * m), 1.2),
    "quantisation": ([1e-3, 0, 0, 0, 1e-3], lambda m: 1e-6 / (2 * m * DT_S) + 1e-6 / 12 / m, 1.5),
}
SEEDS, SAMPLES = 30, 20000


@pytest.mark.parametrize("term", TERMS)
@pytest.mark.parametrize("m", [1, 10, 100, 1000])
def test_allan_deviation_of_a_noise_term_lies_in_its_band(lib: ctypes.CDLL, term: str, m: int) -> None:
    """The mean of 30 seeds is chi-squared: 4 sigma of it, with its degrees of freedom reduced by the correlation."""
    terms, variance, wide = TERMS[term]
    out = (ctypes.c_double * SAMPLES)()
    found, freedom = 0.0, 0
    for seed in range(1, SEEDS + 1):
        lib.bridge_noise(doubles(terms), seed, ns(DT_S), SAMPLES, out)
        value, n = allan(np.array(out), m)
        found += value / SEEDS
        freedom += n
    sigma = wide * math.sqrt(2 / freedom)
    assert found / variance(m) == pytest.approx(1, abs=4 * sigma), f"sigma {sigma:.4f}"


def test_flicker_is_flat_at_its_floor() -> None:
    """0.664 B, IEEE Std 952, within 3 % from 1 s to 300 s: the sum of processes is what it represents."""
    floor = 2 * math.log(2) / math.pi
    for m in (100, 300, 1000, 3000, 10000, 30000):
        assert flicker_variance(1.0, m) == pytest.approx(floor, rel=0.06)


def test_ramp_has_its_allan_deviation(lib: ctypes.CDLL) -> None:
    out = (ctypes.c_double * 1000)()
    lib.bridge_slow(doubles([0, 0, 3e-4]), 1, ns(DT_S), 1000, out)
    for m in (1, 10, 100):
        assert allan(np.array(out), m)[0] == pytest.approx((3e-4 * m * DT_S) ** 2 / 2, rel=1e-9)


def test_quantisation_of_a_still_sensor_is_its_step(lib: ctypes.CDLL) -> None:
    out = (ctypes.c_double * 2000)()
    lib.bridge_noise(doubles([1e-3, 0, 0, 0, 2e-3]), 1, ns(DT_S), 2000, out)
    codes = np.array(out) / 2e-3
    assert codes == pytest.approx(np.round(codes), abs=1e-9)
    assert all(a != b for a, b in pairwise(sorted(set(codes.tolist()))))
