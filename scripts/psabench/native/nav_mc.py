"""Monte-Carlo of gyrocompassing and of the hold: the models of libpsabench-nav (nav_mc.h), into NumPy arrays.

Run k of a seed is the same whatever the batch: `closed(cfg, seed, runs=1000)` is `closed(cfg, seed, runs=500)` followed
by `closed(cfg, seed, first_run=500, runs=500)`. `threads` splits a range and changes no number.
"""

from __future__ import annotations

import ctypes as c
import enum
import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np

from psabench.errors import expected
from psabench.native.nav import ARCMIN, DEGPH, Floats, Method, Noise, Refused
from psabench.native.navlib import (
    MAX_POSITIONS,
    FitStruct,
    McHoldOutStruct,
    McHoldStruct,
    McOutStruct,
    McStruct,
    NoiseStruct,
    RefusalStruct,
    filled,
    library,
)


class Model(enum.IntEnum):
    """enum nav_mc_model."""

    CLOSED = 0
    SAMPLES = 1


class AngleSys(enum.IntEnum):
    """How the systematic error of the set angle is read (enum nav_mc_angle)."""

    NONE = 0
    COMMON = 1
    INCREMENT = 2
    ACCUMULATES = 3


class Cardan(enum.IntEnum):
    """What the angle is about (enum nav_mc_cardan)."""

    ALPHA = 0
    UNCORRECTED = 1
    CORRECTED = 2


class Tilt(enum.IntEnum):
    """Where pitch and roll lie (enum nav_mc_tilt)."""

    UNIFORM = 0
    CORNERS = 1


class Axis2(enum.IntEnum):
    """What is known of the azimuth axis' drift in the hold (enum nav_mc_axis2)."""

    SAME = 0
    DIFFERS = 1
    MEASURED = 2
    FIXED = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class McConfig:
    """Errors, schedule and estimator of one kind of instrument; the defaults are the article's (nav_mc_default)."""

    latitude_rad: float = math.radians(50.0)
    latitude_error_rad: float = 0.1 * ARCMIN
    tilt_rad: float = math.radians(5.0)
    tilt: Tilt = Tilt.UNIFORM
    cardan: Cardan = Cardan.ALPHA
    alpha1_rad: float = math.nan  # NaN: uniform over the turn
    drift1_radps: float = 25.0 * DEGPH
    gm_sigma_radps: float = 0.2 * DEGPH
    gm_tau_s: float = 1000.0
    gm_from_zero: bool = False
    gm_before_s: float = 0.0  # with it: zero so long before the first window instead of at its start
    torquer_scale: float = 0.0
    m1_per_s: float = 1.0
    beta_sys_rad: float = 10.0 * ARCMIN
    gamma_sys_rad: float = 10.0 * ARCMIN
    beta_random_rad: float = 1.0 * ARCMIN
    gamma_random_rad: float = 1.0 * ARCMIN
    angle_sys_rad: float = 6.0 * ARCMIN
    angle_random_rad: float = 3.0 * ARCMIN
    angle_sys: AngleSys = AngleSys.COMMON
    random_sign: bool = True
    per_sample: bool = False
    white_radps_rts: float = 0.0
    sample_s: float = 0.01
    angles_rad: tuple[float, ...] = (0.0, math.pi / 2, math.pi)
    window_s: float = 10.0
    gap_s: float = 10.0
    slew_radps: float = 0.0  # above 0: the gap is turn/slew + settle
    settle_s: float = 0.0
    method: Method = Method.CLOSED3
    simplified: bool = True
    ramp: bool = False
    noise: Noise = field(default_factory=Noise)  # what the estimator believes


@dataclass(frozen=True, slots=True, kw_only=True)
class HoldConfig:
    """A hold after a gyrocompassing (struct nav_mc_hold_cfg)."""

    start: McConfig = field(default_factory=McConfig)
    axis2: Axis2 = Axis2.SAME
    axis2_sd_radps: float = 0.0
    heading_rad: float = 0.0  # of Axis2.FIXED
    drift_error_radps: float = 0.0
    hours: float = 4.0
    step_s: float = 60.0
    wait_s: float = 10.0
    level_rad: float = 0.0
    latitude_error_rad: float = 0.0
    v_east_mps: float = 0.0
    speed_error: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """Estimate less truth, one number a run."""

    platform_rad: Floats  # alpha of the platform in position 1
    heading_rad: Floats  # the same referred to the zero of the angle: what the pilot reads
    drift_radps: Floats  # against the mean drift
    alpha1_rad: Floats  # the truth that was drawn
    quality: Floats  # |hypot(s, c) - 1|


@dataclass(frozen=True, slots=True, kw_only=True)
class HoldErrors:
    """Error of heading after the hold, one number a run."""

    end_rad: Floats
    max_rad: Floats  # largest magnitude on the way


