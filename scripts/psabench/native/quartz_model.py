"""The emulator's quartz accelerometers without a board, through libpsabench: run-in of a production batch.

What is returned is what an instrument on the bench would show: readings with the noise of the reading. Truth is apart,
for grading alone. Unit k of a seed is the same whatever the range.
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

from psabench.errors import BadInput, expected
from psabench.native.clib import QuartzJobStruct, library

Array = npt.NDArray[np.float64]

POSITIONS = ("+x", "-x", "+y", "-y")  # of g; PSABENCH_QUARTZ_POSITIONS
MOST_CYCLES = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """What is done with each unit; defaults: the article's cycle, the rest E0 as of scenario quartz_chamber."""

    cycles: int = 5
    cold_degc: float = -60.0
    hot_degc: float = 85.0
    read_degc: float = 30.0
    ramp_k_per_min: float = 1.0
    soak_min: float = 60.0
    rest_min: float = 120.0
    reading_s: float = 1.0
    g_mps2: float = 9.8094
    noise_a_rthz: float = 4.0e-10
    play_k: float = 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class Readings:
    """Mean current of each position and the standard deviation of that mean, A: (units, cycles + 1, positions)."""

    mean_a: Array
    sd_a: Array


def read_units(s: Schedule, batch: Mapping[str, float], seed: int, first_serial: int, units: int) -> Readings:
    """Readings of these serial numbers. Raises BadInput."""
    mean_a, sd_a, _ = _call_model(s, batch, (seed, first_serial, units), with_truth=False)
    return Readings(mean_a=mean_a, sd_a=sd_a)


def true_terms(s: Schedule, batch: Mapping[str, float], seed: int, first_serial: int, units: int) -> Array:
    """Truth, for grading: bias in ug, scale in A for one g, tilt of the input axis to y in mrad: (units, starts, 3)."""
    return _call_model(s, batch, (seed, first_serial, units), with_truth=True)[2]


def _call_model(
    s: Schedule, batch: Mapping[str, float], which: tuple[int, int, int], *, with_truth: bool
) -> tuple[Array, Array, Array]:
    seed, first_serial, units = which
    starts = s.cycles + 1
    mean_a, sd_a = np.empty((units, starts, len(POSITIONS))), np.empty((units, starts, len(POSITIONS)))
    truth = np.empty((units, starts, 3)) if with_truth else np.empty((0, starts, 3))
    own = {"size": c.sizeof(QuartzJobStruct), "seed": seed, "first_serial": first_serial, "units": units}
    job = QuartzJobStruct(**asdict(s), **own)
    numbers = np.array(list(batch.values()), float)
    pointers = (_pointer_of(mean_a), _pointer_of(sd_a), _pointer_of(truth) if with_truth else None)
    if library().quartz_run_in(c.byref(job), _pointer_of(numbers), len(numbers), *pointers) < 0:
        raise BadInput(expected("a schedule and a batch that the model takes", asdict(s), "quartz batch"))
    return mean_a, sd_a, truth


def _pointer_of(a: Array) -> c._Pointer[c.c_double]:
    return a.ctypes.data_as(c.POINTER(c.c_double))
