"""Run-in of a production batch on the emulator's sensor model, as a workstation measures it.

Each start gives the mean current of four positions. From them follow scale, bias and base with their type A
uncertainties; truth takes no part. A unit is a row of the store, numbered by its serial number less one: the same
whoever computes it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path

import numpy as np

from psabench.campaign import builds
from psabench.campaign.store import CELL, Origin, Part, Rows, Store
from psabench.campaign.workers import Workers, spread
from psabench.errors import BenchError
from psabench.native import clib, quartz_model
from psabench.native.quartz_model import Readings, Schedule
from psabench.procedures.head_bench import Progress
from psabench.quartz.batch import QUANTITIES, UNITS, Batch
from psabench.quartz.plate import Array

NOMINAL_A_PER_G = 1.28e-3  # to which scale errors are related
ARCSEC_PER_RAD = 3600.0 * 180.0 / np.pi
TASK_S = 0.4  # long beside the 2 ms that a Dask task costs
ALONE_S = 4.0  # starting a cluster takes about as long


@dataclass(frozen=True, slots=True, kw_only=True)
class RunIn:
    """What determines the numbers of a batch."""

    schedule: Schedule
    batch: Batch
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Chain:
    """How units are measured; functions of a module, so that they travel to workers."""

    name: str
    part_units: int  # of a part in the store: what an interrupt may cost
    unit_s: float  # one unit, one core: only how work is cut depends on it
    digest: Callable[[], str]  # of all that computes
    measure: Callable[[RunIn, int, int], tuple[Array, Array]]  # first serial number and units -> as estimate_units


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """Units that a worker should compute."""

    what: RunIn
    chain: Chain
    first: int
    units: int


# ---- from readings to estimates


def estimate_units(r: Readings) -> tuple[Array, Array]:
    """Values and their standard uncertainties, type A, (units, starts, 3) each: bias in ug, error of the scale in ppm
    of its nominal value, base (tilt of the input axis to the pendulous axis) in arcsec.

    With the currents I of g along +x, -x, +y, -y: S = (I1 - I2)/2, bias = (I1 + I2)/(2 S), base = (I3 - I4)/(2 S). The
    four means are independent; the scale's own uncertainty does not count beside them in bias and base."""
    i, u = np.moveaxis(r.mean_a, -1, 0), np.moveaxis(r.sd_a, -1, 0)
    scale_a = 0.5 * (i[0] - i[1])
    u_x, u_y = 0.5 * np.hypot(u[0], u[1]), 0.5 * np.hypot(u[2], u[3])
    bias = 0.5 * (i[0] + i[1]) / scale_a
    base_rad = 0.5 * (i[2] - i[3]) / scale_a
    values = (1e6 * bias, 1e6 * (scale_a / NOMINAL_A_PER_G - 1.0), ARCSEC_PER_RAD * base_rad)
    uncertain = (1e6 * u_x / scale_a, 1e6 * u_x / NOMINAL_A_PER_G, ARCSEC_PER_RAD * u_y / scale_a)
    return np.stack(values, axis=-1), np.stack(uncertain, axis=-1)


def true_values(what: RunIn, units: int) -> Array:
    """The same quantities as they are, for grading: (units, starts, 3)."""
    t = quartz_model.true_terms(what.schedule, what.batch, what.seed, 1, units)
    scale_ppm = 1e6 * (t[..., 1] / NOMINAL_A_PER_G - 1.0)
    return np.stack([t[..., 0], scale_ppm, ARCSEC_PER_RAD * 1e-3 * t[..., 2]], axis=-1)


# ---- rows of the store


def column_names(cycles: int) -> tuple[str, ...]:
    """A value for each start and quantity, then the uncertainty of each."""
    names = [f"{q}_{UNITS[q]} after {n}" for n in range(cycles + 1) for q in QUANTITIES]
    return (*names, *(f"u of {name}" for name in names))


def make_origin(what: RunIn, chain: Chain) -> Origin:
    """Of the series of the store."""
    return Origin(
        kind=f"run-in, {chain.name}",
        input={"schedule": asdict(what.schedule), "batch": dict(what.batch)},
        seed=what.seed,
        version=own_version(),
        build=chain.digest(),
        columns=column_names(what.schedule.cycles),
    )


def own_version() -> str:
    """Of what computes here."""
    return f"psabench {version('psabench')}"


def name_build(chain: Chain) -> str:
    """What a worker and we must have in common to compute the same."""
    return f"{own_version()}, build {builds.short(chain.digest())}"


def compute_parts(wanted: Sequence[Wanted]) -> list[Part]:
    """The work of a worker. Raises BadInput for a schedule that the model does not take."""
    return [Part(origin=make_origin(w.what, w.chain), first_run=w.first, rows=_unit_rows(w)) for w in wanted]


def _unit_rows(w: Wanted) -> Rows:
    found = w.chain.measure(w.what, 1 + w.first, w.units)
    return np.concatenate([e.reshape(w.units, -1) for e in found], axis=1).astype(CELL)


# ---- the sensor model


@cache
def model_digest() -> str:
    """SHA-256 of libpsabench and of the host's code that takes part."""
    return builds.digest([Path(clib.library().path), *builds.sources("psabench.quartz.run_in")])


def measure_model(what: RunIn, first_serial: int, units: int) -> tuple[Array, Array]:
    """Estimates from the readings of the sensor model."""
    return estimate_units(quartz_model.read_units(what.schedule, what.batch, what.seed, first_serial, units))


MODEL = Chain(name="sensor model", part_units=500, unit_s=1.4e-4, digest=model_digest, measure=measure_model)


# ---- the store


def load_rows(what: RunIn, chain: Chain, store: Store, units: int) -> tuple[Array, Array]:
    """Values and uncertainties of a complete series, (units, starts, 3) each."""
    rows = store.rows(make_origin(what, chain), units).astype(np.float64)
    shape = (2, units, what.schedule.cycles + 1, len(QUANTITIES))
    values, uncertain = rows.reshape(units, 2, -1).swapaxes(0, 1).reshape(shape)
    return values, uncertain


def list_missing(what: RunIn, chain: Chain, units: int, store: Store) -> list[Wanted]:
    """Parts that the store lacks."""
    there, many = store.runs(make_origin(what, chain)), chain.part_units
    firsts = range(0, units, many)
    parts = [Wanted(what=what, chain=chain, first=k, units=min(many, units - k)) for k in firsts]
    return [w for w in parts if there.get(w.first, 0) < w.units]


def cut_tasks(wanted: Sequence[Wanted]) -> Iterator[Sequence[Wanted]]:
    """Parts together, so that each task is worth sending."""
    for piece in spread([w.units * w.chain.unit_s for w in wanted], TASK_S):
        yield wanted[piece]


def fill_store(wanted: Sequence[Wanted], store: Store, at_work: Workers, progress: Progress) -> None:
    """Compute and store; what is stored stays, whatever ends it."""
    chain = wanted[0].chain
    with progress.step(f"{chain.name}, {at_work.count} at once, {chain.part_units} units a step", len(wanted)) as done:
        for parts in at_work.map(compute_parts, cut_tasks(wanted)):
            if any(p.origin.build != chain.digest() for p in parts):
                raise BenchError("run-in: psabench was rebuilt during the run; start the campaign again")
            store.put(parts)
            for _ in parts:
                done()