def closed(
    cfg: McConfig, seed: int, *, runs: int, first_run: int = 0, threads: int = 1, into: Errors | None = None
) -> Errors:
    """Errors of first order in jointly Gaussian window means: tens of millions a second. Raises Refused.

    `into`: earlier results of as many runs whose arrays are written again; fresh memory takes as long as the runs."""
    out = _arrays(runs) if into is None else {name: getattr(into, name) for name, *_ in McOutStruct._fields_}
    struct = _checked(cfg, Model.CLOSED)
    _ranges(library().mc_closed, struct, McOutStruct, out, (seed, first_run, runs), threads)
    return Errors(**out)


def samples(cfg: McConfig, seed: int, *, runs: int, first_run: int = 0, threads: int = 1) -> Errors:
    """Drift and noise sample by sample, the estimator itself at the end of each run. Raises Refused."""
    out = _arrays(runs)
    struct = _checked(cfg, Model.SAMPLES)
    _ranges(library().mc_samples, struct, McOutStruct, out, (seed, first_run, runs), threads)
    return Errors(**out)


def hold(cfg: HoldConfig, seed: int, *, runs: int, first_run: int = 0, threads: int = 1) -> HoldErrors:
    """Heading held for hours after a gyrocompassing. Raises Refused."""
    out = {name: np.empty(runs) for name, *_ in McHoldOutStruct._fields_}
    struct = hold_struct(cfg)
    why = RefusalStruct()
    if (status := library().mc_hold_check(c.byref(struct), c.byref(why))) < 0:
        raise Refused("hold", status, why)
    _ranges(library().mc_hold, struct, McHoldOutStruct, out, (seed, first_run, runs), threads)
    return HoldErrors(**out)


def _checked(cfg: McConfig, model: Model) -> McStruct:
    """The structure that the library takes, and will not reject at once."""
    struct = config_struct(cfg)
    why = RefusalStruct()
    if (status := library().mc_check(c.byref(struct), int(model), c.byref(why))) < 0:
        raise Refused(f"Monte-Carlo, {model.name.lower()}", status, why)
    return struct


def config_struct(cfg: McConfig) -> McStruct:
    """The structure that the library takes."""
    if len(cfg.angles_rad) > MAX_POSITIONS:
        raise ValueError(expected(f"{MAX_POSITIONS} positions at most", len(cfg.angles_rad)))
    struct = McStruct()
    for name, *_ in McStruct._fields_:
        if name not in ("count", "angle_rad", "fit"):
            value = getattr(cfg, name)
            setattr(struct, name, value if isinstance(value, float) else int(value))
    struct.count = len(cfg.angles_rad)
    struct.angle_rad = (c.c_double * MAX_POSITIONS)(*cfg.angles_rad)
    noise = filled(NoiseStruct, cfg.noise)
    struct.fit = FitStruct(cfg.latitude_rad, int(cfg.method), int(cfg.simplified), int(cfg.ramp), noise)
    return struct


def hold_struct(cfg: HoldConfig) -> McHoldStruct:
    """The structure that the library takes."""
    struct = McHoldStruct(start=config_struct(cfg.start), axis2=int(cfg.axis2))
    for name, *_ in McHoldStruct._fields_[2:]:
        setattr(struct, name, getattr(cfg, name))
    return struct


def _arrays(runs: int) -> dict[str, Floats]:
    return {name: np.empty(runs) for name, *_ in McOutStruct._fields_}


def _ranges(
    function: Callable[..., int],
    cfg: c.Structure,
    kind: type[c.Structure],
    out: dict[str, Floats],
    what: tuple[int, int, int],
    threads: int,
) -> None:
    """Calls the function for pieces of the range in threads; ctypes gives the interpreter's lock back meanwhile."""
    seed, first, runs = what
    if min(seed, first, runs) < 0 or threads < 0:
        raise ValueError(expected("0 or more", min(seed, first, runs, threads), "seed, first_run, runs, threads"))
    if any(a.shape != (runs,) or a.dtype != np.float64 or not a.flags.c_contiguous for a in out.values()):
        raise ValueError(expected(f"arrays of {runs} doubles", None, "into"))
    workers = min(threads or os.cpu_count() or 1, max(runs, 1))
    edges = [runs * k // workers for k in range(workers + 1)]

    def piece(low: int, high: int) -> int:
        pointers = {k: v[low:high].ctypes.data_as(c.POINTER(c.c_double)) for k, v in out.items()}
        return int(function(c.byref(cfg), seed, first + low, high - low, c.byref(kind(**pointers))))

    if workers == 1:
        statuses = [piece(0, runs)]
    else:
        with ThreadPoolExecutor(workers) as pool:
            statuses = list(pool.map(piece, edges[:-1], edges[1:]))
    if (status := min(statuses)) < 0:
        raise Refused("Monte-Carlo", status)
