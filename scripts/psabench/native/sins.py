"""Calibration of a strapdown inertial unit on a rate table: libpsabench-nav (docs/procedures/sins.md), from Python.

n is east, north, up at the table, b the instrument; C_nb takes b to n. Errors are measured less true. Units: rad, s, m.
Arrays that are float64 and C-contiguous go to the library without a copy. An estimator belongs to one thread.
"""

from __future__ import annotations

import ctypes as c
import enum
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from psabench.errors import expected
from psabench.native.nav import ARCMIN, DEGPH, Floats, Refused
from psabench.native.navlib import RefusalStruct, library
from psabench.native.sinslib import (
    BLOCKS,
    ParamsStruct,
    RowsStruct,
    SinsConfigStruct,
    StateStruct,
    TurnStruct,
)

DEG = math.radians(1.0)
SCALARS = ("tau_s", "delay_s")  # of Params
CHUNK_S = 1.0  # of data handed over at once, between the stand's angles


class Gauge(enum.IntEnum):
    """Which elements of Gamma are estimated (enum nav_sins_gauge)."""

    ARTICLE = 0
    LOWER = 1
    FREE9 = 2


class Form(enum.IntEnum):
    """How the covariance is kept (enum nav_kf_form)."""

    JOSEPH = 0
    UD = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class SinsConfig:
    """Model, priors and noise; the defaults are the article's (nav_sins_default)."""

    latitude_rad: float = 55.7 * DEG
    gravity_mps2: float = 9.81
    sample_s: float = 0.01
    step_s: float = 0.1
    form: Form = Form.JOSEPH
    gauge: Gauge = Gauge.ARTICLE
    lever: int = 0  # 0, 3: r_ii, 9
    stand: bool = False
    base: bool = False
    walk: bool = False
    clone: bool = False
    beta_sd_rad: tuple[float, float, float] = (DEG, DEG, 3.0 * DEG)
    nu_sd_radps: float = 0.5 * DEGPH
    theta_scale_sd: float = 1e-3
    theta_angle_sd_rad: float = 3.0 * ARCMIN
    df_sd_mps2: float = 0.02
    gamma_scale_sd: float = 1e-3
    gamma_angle_sd_rad: float = 3.0 * ARCMIN
    lever_sd_m: float = 0.1
    quad_sd_s2pm: float = 0.0  # 0: known, not in the state
    delay_sd_s: float = 0.0
    delta_sd_rad: float = DEG
    tau_sd_s: float = 0.05
    eps_sd_rad: float = ARCMIN
    walk_sd_radps: float = 0.0
    walk_tau_s: float = 1000.0
    gyro_noise_radps_rts: float = 0.1 * DEGPH
    accel_noise_mps2_rts: float = 0.001
    accel_noise_multiplier: float = 1.0  # 4: what the article's tables follow from
    stand_sd_rad: float = 0.25 * ARCMIN
    stand_noise_rate_hz: float = 1.0  # or 50
    stand_interval_s: float = 0.1
    stand_guard_s: float = 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class Params:
    """What the model holds (struct nav_sins_params)."""

    nu_radps: Floats = field(default_factory=lambda: np.zeros(3))
    theta: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    df_mps2: Floats = field(default_factory=lambda: np.zeros(3))
    gamma: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    lever_m: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    quadratic_s2pm: Floats = field(default_factory=lambda: np.zeros(3))
    delay_s: float = 0.0  # accelerometers later than gyros
    delta_rad: Floats = field(default_factory=lambda: np.zeros(3))
    tau_s: float = 0.0
    eps_rad: Floats = field(default_factory=lambda: np.zeros(3))

    def gyros(self, w_measured: Floats) -> Floats:
        """Rates w of rows of measured ones: w = (I + Theta)^-1 (w' - nu)."""
        return np.asarray((w_measured - self.nu_radps) @ np.linalg.inv(np.eye(3) + self.theta).T)

    def accelerometers(self, f_measured: Floats) -> Floats:
        """Specific forces f of rows of measured ones: f = (I + Gamma)^-1 (f' - df - q f^2); lever arms, delay stay."""
        back = np.linalg.inv(np.eye(3) + self.gamma).T
        found = (f_measured - self.df_mps2) @ back
        for _ in range(2):
            found = (f_measured - self.df_mps2 - self.quadratic_s2pm * found**2) @ back
        return np.asarray(found)


@dataclass(frozen=True, slots=True, kw_only=True)
class Turn:
    """A turn at a constant rate about an axis of b (struct nav_sins_turn)."""

    axis_b: tuple[float, float, float]
    rate_radps: float
    duration_s: float
    remount: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """Where an estimator is (struct nav_sins_state)."""

    t_s: float
    params: Params
    c_nb: Floats
    c0_nb: Floats
    nis_accel: float  # mean of value^2/variance: 1 when model and noise are right; NaN: no measurement
    nis_stand: float
    stand_left_out: int
    innovations: Floats  # of the last step, in standard deviations: 3 of accelerometers, 3 of the stand (NaN: none)


