"""Which seasons there are to fly, and the store that they go to (docs/store.md): a row a unit, a series a season.

What a unit does without receiver and altimeter having a say does not depend on what is wrong with the receiver, so the
mode `none` has one series for all conditions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path

import numpy as np

from psabench.campaign import builds
from psabench.campaign.store import CELL, Origin, Part, Store
from psabench.campaign.workers import Workers
from psabench.errors import BenchError
from psabench.koi.fleet.conditions import USUAL
from psabench.koi.fleet.grade import COLUMNS
from psabench.koi.fleet.season import MODES, Season, fly_season
from psabench.link.signals import Floats
from psabench.native import clib
from psabench.procedures.head_bench import Progress

HARM_MODES = ("none", "both")  # of a condition: what it costs is asked, not by which of both


@dataclass(frozen=True, slots=True, kw_only=True)
class Fleet:
    """What a campaign flies."""

    classes: tuple[str, ...]
    conditions: tuple[str, ...]
    units: int
    flights: int
    seed: int

    def season(self, unit_class: str, condition: str, mode: str) -> Season:
        """The series that holds it."""
        condition = USUAL if mode == "none" else condition
        return Season(unit_class=unit_class, condition=condition, mode=mode, flights=self.flights, seed=self.seed)

    def seasons(self) -> list[Season]:
        """Each once."""
        found = [
            self.season(name, condition, mode)
            for condition in self.conditions
            for name in self.classes
            for mode in (MODES if condition == USUAL else HARM_MODES)
        ]
        return list(dict.fromkeys(found))


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """One unit of a season."""

    season: Season
    unit: int


@cache
def own_digest() -> str:
    """SHA-256 of both libraries and of the code that takes part."""
    return builds.digest([Path(clib.library().path), *builds.sources("psabench.koi.fleet.season")]) + builds.algebra()


def own_build() -> str:
    """What a worker and we must have in common to compute the same."""
    return f"psabench {version('psabench')}, build {builds.short(own_digest())}"


def make_origin(s: Season) -> Origin:
    """Of the series of the store."""
    return Origin(
        kind="koi fleet",
        input={name: value for name, value in asdict(s).items() if name != "seed"},
        seed=s.seed,
        version=f"psabench {version('psabench')}",
        build=own_digest(),
        columns=tuple(f"{name}, flight {k + 1}" for k in range(s.flights) for name in COLUMNS),
    )


def compute_unit(w: Wanted) -> Part:
    """The work of a worker: some ten seconds."""
    row = fly_season(w.season, w.unit).reshape(1, -1).astype(CELL)
    return Part(origin=make_origin(w.season), first_run=w.unit, rows=row)


def list_missing(fleet: Fleet, store: Store) -> list[Wanted]:
    """Unit by unit, so that an interrupted campaign has whole units."""
    seasons = fleet.seasons()
    there = {s: store.runs(make_origin(s)) for s in seasons}
    every = (Wanted(season=s, unit=unit) for unit in range(fleet.units) for s in seasons)
    return [w for w in every if w.unit not in there[w.season]]


def fill_store(wanted: Sequence[Wanted], store: Store, at_work: Workers, progress: Progress) -> None:
    """Compute and store; what is stored stays, whatever ends it."""
    with progress.step(f"seasons, {at_work.count} at once", len(wanted)) as done:
        for part in at_work.map(compute_unit, iter(wanted)):
            if part.origin.build != own_digest():
                raise BenchError("koi: psabench was rebuilt during the run; start the campaign again")
            store.put([part])
            done()


def load_rows(s: Season, store: Store, units: int) -> Floats:
    """Of the first units, (units, flights, columns). Raises BadInput where some are missing."""
    rows = store.rows(make_origin(s), units).astype(np.float64)
    return rows.reshape(units, s.flights, len(COLUMNS))
