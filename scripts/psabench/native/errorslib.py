"""The part of libpsabench-nav with the errors of a navigating unit, as ctypes sees it. Manual: errors.h."""

from __future__ import annotations

import ctypes as c
from typing import Any

from psabench.native.sinslib import RowsStruct

_D, _I, _P, _V = c.c_double, c.c_int, c.POINTER, c.c_void_p
_DOUBLES = _P(_D)
BLOCKS = ("dr", "dv", "beta", "nu", "theta", "df", "gamma")


class ErrorsConfigStruct(c.Structure):
    """struct nav_errors_cfg."""

    _fields_ = [
        ("vertical", _I),
        ("gauge", _I),
        *[(name, _D) for name in ("damping_per_s", "damping_per_s2", "gyro_noise_radps_rts", "accel_noise_mps2_rts")],
    ]


_CFG = _P(ErrorsConfigStruct)
# Function without its nav_: what it returns, what it takes.
PROTOTYPES: dict[str, tuple[Any, ...]] = {
    "errors_check": (_I, _CFG, _V),
    "errors_layout": (_I, _CFG, _P(RowsStruct)),
    "errors_step": (_I, _CFG, _V, _V, _V, _D, _V, _V),
    "errors_predict": (_I, _CFG, _V, _V, _V, _V, c.c_int64, _D, _P(c.c_int64)),
    "errors_alignment": (_I, _CFG, _V, _V),
}