class Sins:
    """An estimator; its memory is Python's. Raises Refused."""

    def __init__(self, cfg: SinsConfig, c_nb: Floats, *, feedback: bool = False) -> None:
        lib = library()
        self.cfg = cfg
        self.rows = state_layout(cfg)
        self.states = sum(r.stop - r.start for r in self.rows.values())
        self._memory = c.create_string_buffer(lib.sins_bytes() + 16)
        at = (c.addressof(self._memory) + 15) & ~15
        self._s = c.c_void_p()
        struct = config_struct(cfg)
        status = lib.sins_start(at, lib.sins_bytes(), struct, _doubles_at(c_nb, 9), int(feedback), c.byref(self._s))
        _check_status("start", status)

    def about(self, params: Params) -> None:
        """Before the first increments: linearised about this model, with the prior as it is."""
        _check_status("model", library().sins_about(self._s, c.byref(_params_struct(params))))

    def samples(self, t_s: float, dtheta_rad: Floats, dv_mps: Floats) -> None:
        """Increments, rows of three; the first over t_s to t_s + sample_s."""
        count = len(dtheta_rad)
        data = _doubles_at(dtheta_rad, 3 * count), _doubles_at(dv_mps, 3 * count)
        _check_status("samples", library().sins_samples(self._s, t_s, *data, count))

    def stand(self, t_s: float, c_st: Floats) -> None:
        """Angles of the table as a rotation, before the increments that follow."""
        _check_status("stand", library().sins_stand(self._s, t_s, _doubles_at(c_st, 9)))

    def plan(self, turns: Sequence[Turn]) -> None:
        """Covariance over a plan, without data."""
        structs = (TurnStruct * len(turns))(
            *(TurnStruct((c.c_double * 3)(*t.axis_b), t.rate_radps, t.duration_s, int(t.remount)) for t in turns)
        )
        _check_status("plan", library().sins_plan(self._s, structs, len(turns)))

    def again(self) -> None:
        """From the start about what was found: the second pass."""
        _check_status("second pass", library().sins_again(self._s))

    def state(self) -> State:
        """Estimates as they are now."""
        s = StateStruct()
        library().sins_get(self._s, c.byref(s))
        with np.errstate(divide="ignore", invalid="ignore"):
            last = np.array([[i.value, i.variance] for i in s.last])
            sizes = np.where(last[:, 1] > 0, last[:, 0] / np.sqrt(last[:, 1]), np.nan)
            nis = np.array([s.nis_accel, s.nis_stand]) / np.array([s.count_accel, s.count_stand])
        return State(
            t_s=s.t_s,
            params=_params_of(s.params),
            c_nb=np.array(s.c_nb).reshape(3, 3),
            c0_nb=np.array(s.c0_nb).reshape(3, 3),
            nis_accel=float(nis[0]),
            nis_stand=float(nis[1]),
            stand_left_out=s.stand_left_out,
            innovations=sizes,
        )

    def covariance(self) -> tuple[Floats, Floats]:
        """x, which counts from the model, and P."""
        x, p = np.empty(self.states), np.empty((self.states, self.states))
        library().sins_covariance(self._s, _doubles_at(x, self.states), _doubles_at(p, p.size))
        return x, p

    def sd(self, block: str) -> Floats:
        """Standard deviations of a block's states."""
        return np.asarray(np.sqrt(np.diag(self.covariance()[1])[self.rows[block]]))

    def jacobians(self) -> tuple[Floats, Floats, Floats]:
        """phi, q and h of the last step; rows 3 to 5 of h: of the last angle of the stand."""
        moving = self.rows["nu"].start
        phi, q, h = np.empty((moving, self.states)), np.empty((moving, moving)), np.empty((6, self.states))
        library().sins_jacobians(self._s, *(_doubles_at(a, a.size) for a in (phi, q, h)))
        return phi, q, h


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """Result of `calibrate_unit`."""

    state: State
    covariance: Floats
    first: State  # of the first pass, and its own covariance
    first_covariance: Floats
    rows: Mapping[str, slice]


def calibrate_unit(
    cfg: SinsConfig,
    c_nb: Floats,
    dtheta_rad: Floats,
    dv_mps: Floats,
    *,
    stand: tuple[Floats, Floats] | None = None,
    passes: int = 2,
) -> Calibration:
    """Both passes over recorded increments from t = 0; stand: times and rotations (count x 3 x 3).

    cfg.clone must be set for two passes: one pass without the stand claims less than its errors
    (docs/procedures/sins.md)."""
    s = Sins(cfg, c_nb, feedback=True)
    feed_data(s, dtheta_rad, dv_mps, stand)
    first, first_covariance = s.state(), s.covariance()[1]
    for _ in range(passes - 1):
        s.again()
        feed_data(s, dtheta_rad, dv_mps, stand)
    return Calibration(
        state=s.state(),
        covariance=s.covariance()[1],
        first=first,
        first_covariance=first_covariance,
        rows=s.rows,
    )


