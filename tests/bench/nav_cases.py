"""What `make bench` measures of libpsabench-nav from Python, beside filterpy and python-ins, which are of Python."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

N, MOVING, M, TURNS = 45, 6, 3, 16  # as bench_kf.cpp has them


def calibration_pattern() -> tuple[np.ndarray, np.ndarray]:
    """Phi's moving rows and rows of measurements, 1 where keep_pattern() of bench_kf.cpp leaves a number."""
    phi, h = np.zeros((MOVING, N)), np.zeros((M, N))
    phi[:3, :18] = 1.0
    phi[3:, 3:MOVING] = np.eye(3)
    h[:, 18:40] = 1.0
    h[[0, 1], [1, 0]] = 1.0
    return phi, h


def filterpy(count: int) -> str:
    """Steps of filterpy's KalmanFilter: prediction and three measurements at once."""
    from filterpy.kalman import KalmanFilter  # type: ignore[import-untyped]

    rng, (phi, h) = np.random.default_rng(1), calibration_pattern()
    f = KalmanFilter(dim_x=N, dim_z=M)
    f.F[:MOVING] += 0.01 * rng.uniform(-0.5, 0.5, (MOVING, N)) * phi
    f.Q = np.diag([1e-6] * MOVING + [0.0] * (N - MOVING))
    f.R = 0.01 * np.eye(M)
    rows, z = rng.uniform(-0.5, 0.5, (TURNS, M, N)) * h, np.array([0.1, -0.2, 0.3])
    began_ns = time.process_time_ns()
    for k in range(count):
        f.predict()
        f.update(z, H=rows[k % TURNS])
    ns = time.process_time_ns() - began_ns
    if not np.isfinite(f.P).all():
        raise RuntimeError("filterpy: the covariance is not finite")
    return f"steps={count} ns={ns}"


def sins_plan(count: int) -> str:
    """Covariances of the article's plan of three cycles, 2718 s at 100 Hz."""
    from psabench.native.sins import Sins, SinsConfig, Turn

    cfg, tenth, placed = SinsConfig(), np.radians(10.0), np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    legs = [(axis, sign, 450.0) for axis in (x, y, z) for sign in (1, -1)]
    legs[2:2], legs[5:5] = [(z, -1, 9.0)], [(x, -1, 9.0)]
    turns = [Turn(axis_b=axis, rate_radps=sign * tenth, duration_s=s) for axis, sign, s in legs]
    began_ns = time.process_time_ns()
    for _ in range(count):
        s = Sins(cfg, placed)
        s.plan(turns)
    ns = time.process_time_ns() - began_ns
    if not 0.0 < s.sd("nu").max() < cfg.nu_sd_radps / 10.0:
        raise RuntimeError("sins-plan: the drifts are not found")
    return f"plans={count} ns={ns}"


def _hour() -> tuple[np.ndarray, np.ndarray]:
    t = 0.01 * np.arange(360_001)
    turn = np.stack([0.3 * np.sin(0.9 * t), 0.2 * np.sin(1.3 * t + 1), 0.1 * np.sin(0.1 * t)], -1) * 0.01
    push = np.stack([0.5 * np.sin(0.6 * t), 0.3 * np.cos(0.5 * t), 9.81 + 0.2 * np.sin(2 * t)], -1) * 0.01
    return turn, push


def strapdown_hours(count: int) -> str:
    """Hours of strapdown integration at 100 Hz, the path of each interval given back."""
    from psabench.native.strapdown import State, Strapdown, dcm

    turn, push = _hour()
    lat, lon, c_nb = np.radians(55.7), np.radians(37.5), dcm(*np.radians([77.0, -5.0, 3.0]))
    began_ns = time.process_time_ns()
    for _ in range(count):
        at = State(lat_rad=lat, lon_rad=lon, h_m=150.0, v_n_mps=np.array([-20.0, 30.0, 0.0]), C_nb=c_nb)
        Strapdown(at, height_fixed=True).advance(turn[1:], push[1:], 0.01)
    return f"hours={count} ns={time.process_time_ns() - began_ns}"


def _hour_of_python_ins() -> tuple[Any, Any]:
    """Its increments, frames of time by axis, and where they begin."""
    import pandas as pd

    turn, push = _hour()
    names = [f"{s}_{a}" for s in ("gyro", "accel") for a in "xyz"]
    to_other = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # forward, right, down
    imu = pd.DataFrame(
        np.hstack([turn @ to_other.T, push @ to_other.T]), index=0.01 * np.arange(len(turn)), columns=names
    )
    states = ["lat", "lon", "alt", "VN", "VE", "VD", "roll", "pitch", "heading"]
    return imu, pd.Series([55.7, 37.5, 150.0, 30.0, -20.0, 0.0, 3.0, -5.0, 77.0], states)


