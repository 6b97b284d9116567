"""The part of libpsabench-nav that calibrates strapdown units, as ctypes sees it. Manuals: kf.h, sins.h."""

from __future__ import annotations

import ctypes as c
from typing import Any

_D, _I, _P = c.c_double, c.c_int, c.POINTER
_DOUBLES = _P(_D)
BLOCKS = ("beta", "walk", "nu", "theta", "df", "gamma", "lever", "quad", "delay", "delta", "tau", "eps", "beta0")


def _named_doubles(*names: str) -> list[tuple[str, Any]]:
    return [(name, _D) for name in names]


class SinsConfigStruct(c.Structure):
    """struct nav_sins_cfg."""

    _fields_ = [
        *_named_doubles("latitude_rad", "gravity_mps2", "sample_s", "step_s"),
        *[(name, _I) for name in ("form", "gauge", "lever", "stand", "base", "walk", "clone")],
        ("beta_sd_rad", _D * 3),
        *_named_doubles("nu_sd_radps", "theta_scale_sd", "theta_angle_sd_rad", "df_sd_mps2", "gamma_scale_sd"),
        *_named_doubles("gamma_angle_sd_rad", "lever_sd_m", "quad_sd_s2pm", "delay_sd_s", "delta_sd_rad", "tau_sd_s"),
        *_named_doubles("eps_sd_rad", "walk_sd_radps"),
        *_named_doubles("walk_tau_s", "gyro_noise_radps_rts", "accel_noise_mps2_rts", "accel_noise_multiplier"),
        *_named_doubles("stand_sd_rad", "stand_noise_rate_hz", "stand_interval_s", "stand_guard_s"),
    ]


class RowsStruct(c.Structure):
    """struct nav_sins_rows."""

    _fields_ = [("offset", _I), ("size", _I)]


class ParamsStruct(c.Structure):
    """struct nav_sins_params."""

    _fields_ = [
        ("nu_radps", _D * 3),
        ("theta", _D * 9),
        ("df_mps2", _D * 3),
        ("gamma", _D * 9),
        ("lever_m", _D * 9),
        ("quadratic_s2pm", _D * 3),
        ("delay_s", _D),
        ("delta_rad", _D * 3),
        ("tau_s", _D),
        ("eps_rad", _D * 3),
    ]


class TurnStruct(c.Structure):
    """struct nav_sins_turn."""

    _fields_ = [("axis_b", _D * 3), ("rate_radps", _D), ("duration_s", _D), ("remount", _I)]


class InnovationStruct(c.Structure):
    """struct nav_kf_innovation."""

    _fields_ = _named_doubles("value", "variance")


class StateStruct(c.Structure):
    """struct nav_sins_state."""

    _fields_ = [
        ("t_s", _D),
        ("params", ParamsStruct),
        ("c_nb", _D * 9),
        ("c0_nb", _D * 9),
        *_named_doubles("nis_accel", "nis_stand"),
        *[(name, c.c_int64) for name in ("count_accel", "count_stand", "stand_left_out")],
        ("last", InnovationStruct * 6),
    ]


_V, _REFUSAL = c.c_void_p, c.c_void_p
# Function without its nav_: what it returns, what it takes.
PROTOTYPES: dict[str, tuple[Any, ...]] = {
    "kf_bytes": (c.c_size_t,),
    "kf_start": (_I, _V, c.c_size_t, _I, _I, _I, _P(_V)),
    "kf_set": (_I, _V, _DOUBLES, _DOUBLES),
    "kf_get": (_I, _V, _DOUBLES, _DOUBLES),
    "kf_predict": (_I, _V, _DOUBLES, _DOUBLES),
    "kf_update": (_I, _V, _DOUBLES, _DOUBLES, _DOUBLES, _I, _P(InnovationStruct)),
    "kf_innovate": (_I, _V, _DOUBLES, _D, _D, _P(InnovationStruct)),
    "kf_smooth": (_I, _I, _I, *[_DOUBLES] * 6),
    "kf_nees": (_D, _I, _DOUBLES, _DOUBLES),
    "sins_default": (None, _P(SinsConfigStruct)),
    "sins_check": (_I, _P(SinsConfigStruct), _REFUSAL),
    "sins_layout": (_I, _P(SinsConfigStruct), _P(RowsStruct)),
    "sins_block_name": (c.c_char_p, _I),
    "sins_prior": (_I, _P(SinsConfigStruct), _DOUBLES),
    "sins_to_gauge": (_I, _I, _P(ParamsStruct), _DOUBLES),
    "sins_bytes": (c.c_size_t,),
    "sins_start": (_I, _V, c.c_size_t, _P(SinsConfigStruct), _DOUBLES, _I, _P(_V)),
    "sins_about": (_I, _V, _P(ParamsStruct)),
    "sins_stand": (_I, _V, _D, _DOUBLES),
    "sins_samples": (_I, _V, _D, _DOUBLES, _DOUBLES, _I),
    "sins_plan": (_I, _V, _P(TurnStruct), _I),
    "sins_again": (_I, _V),
    "sins_get": (_I, _V, _P(StateStruct)),
    "sins_covariance": (_I, _V, _DOUBLES, _DOUBLES),
    "sins_jacobians": (_I, _V, _DOUBLES, _DOUBLES, _DOUBLES),
}