def feed_data(
    s: Sins,
    dtheta: Floats,
    dv: Floats,
    stand: tuple[Floats, Floats] | None,
    each_second: Callable[[], None] | None = None,
    *,
    first: int = 0,
) -> None:
    """All data through an estimator, the stand's angles before the increments that they are compared with.

    first: increments that it has had."""
    in_parts = stand is not None or each_second is not None
    size = max(round(CHUNK_S / s.cfg.sample_s), 1) if in_parts else max(len(dtheta), 1)
    for low, angles in _chunks_of(first, len(dtheta), size, s.cfg.sample_s, stand):
        for t_s, c_st in angles:
            s.stand(t_s, c_st)
        s.samples((first + low) * s.cfg.sample_s, dtheta[low : low + size], dv[low : low + size])
        if each_second:
            each_second()


def _chunks_of(
    first: int, count: int, size: int, sample_s: float, stand: tuple[Floats, Floats] | None
) -> Iterator[tuple[int, list[tuple[float, Floats]]]]:
    times, angles = stand if stand else (np.empty(0), np.empty((0, 3, 3)))
    edges = np.searchsorted(times, (first + np.arange(0, count + size, size)) * sample_s)
    for k, low in enumerate(range(0, count, size)):
        yield low, [(float(times[i]), angles[i]) for i in range(edges[k], edges[k + 1])]


def state_layout(cfg: SinsConfig) -> dict[str, slice]:
    """Where each block is in the state; empty slices are of blocks that it lacks. Raises Refused."""
    rows = (RowsStruct * len(BLOCKS))()
    struct, why = config_struct(cfg), RefusalStruct()
    if (status := library().sins_check(struct, c.byref(why))) < 0:
        raise Refused("calibration", status, why)
    library().sins_layout(struct, rows)
    return {name: slice(r.offset, r.offset + r.size) for name, r in zip(BLOCKS, rows, strict=True)}


def prior_covariance(cfg: SinsConfig) -> Floats:
    """Covariance at the start. Raises Refused."""
    n = max(rows.stop for rows in state_layout(cfg).values())
    p = np.empty((n, n))
    library().sins_prior(config_struct(cfg), _doubles_at(p, p.size))
    return p


def to_gauge(gauge: Gauge, params: Params) -> tuple[Params, Floats]:
    """The same instrument in the frame of a gauge, and R: b of the result is R b (nav_sins_to_gauge)."""
    struct, r = _params_struct(params), np.eye(3)
    _check_status("gauge", library().sins_to_gauge(int(gauge), c.byref(struct), _doubles_at(r, 9)))
    return _params_of(struct), r


def error_nees(error: Floats, covariance: Floats) -> float:
    """error' P^-1 error."""
    n = len(error)
    return float(library().kf_nees(n, _doubles_at(error, n), _doubles_at(covariance, n * n)))


def config_struct(cfg: SinsConfig) -> SinsConfigStruct:
    """The structure that the library takes."""
    struct = SinsConfigStruct()
    for f in fields(cfg):
        value = getattr(cfg, f.name)
        kind = (c.c_double * 3) if f.name == "beta_sd_rad" else None
        setattr(struct, f.name, kind(*value) if kind else value if isinstance(value, float) else int(value))
    return struct


def _params_of(struct: ParamsStruct) -> Params:
    got = {name: np.array(getattr(struct, name)) for name, *_ in ParamsStruct._fields_ if name not in SCALARS}
    matrices = {name: got[name].reshape(3, 3) for name in ("theta", "gamma", "lever_m")}
    return Params(tau_s=struct.tau_s, delay_s=struct.delay_s, **(got | matrices))


def _params_struct(params: Params) -> ParamsStruct:
    struct = ParamsStruct(tau_s=params.tau_s, delay_s=params.delay_s)
    for name, kind, *_ in ParamsStruct._fields_:
        if name not in SCALARS:
            setattr(struct, name, kind(*np.ravel(getattr(params, name))))
    return struct


def _doubles_at(array: Floats, count: int) -> Any:
    """A pointer to `count` doubles of an array; results need one that is float64 and contiguous."""
    a = np.ascontiguousarray(array, dtype=np.float64)
    if a.size != count:
        raise ValueError(expected(f"{count} numbers", a.size))
    return a.ctypes.data_as(c.POINTER(c.c_double))


def _check_status(what: str, status: int) -> None:
    if status < 0:
        raise Refused(f"calibration, {what}", status)
