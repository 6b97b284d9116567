"""libpsabench-nav as ctypes sees it: declared here, in `sinslib`, `errorslib` and `koilib`, used
by `nav`, `nav_mc`, `sins`. Manual: nav.h."""

from __future__ import annotations

import ctypes as c
from functools import cache
from typing import Any, TypeVar

from psabench.native.errorslib import PROTOTYPES as ERRORS_PROTOTYPES
from psabench.native.koilib import PROTOTYPES as KOI_PROTOTYPES
from psabench.native.shared_library import SharedLibrary
from psabench.native.sinslib import PROTOTYPES as SINS_PROTOTYPES

ABI = 1  # NAV_ABI of the header that this was written from
NAME = f"libpsabench-nav.so.{ABI}"
MAX_POSITIONS = 64

_D, _I, _U64 = c.c_double, c.c_int, c.c_uint64
_DOUBLES = c.POINTER(c.c_double)


Structure = TypeVar("Structure", bound=c.Structure)


def _doubles(*names: str) -> list[tuple[str, Any]]:
    return [(name, _D) for name in names]


def filled(kind: type[Structure], value: object) -> Structure:
    """A structure from the attributes of the names of its fields."""
    return kind(*(getattr(value, name) for name, *_ in kind._fields_))


class PositionStruct(c.Structure):
    """struct nav_position."""

    _fields_ = _doubles("s_radps", "delta_rad", "beta_rad", "gamma_rad", "t_mid_s", "window_s")


class NoiseStruct(c.Structure):
    """struct nav_noise."""

    _fields_ = _doubles(
        "gm_sigma_radps",
        "gm_tau_s",
        "white_radps_rts",
        "window_sd_radps",
        "angle_sd_rad",
        "level_sd_rad",
        "latitude_sd_rad",
    )


class RefusalStruct(c.Structure):
    """struct nav_refusal."""

    _fields_ = [
        ("status", _I),
        ("position", _I),
        ("value", _D),
        ("field", c.c_char_p),
        ("want", c.c_char_p),
    ]


class FitStruct(c.Structure):
    """struct nav_gyrocompass_cfg."""

    _fields_ = [
        ("latitude_rad", _D),
        ("method", _I),
        ("simplified", _I),
        ("ramp", _I),
        ("noise", NoiseStruct),
    ]


class CompassStruct(c.Structure):
    """struct nav_compass."""

    _fields_ = [
        *_doubles("alpha1_rad", "alpha1_sd_rad", "alpha1_half95_rad", "platform_sd_rad"),
        *_doubles("drift1_radps", "drift1_sd_radps", "ramp_radps2", "s", "c", "quality", "geometry"),
        ("residual_rms_radps", _D),
        ("cov", _D * 9),
        ("flags", c.c_uint32),
        ("iterations", _I),
    ]


class AttitudeStruct(c.Structure):
    """struct nav_attitude."""

    _fields_ = _doubles("pitch_rad", "roll_rad", "gamma_bias_rad", "residual_rms_rad")


class RestStruct(c.Structure):
    """struct nav_rest."""

    _fields_ = _doubles(
        "latitude_rad",
        "latitude_error_rad",
        "alpha_rad",
        "gamma_rad",
        "drift1_radps",
        "m1_per_s",
        "torquer_scale1",
        "beta_error_rad",
        "gamma_error_rad",
    )


class HoldStruct(c.Structure):
    """struct nav_hold."""

    _fields_ = [
        *_doubles("heading_sd_rad", "drift_sd_radps", "gm_sigma_radps", "gm_tau_s"),
        ("gm_from_zero", _I),
    ]


class McStruct(c.Structure):
    """struct nav_mc_cfg."""

    _fields_ = [
        *_doubles("latitude_rad", "latitude_error_rad", "tilt_rad"),
        ("tilt", _I),
        ("cardan", _I),
        *_doubles("alpha1_rad", "drift1_radps", "gm_sigma_radps", "gm_tau_s"),
        ("gm_from_zero", _I),
        *_doubles("torquer_scale", "m1_per_s", "beta_sys_rad", "gamma_sys_rad", "beta_random_rad"),
        *_doubles("gamma_random_rad", "angle_sys_rad", "angle_random_rad"),
        ("angle_sys", _I),
        ("random_sign", _I),
        ("per_sample", _I),
        *_doubles("white_radps_rts", "sample_s"),
        ("count", _I),
        ("angle_rad", _D * MAX_POSITIONS),
        *_doubles("window_s", "gap_s", "slew_radps", "settle_s"),
        ("fit", FitStruct),
        *_doubles("gm_before_s"),
    ]


