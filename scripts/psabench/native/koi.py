"""Integration of a strapdown unit with a satellite receiver (КОИ): koi.h of libpsabench-nav, from Python.

Frames, state and equations are in koi.h. A unit is pushed its increments and given measurements; each measurement is
taken or left with a reason.
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from psabench.errors import BadInput, expected
from psabench.native.koilib import (
    BLOCKS,
    REASONS,
    KoiConfigStruct,
    KoiStateStruct,
    LastStruct,
    MeasurementStruct,
    SensorsStruct,
)
from psabench.native.nav import Floats, Refused
from psabench.native.navlib import RefusalStruct, library
from psabench.native.sinslib import RowsStruct
from psabench.native.strapdown import State

Bools = npt.NDArray[np.bool_]
KoiConfig = KoiConfigStruct  # fields by name; koi_default() fills them


class UnitClass(IntEnum):
    """enum nav_koi_class."""

    GOOD = 0
    BINS = 1


class Kind(IntEnum):
    """enum nav_koi_kind."""

    POSITION = 0
    VELOCITY = 1
    STOP = 2
    HEIGHT = 3


class Reason(IntEnum):
    """enum nav_koi_reason."""

    ACCEPTED = 0
    INVALID = 1
    NOT_FINITE = 2
    UNFIT = 3
    BACKWARDS = 4
    STALE = 5
    EARLY = 6
    OUTLIER = 7
    GATED = 8
    REJECTED = 9
    REOPENED = 10  # taken, after P was widened


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensors:
    """What is taken off the increments: w = (I + theta)^-1 (w' - nu), f = (I + gamma)^-1 (f' - df)."""

    nu_radps: Floats  # (3,)
    theta: Floats  # (3, 3)
    df_mps2: Floats
    gamma: Floats

    @staticmethod
    def of(struct: SensorsStruct) -> Sensors:
        theta, gamma = (np.array(m).reshape(3, 3) for m in (struct.theta, struct.gamma))
        return Sensors(nu_radps=np.array(struct.nu_radps), theta=theta, df_mps2=np.array(struct.df_mps2), gamma=gamma)

    def as_struct(self) -> SensorsStruct:
        """What the library takes."""
        out = SensorsStruct()
        for name in ("nu_radps", "theta", "df_mps2", "gamma"):
            getattr(out, name)[:] = list(np.ravel(getattr(self, name)))
        return out


@dataclass(frozen=True, slots=True, kw_only=True)
class Taken:
    """What became of the measurements of one kind."""

    reason: Reason | None  # of the last; None: there was none
    accepted_s: float
    nis: float
    nis_sum: float  # of the accepted ones, with nis_dof scalars
    nis_dof: int
    innovation: Floats  # (3, 2): values, variances
    counts: dict[Reason, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Integrated:
    """Both solutions after the last step of the filter."""

    t_s: float
    autonomous: State
    hybrid: State
    sensors: Sensors
    total: Sensors  # with the estimates
    alone_s: float  # since a measurement was accepted
    taken: dict[Kind, Taken]


@dataclass(frozen=True, slots=True, kw_only=True)
class CoarseAlignment:
    """Attitude by apparent gravity that turns with the Earth."""

    begin_C_nb: Floats  # (3, 3)
    end_C_nb: Floats
    ratio: float  # of the turn seen to the Earth's


def koi_default(unit_class: UnitClass = UnitClass.GOOD) -> KoiConfig:
    """Prior and noise of a class."""
    cfg = KoiConfig()
    _check_status("class", library().koi_default(int(unit_class), cfg))
    return cfg


def koi_layout(cfg: KoiConfig) -> dict[str, slice]:
    """Where each block is in the state. Raises Refused with the field."""
    rows, why = (RowsStruct * len(BLOCKS))(), RefusalStruct()
    if (status := library().koi_check(cfg, c.byref(why))) < 0:
        raise Refused("integration", status, why)
    library().koi_layout(cfg, rows)
    return {name: slice(r.offset, r.offset + r.size) for name, r in zip(BLOCKS, rows, strict=True)}


def koi_prior(cfg: KoiConfig, at: State) -> Floats:
    """Covariance (n, n) at the start. Raises Refused."""
    n = koi_layout(cfg)["dt"].stop
    p, row = np.empty((n, n)), at.row()
    _check_status("prior", library().koi_prior(cfg, row.ctypes.data, p.ctypes.data))
    return p


def coarse_alignment(dtheta_rad: Floats, dv_mps: Floats, sample_s: float, lat_rad: float) -> CoarseAlignment:
    """Of increments at rest, with sway. Raises Refused."""
    a, v = _increment_rows(dtheta_rad, dv_mps)
    found, ratio = [np.empty((3, 3)) for _ in range(2)], c.c_double()
    where = (m.ctypes.data for m in found)
    status = library().koi_coarse(a.ctypes.data, v.ctypes.data, len(a), sample_s, lat_rad, *where, c.byref(ratio))
    _check_status("coarse alignment", status)
    return CoarseAlignment(begin_C_nb=found[0], end_C_nb=found[1], ratio=ratio.value)


class Koi:
    """A filter in Python's memory. Raises Refused."""

    def __init__(
        self,
        cfg: KoiConfig,
        t_s: float,
        at: State,
        *,
        x: Floats | None = None,
        p: Floats | None = None,
        sensors: Sensors | None = None,
    ) -> None:
        lib, self.layout = library(), koi_layout(cfg)
        self.n = self.layout["dt"].stop
        self._memory = c.create_string_buffer(lib.koi_bytes() + 16)
        self.handle, place, row = c.c_void_p(), (c.addressof(self._memory) + 15) & ~15, at.row()
        arrays = [None if a is None else np.ascontiguousarray(a, np.float64) for a in (x, p)]
        given = [None if a is None else a.ctypes.data for a in arrays]
        struct = None if sensors is None else c.byref(sensors.as_struct())
        status = lib.koi_start(place, lib.koi_bytes(), cfg, t_s, row.ctypes.data, *given, struct, c.byref(self.handle))
        _check_status("start", status)
        self._now = KoiStateStruct()

    def push(self, dtheta_rad: Floats, dv_mps: Floats) -> None:
        """Raw increments (n, 3) twice."""
        a, v = _increment_rows(dtheta_rad, dv_mps)
        _check_status("increments", library().koi_push(self.handle, a.ctypes.data, v.ctypes.data, len(a)))

    def take(
        self,
        kind: Kind,
        t_s: float,
        value: Sequence[float] | Floats = (0.0, 0.0, 0.0),
        sd: Sequence[float] = (0.0, 0.0, 0.0),
        *,
        valid: bool = True,
    ) -> Reason:
        """One measurement; sd 0: that of the configuration."""
        m = MeasurementStruct(kind=int(kind), valid=int(valid), t_s=t_s)
        m.value[: len(value)], m.sd[: len(sd)] = list(value), list(sd)
        return Reason(_check_status("measurement", library().koi_take(self.handle, m)))

    def correct(self, take: Bools) -> None:
        """Moves the estimates of these states (n,) into the autonomous solution and the sensors."""
        flags = np.ascontiguousarray(take, np.uint8)
        if flags.shape != (self.n,):
            raise BadInput(expected(f"{self.n} flags", flags.shape, "integration, correction"))
        _check_status("correction", library().koi_correct(self.handle, flags.ctypes.data))

    def converged(self, limit: float) -> Bools:
        """Which states have a standard deviation below `limit` times the prior's."""
        flags = np.zeros(self.n, np.uint8)
        _check_status("converged", library().koi_converged(self.handle, limit, flags.ctypes.data))
        return flags.astype(bool)

    @property
    def state(self) -> Integrated:
        s = KoiStateStruct()
        library().koi_get(self.handle, s)
        rows = (State.of(np.array(r)) for r in (s.autonomous, s.hybrid))
        sensors = (Sensors.of(x) for x in (s.sensors, s.total))
        (autonomous, hybrid), (now, total) = rows, sensors
        return Integrated(
            t_s=s.t_s,
            autonomous=autonomous,
            hybrid=hybrid,
            sensors=now,
            total=total,
            alone_s=s.alone_s,
            taken={k: _taken(s.last[k]) for k in Kind},
        )

    def solutions(self) -> tuple[Floats, Floats]:
        """Autonomous and hybrid, rows as of State, (15,) each."""
        library().koi_get(self.handle, self._now)
        return np.array(self._now.autonomous), np.array(self._now.hybrid)

    @property
    def x(self) -> Floats:
        return self._numbers((self.n,), 0)

    @property
    def p(self) -> Floats:
        return self._numbers((self.n, self.n), 1)

    @property
    def sd(self) -> Floats:
        return self._numbers((self.n,), 2)

    def _numbers(self, shape: tuple[int, ...], which: int) -> Floats:
        out = np.empty(shape)
        where: list[int | None] = [None, None, None]
        where[which] = out.ctypes.data
        library().koi_covariance(self.handle, *where)
        return out

    def jacobians(self) -> tuple[Floats, Floats]:
        """phi (moving, n) and q (moving, moving) of the last step."""
        moving = library().koi_jacobians(self.handle, None, None)
        phi, q = np.empty((moving, self.n)), np.empty((moving, moving))
        library().koi_jacobians(self.handle, phi.ctypes.data, q.ctypes.data)
        return phi, q


def _taken(s: LastStruct) -> Taken:
    return Taken(
        reason=None if s.reason < 0 else Reason(s.reason),
        accepted_s=s.accepted_s,
        nis=s.nis,
        nis_sum=s.nis_sum,
        nis_dof=s.nis_dof,
        innovation=np.array([[i.value, i.variance] for i in s.innovation]),
        counts={Reason(i): s.counts[i] for i in range(REASONS)},
    )


def _increment_rows(dtheta_rad: Floats, dv_mps: Floats) -> tuple[Floats, Floats]:
    a, v = (np.ascontiguousarray(x, np.float64) for x in (dtheta_rad, dv_mps))
    if a.ndim != 2 or a.shape[1] != 3 or a.shape != v.shape:
        raise BadInput(expected("increments of shapes (n, 3) and (n, 3)", f"{a.shape} and {v.shape}", "integration"))
    return a, v


def _check_status(what: str, status: int) -> int:
    if status < 0:
        raise Refused(f"integration, {what}", status)
    return status
