"""The part of libpsabench-nav that integrates a unit with a satellite receiver, as ctypes sees it. Manual: koi.h."""

from __future__ import annotations

import ctypes as c
from typing import Any

from psabench.native.sinslib import InnovationStruct, RowsStruct

_D, _I, _L, _P, _V = c.c_double, c.c_int, c.c_int64, c.POINTER, c.c_void_p
_DOUBLES = _P(_D)
BLOCKS = ("dr", "dV", "alpha", "beta3", "vertical", "baro", "slow_r", "slow_v", "nu", "df", "gamma", "theta", "dt")
KINDS, REASONS = 4, 11
ROW = 15


def _named_doubles(*names: str) -> list[tuple[str, Any]]:
    return [(name, _D) for name in names]


class KoiConfigStruct(c.Structure):
    """struct nav_koi_cfg."""

    _fields_ = [
        *_named_doubles("sample_s", "step_s"),
        ("form", _I),
        ("gauge", _I),
        ("alignment_s", _D),
        ("dr_sd_m", _D * 3),
        ("dv_sd_mps", _D * 3),
        *_named_doubles("alpha_sd_rad", "beta3_sd_rad", "nu_sd_radps", "nu_run_radps", "df_sd_mps2", "df_run_mps2"),
        *_named_doubles("gamma_scale_sd", "gamma_angle_sd_rad", "theta_scale_sd", "theta_angle_sd_rad"),
        *_named_doubles("dt1_sd_s", "dt2_sd_s", "baro_sd_m", "gyro_noise_radps_rts", "accel_noise_mps2_rts"),
        *_named_doubles("nu_walk_radps_rts", "df_walk_mps2_rts", "baro_walk_m_rts"),
        ("position_sd_m", _D * 3),
        ("velocity_sd_mps", _D * 3),
        *_named_doubles("stop_sd_mps", "height_sd_m", "damping_per_s", "damping_per_s2"),
        ("gate_nis", _D * 2),
        *_named_doubles("outlier_nis", "max_age_s"),
        ("antenna_m", _D * 3),
        ("reopen_s", _D),
        *[(name, _D * 3) for name in ("slow_r_sd_m", "slow_v_sd_mps")],
        ("slow_s", _D),
    ]


class SensorsStruct(c.Structure):
    """struct nav_koi_sensors."""

    _fields_ = [("nu_radps", _D * 3), ("theta", _D * 9), ("df_mps2", _D * 3), ("gamma", _D * 9)]


class MeasurementStruct(c.Structure):
    """struct nav_koi_measurement."""

    _fields_ = [("kind", _I), ("valid", _I), ("t_s", _D), ("value", _D * 3), ("sd", _D * 3)]


class LastStruct(c.Structure):
    """struct nav_koi_last."""

    _fields_ = [
        ("reason", _I),
        *_named_doubles("t_s", "accepted_s", "nis", "nis_sum"),
        ("innovation", InnovationStruct * 3),
        ("nis_dof", _L),
        ("counts", _L * REASONS),
    ]


class KoiStateStruct(c.Structure):
    """struct nav_koi_state; states as rows."""

    _fields_ = [
        ("t_s", _D),
        ("autonomous", _D * ROW),
        ("hybrid", _D * ROW),
        ("sensors", SensorsStruct),
        ("total", SensorsStruct),
        ("alone_s", _D),
        ("last", LastStruct * KINDS),
    ]


_CFG = _P(KoiConfigStruct)
# Function without its nav_: what it returns, what it takes.
PROTOTYPES: dict[str, tuple[Any, ...]] = {
    "koi_default": (_I, _I, _CFG),
    "koi_check": (_I, _CFG, _V),
    "koi_layout": (_I, _CFG, _P(RowsStruct)),
    "koi_block_name": (c.c_char_p, _I),
    "koi_reason_text": (c.c_char_p, _I),
    "koi_prior": (_I, _CFG, _V, _V),
    "koi_coarse": (_I, _V, _V, _L, _D, _D, _V, _V, _DOUBLES),
    "koi_bytes": (c.c_size_t,),
    "koi_start": (_I, _V, c.c_size_t, _CFG, _D, _V, _V, _V, _P(SensorsStruct), _P(_V)),
    "koi_push": (_I, _V, _V, _V, _L),
    "koi_take": (_I, _V, _P(MeasurementStruct)),
    "koi_correct": (_I, _V, _V),
    "koi_converged": (_I, _V, _D, _V),
    "koi_get": (_I, _V, _P(KoiStateStruct)),
    "koi_covariance": (_I, _V, _V, _V, _V),
    "koi_jacobians": (_I, _V, _V, _V),
}