class McOutStruct(c.Structure):
    """struct nav_mc_out."""

    _fields_ = [(name, _DOUBLES) for name in ("platform_rad", "heading_rad", "drift_radps", "alpha1_rad", "quality")]


class McHoldStruct(c.Structure):
    """struct nav_mc_hold_cfg."""

    _fields_ = [
        ("start", McStruct),
        ("axis2", _I),
        *_doubles("axis2_sd_radps", "heading_rad", "drift_error_radps", "hours", "step_s", "wait_s", "level_rad"),
        *_doubles("latitude_error_rad", "v_east_mps", "speed_error"),
    ]


class McHoldOutStruct(c.Structure):
    """struct nav_mc_hold_out."""

    _fields_ = [("end_rad", _DOUBLES), ("max_rad", _DOUBLES)]


class StrapdownStruct(c.Structure):
    """struct nav_strapdown; `at` is struct nav_state as a row."""

    _fields_ = [("at", _D * 15), ("dtheta_rad", _D * 3), ("dv_mps", _D * 3), ("vertical", _I)]


_P = c.POINTER
_RANGE = (_U64, _U64, _U64)

# Function without its nav_: what it returns, what it takes.
PROTOTYPES: dict[str, tuple[Any, ...]] = {
    "abi": (_I,),
    "version": (c.c_char_p,),
    "status_text": (c.c_char_p, _I),
    "flag_text": (c.c_char_p, c.c_uint32),
    "gyrocompass": (_I, _P(PositionStruct), _I, _P(FitStruct), _P(CompassStruct)),
    "gyrocompass_check": (_I, _P(PositionStruct), _I, _P(FitStruct), _P(RefusalStruct)),
    "gyrocompass_printed": (_I, _P(PositionStruct), _D, _DOUBLES, _DOUBLES),
    "attitude_from_level": (_I, _DOUBLES, _DOUBLES, _DOUBLES, _I, _I, _P(AttitudeStruct)),
    "alpha": (_D, _D, _D, _D, _D, _D),
    "gamma": (_D, _D, _D, _D, _D, _D),
    "cardan": (_I, _DOUBLES, _DOUBLES, _I, _D, _D, _DOUBLES),
    "heading": (_D, _D, _D, _D, _D, _D),
    "window_slope": (_I, _DOUBLES, _DOUBLES, _I, _D, _DOUBLES),
    "rest_s_radps": (_D, _P(RestStruct), _DOUBLES),
    "azimuth_drift": (_D, _D, _D, _D, _D, _D),
    "azimuth_drift_sd": (_D, _D, _D, _D, _D),
    "transport_radps": (_D, _D, _D),
    "gm_integral_sd_rad": (_D, _D, _D, _D, _I),
    "hold_sd_rad": (_D, _P(HoldStruct), _D),
    "gm_window_cov": (_D, _D, _D, _D, _D, _D),
    "mc_default": (None, _P(McStruct)),
    "mc_check": (_I, _P(McStruct), _I, _P(RefusalStruct)),
    "mc_hold_check": (_I, _P(McHoldStruct), _P(RefusalStruct)),
    "mc_closed": (_I, _P(McStruct), *_RANGE, _P(McOutStruct)),
    "mc_samples": (_I, _P(McStruct), *_RANGE, _P(McOutStruct)),
    "mc_hold_default": (None, _P(McHoldStruct)),
    "gravity_mps2": (_D, _D, _D),
    "radii_m": (None, _D, _D, _DOUBLES, _DOUBLES),
    "dcm": (None, _D, _D, _D, c.c_void_p),
    "dcm_angles": (None, c.c_void_p, _DOUBLES, _DOUBLES, _DOUBLES),
    "integrate": (_I, _P(StrapdownStruct), *(c.c_void_p,) * 2, c.c_int64, _D, c.c_void_p, _P(c.c_int64)),
    "mc_hold": (_I, _P(McHoldStruct), *_RANGE, _P(McHoldOutStruct)),
}


class NavLibrary(SharedLibrary):
    """The functions of nav.h, nav_mc.h, kf.h, sins.h, strapdown.h, errors.h and koi.h."""

    abi, prefix, variable, prototypes = (
        ABI,
        "nav_",
        "PSABENCH_NAV_LIB",
        PROTOTYPES | SINS_PROTOTYPES | ERRORS_PROTOTYPES | KOI_PROTOTYPES,
    )


@cache
def library() -> NavLibrary:
    """The library of this process, loaded at the first use. Raises BadInput when it is nowhere or of another ABI."""
    return NavLibrary.load(NAME)