def python_ins_hours(count: int) -> str:
    """The same by python-ins, compiled by numba before the clock starts."""
    from pyins import strapdown as other  # type: ignore[import-untyped]

    imu, began = _hour_of_python_ins()
    increments = other.compute_increments_from_imu(imu, "increment")
    other.Integrator(began, with_altitude=False).integrate(increments.iloc[:100])
    began_ns = time.process_time_ns()
    for _ in range(count):
        increments = other.compute_increments_from_imu(imu, "increment")
        other.Integrator(began, with_altitude=False).integrate(increments)
    return f"hours={count} ns={time.process_time_ns() - began_ns}"


def koi_hours(count: int) -> str:
    """Hours of the integration filter with nine Gamma and no barometer: 35 states; gates that nothing exceeds."""
    from psabench.native.koi import Kind, Koi, Reason, koi_default
    from psabench.native.sins import Gauge
    from psabench.native.strapdown import State, dcm

    turn, push = _hour()
    cfg = koi_default()
    cfg.gauge, cfg.baro_sd_m, cfg.outlier_nis = int(Gauge.FREE9), 0.0, 1e300
    cfg.gate_nis[:] = [1e300, 1e300]
    place, c_nb = (float(np.radians(55.7)), float(np.radians(37.5)), 150.0), dcm(*np.radians([77.0, -5.0, 3.0]))
    at = State(lat_rad=place[0], lon_rad=place[1], h_m=150.0, v_n_mps=np.array([-20.0, 30.0, 0.0]), C_nb=c_nb)
    began_ns = time.process_time_ns()
    for _ in range(count):
        koi = Koi(cfg, 0.0, at)
        for k in range(3600):
            koi.push(turn[100 * k : 100 * k + 100], push[100 * k : 100 * k + 100])
            koi.take(Kind.POSITION, k + 1.0, place)
            last = koi.take(Kind.VELOCITY, k + 1.0)
    ns = time.process_time_ns() - began_ns
    if koi.n != 35 or last is not Reason.ACCEPTED:
        raise RuntimeError("koi: the last velocity is not taken")
    return f"hours={count} ns={ns}"


PART = 60  # of an hour: python-ins takes minutes for the whole


def python_ins_filter_hours(count: int) -> str:
    """The same by python-ins' feedforward filter with its 33 states, integration included; a minute, times 60."""
    import pandas as pd
    from pyins import filters, inertial_sensor, measurements
    from pyins import strapdown as other

    whole, began = _hour_of_python_ins()
    imu = whole.iloc[: len(whole) // PART]
    at = pd.Index(np.arange(1.0, 3600 // PART))
    place = pd.DataFrame(np.tile(began[["lat", "lon", "alt"]], (len(at), 1)), at, ["lat", "lon", "alt"])
    speed = pd.DataFrame(np.zeros((len(at), 3)), at, ["VN", "VE", "VD"])
    model = inertial_sensor.EstimationModel(bias_sd=1e-3, noise=1e-5, scale_misal_sd=np.full((3, 3), 1e-4))
    other.Integrator(began).integrate(other.compute_increments_from_imu(imu.iloc[:100], "increment"))  # compiles
    began_ns = time.process_time_ns()
    for _ in range(count):
        increments = other.compute_increments_from_imu(imu, "increment")
        path = other.Integrator(began).integrate(increments)
        found = filters.run_feedforward_filter(
            *(path, path, 10.0, 0.1, 0.1, 0.5, model, model),
            measurements=[measurements.Position(place, 5.0), measurements.NedVelocity(speed, 0.1)],
            increments=increments,
        )
    ns = time.process_time_ns() - began_ns
    if found.gyro.shape[1] + found.accel.shape[1] != 24:
        raise RuntimeError(
            f"python-ins: expected 24 parameters of sensors, got {list(found.gyro)}, {list(found.accel)}"
        )
    return f"hours={count} ns={ns * PART}"


NAV_CASES: dict[str, Callable[[int], str]] = {
    "kf-filterpy": filterpy,
    "koi": koi_hours,
    "koi-python-ins": python_ins_filter_hours,
    "sins-plan": sins_plan,
    "strapdown": strapdown_hours,
    "strapdown-python-ins": python_ins_hours,
}
