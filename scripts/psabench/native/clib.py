"""libpsabench as ctypes sees it: for the modules beside it only. The header is its manual."""

from __future__ import annotations

import ctypes as c
from functools import cache
from typing import Any

from psabench.native.shared_library import SharedLibrary

ABI = 0  # PSABENCH_ABI of the header that PROTOTYPES was written from
NAME = f"libpsabench.so.{ABI}"

WATCH = c.CFUNCTYPE(None, c.c_void_p, c.c_void_p, c.c_int, c.c_int, c.c_int64)
INTERRUPT = c.CFUNCTYPE(None, c.c_void_p, c.c_void_p, c.c_int)
DEADLINE = c.CFUNCTYPE(None, c.c_void_p, c.c_void_p)
INPUT = c.CFUNCTYPE(c.c_double, c.c_void_p, c.c_void_p, c.c_int, c.c_int64)


class FrameStruct(c.Structure):
    """struct psabench_frame."""

    _fields_ = [
        ("size", c.c_uint32),
        ("seq", c.c_uint32),
        ("t_sample_ns", c.c_int64),
        ("t_int_fall_ns", c.c_int64),
        ("t_int_rise_ns", c.c_int64),
        ("code", c.c_int32 * 3),
        ("word", c.c_uint32 * 4),
        ("temp_code", c.c_uint16),
        ("temp_channel", c.c_uint8),
        ("status", c.c_uint8),
    ]


class QuartzJobStruct(c.Structure):
    """struct psabench_quartz_job."""

    _fields_ = [
        ("size", c.c_uint32),
        ("cycles", c.c_uint32),
        ("seed", c.c_uint64),
        ("first_serial", c.c_uint32),
        ("units", c.c_uint32),
        ("g_mps2", c.c_double),
        ("noise_a_rthz", c.c_double),
        ("cold_degc", c.c_double),
        ("hot_degc", c.c_double),
        ("read_degc", c.c_double),
        ("ramp_k_per_min", c.c_double),
        ("soak_min", c.c_double),
        ("rest_min", c.c_double),
        ("reading_s", c.c_double),
        ("play_k", c.c_double),
    ]


class FlightJobStruct(c.Structure):
    """struct psabench_flight_job."""

    _fields_ = [
        ("size", c.c_uint32),
        ("legs", c.c_uint32),
        ("place", c.c_double * 3),
        ("plan", c.c_double * 4),
        ("baro", c.c_double * 4),
        ("leg", c.c_void_p),
    ]


FRAME = c.CFUNCTYPE(None, c.c_void_p, c.c_void_p, c.POINTER(FrameStruct))

_DOUBLES = c.POINTER(c.c_double)
_INT, _LEVEL, _TIME, _TEXT, _PTR = c.c_int, c.c_int, c.c_int64, c.c_char_p, c.c_void_p

# Function without its psabench_: what it returns, what it takes.
PROTOTYPES: dict[str, tuple[Any, ...]] = {
    "abi": (_INT,),
    "version": (_TEXT,),
    "new": (_PTR, c.c_uint64),
    "free": (None, _PTR),
    "error_text": (_TEXT, _PTR),
    "now_ns": (_TIME, _PTR),
    "next_ns": (_TIME, _PTR),
    "run_until": (_INT, _PTR, _TIME),
    "run_for": (_INT, _PTR, _TIME),
    "deadline": (_INT, _PTR, _TIME, DEADLINE, _PTR),
    "vcd": (_INT, _PTR, _TEXT),
    "vcd_close": (_INT, _PTR),
    "part_new": (_PTR, _PTR, _TEXT, _TEXT, _TEXT),
    "options": (_TEXT, _TEXT),
    "parts": (_TEXT,),
    "of": (_PTR, _PTR),
    "part_name": (_TEXT, _PTR),
    "pin": (_INT, _PTR, _TEXT),
    "pin_name": (_TEXT, _PTR, _INT),
    "pin_is_input": (_INT, _PTR, _INT),
    "set": (_INT, _PTR, _INT, _LEVEL),
    "get": (_INT, _PTR, _INT),
    "watch": (_INT, _PTR, _INT, WATCH, _PTR),
    "run_until_level": (_INT, _PTR, _INT, _LEVEL, _TIME),
    "run_until_edge": (_INT, _PTR, _INT, _INT, _TIME),
    "on_interrupt": (_INT, _PTR, _INT, _INT, INTERRUPT, _PTR),
    "mask": (_INT, _PTR, _INT),
    "run_until_interrupt": (_INT, _PTR, _TIME),
    "set_input": (_INT, _PTR, INPUT, _PTR),
    "set_volts": (_INT, _PTR, _INT, c.c_double),
    "play_bits": (_INT, _PTR, _TEXT, c.c_size_t, _INT),
    "spi": (_INT, _PTR, _TEXT, _PTR, c.c_size_t),
    "spi_clock": (_INT, _PTR, c.c_uint32, _TIME),
    "peek": (_INT, _PTR, c.c_uint),
    "counter": (_TEXT, _PTR, _INT, c.POINTER(c.c_uint64)),
    "count": (_TIME, _PTR, _TEXT),
    "violation": (_TEXT, _PTR, _INT, c.POINTER(c.c_uint64)),
    "check": (_INT, _PTR),
    "on_frame": (_INT, _PTR, FRAME, _PTR),
    "board_read": (_INT, _PTR, c.c_uint, c.c_uint, _TIME),
    "board_write": (_INT, _PTR, c.c_uint, c.c_uint, c.c_uint8, _TIME),
    "quartz_run_in": (_INT, c.POINTER(QuartzJobStruct), _DOUBLES, c.c_size_t, _DOUBLES, _DOUBLES, _DOUBLES),
    "flight_new": (_PTR, c.POINTER(FlightJobStruct), _TEXT, c.c_size_t),
    "flight_free": (None, _PTR),
    "flight_key": (_TEXT, c.c_uint),
    "flight_leg_ns": (_TIME, _PTR, c.c_uint),
    "flight_states": (_INT, _PTR, c.POINTER(_TIME), c.c_size_t, _DOUBLES),
    "flight_increments": (_INT, _PTR, _TIME, _TIME, c.c_size_t, _DOUBLES),
}


class Library(SharedLibrary):
    """The functions of psabench.h and psabench_models.h."""

    abi, prefix, variable, prototypes = ABI, "psabench_", "PSABENCH_LIB", PROTOTYPES


@cache
def library() -> Library:
    """The library of this process, loaded at the first use. Raises BadInput when it is nowhere or of another ABI."""
    return Library.load(NAME)
