"""Errors of a navigating strapdown unit along its way: errors.h of libpsabench-nav, from Python.

n is east, north, up, b the unit's axes. Errors are measured less true: dr in m, dv in m/s, beta of Chat = (I + [beta
x]) C, then the sensors' constants. A way is rows of states as `psabench.native.strapdown` gives them, and mean rates
and forces of the steps.
"""

from __future__ import annotations

import ctypes as c
from dataclasses import dataclass

import numpy as np

from psabench.errors import expected
from psabench.native.errorslib import BLOCKS, ErrorsConfigStruct
from psabench.native.kalman import Kalman
from psabench.native.nav import Floats, Refused
from psabench.native.navlib import RefusalStruct, library
from psabench.native.sins import Gauge
from psabench.native.sinslib import RowsStruct
from psabench.native.strapdown import ROW


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorsConfig:
    """The model (struct nav_errors_cfg). Noise: standard deviation of a mean over 1 s."""

    height_fixed: bool = True
    gauge: Gauge = Gauge.ARTICLE
    damping_per_s: float = 0.0
    damping_per_s2: float = 0.0
    gyro_noise_radps_rts: float = 0.0
    accel_noise_mps2_rts: float = 0.0

    def as_struct(self) -> ErrorsConfigStruct:
        """What the library takes."""
        return ErrorsConfigStruct(
            int(self.height_fixed),
            int(self.gauge),
            *(self.damping_per_s, self.damping_per_s2, self.gyro_noise_radps_rts, self.accel_noise_mps2_rts),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """Steps of dt_s, one behind the other."""

    dt_s: float
    states: Floats  # (n, 15) at the start of each step
    w_b_radps: Floats  # (n, 3) means, in inertial space
    f_b_mps2: Floats  # (n, 3)

    def __len__(self) -> int:
        return len(self.states)

    def part(self, first: int, last: int) -> Way:
        """Steps first to last - 1."""
        s = slice(first, last)
        return Way(dt_s=self.dt_s, states=self.states[s], w_b_radps=self.w_b_radps[s], f_b_mps2=self.f_b_mps2[s])


def error_layout(cfg: ErrorsConfig) -> dict[str, slice]:
    """Where each block is in the state. Raises Refused."""
    rows, why, struct = (RowsStruct * len(BLOCKS))(), RefusalStruct(), cfg.as_struct()
    if (status := library().errors_check(struct, c.byref(why))) < 0:
        raise Refused("error model", status, why)
    library().errors_layout(struct, rows)
    return {name: slice(r.offset, r.offset + r.size) for name, r in zip(BLOCKS, rows, strict=True)}


def error_step(cfg: ErrorsConfig, way: Way, k: int) -> tuple[Floats, Floats]:
    """phi (moving, n) and q of step k. Raises Refused."""
    rows = error_layout(cfg)
    moving, n = rows["nu"].start, rows["gamma"].stop
    phi, q = np.empty((moving, n)), np.empty((moving, moving))
    at = (_double_rows(a, size)[k : k + 1].ctypes.data for a, size in _way_arrays(way))
    _check_status(library().errors_step(cfg.as_struct(), *at, way.dt_s, phi.ctypes.data, q.ctypes.data), "step", k)
    return phi, q


def predict_errors(cfg: ErrorsConfig, kf: Kalman, way: Way) -> None:
    """All steps of a way through a filter. Raises Refused, with the step."""
    done, arrays = c.c_int64(), [_double_rows(a, size) for a, size in _way_arrays(way)]
    at = (a.ctypes.data for a in arrays)
    status = library().errors_predict(cfg.as_struct(), kf.handle, *at, len(way), way.dt_s, c.byref(done))
    _check_status(status, "step", done.value)


def alignment_rows(cfg: ErrorsConfig, state: Floats) -> Floats:
    """beta (3, n) by the constants after levelling and gyrocompassing at rest in this state. Raises Refused."""
    out = np.empty((3, error_layout(cfg)["gamma"].stop))
    _check_status(
        library().errors_alignment(cfg.as_struct(), _double_rows(state[None], ROW).ctypes.data, out.ctypes.data),
        "alignment",
        0,
    )
    return out


def _way_arrays(way: Way) -> tuple[tuple[Floats, int], ...]:
    return (way.states, ROW), (way.w_b_radps, 3), (way.f_b_mps2, 3)


def _double_rows(a: Floats, size: int) -> Floats:
    a = np.ascontiguousarray(a, np.float64)
    if a.ndim != 2 or a.shape[1] != size:
        raise ValueError(expected(f"rows of {size}", a.shape, "error model"))
    return a


def _check_status(status: int, what: str, k: int) -> None:
    if status < 0:
        raise Refused(f"error model, {what} {k}", status)
