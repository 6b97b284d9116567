"""`psabench run koi-season`: a unit's flights one after another, each with what the passport has learned by then."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from psabench.errors import BadInput, expected
from psabench.koi.autocal import InstrumentClass, Knowledge, knowledge_after
from psabench.koi.flight_log import FlightLog, begin_flight, end_flight, read_log
from psabench.koi.sensors import instrument_class
from psabench.koi.wire import page
from psabench.koi.wire.params import SCENARIO, KoiOptions, KoiParams
from psabench.koi.wire.run import run_flight
from psabench.koi.wire.specimen import FLIGHT_SEEDS, draw_persistent, flight_scenario
from psabench.link.signals import Floats
from psabench.passport.command import STORE
from psabench.passport.store import PassportStore
from psabench.procedures.head_bench import Progress
from psabench.procedures.result import made_params, option

NAME, UNIT_TYPE = "koi-season", "bins"
FIRST_DAY, BETWEEN = datetime(2026, 1, 5, tzinfo=UTC), timedelta(days=1)  # of the flights (E0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SeasonParams(KoiParams):
    """Parameters of `koi-season`."""

    flights: int = option(8, "", "complete flights of the unit, those of earlier starts included")
    unit: str = option("SP-1", "", "serial number in the passport")
    routes: str = option(SCENARIO, "", "scenarios, with commas between them: flights take turns")

    def __post_init__(self) -> None:
        KoiParams.__post_init__(self)
        if not 1 <= self.flights <= 10_000:
            raise ValueError(expected("1 to 10000", self.flights, "flights"))


@dataclass(frozen=True, slots=True, kw_only=True)
class SeasonOptions:
    """What the command line asked for."""

    out: Path = Path("build/run")
    store: Path = STORE
    seed: int | None = None
    params: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightRow:
    """One flight of a season."""

    number: int  # of all that began, from 1
    verdict: str
    weight: float
    corrected: bool
    hour_error_m: float | None
    unknown: tuple[float, ...]  # persistent errors less what was known of them before it, the first six


@dataclass(frozen=True, kw_only=True)
class Season:
    """Flights that are complete, and the passport after them."""

    params: SeasonParams
    rows: tuple[FlightRow, ...]
    incomplete: int
    known: Knowledge
    persistent: Floats


def run_season(options: SeasonOptions, progress: Progress) -> Season:
    """Fly until so many flights are complete. Each is in OUT/flight-NNN. Raises BadInput, BenchError."""
    p = made_params(SeasonParams, NAME, options.params)
    kind = instrument_class(p.setup().cfg)
    seed = 1 if options.seed is None else options.seed
    persistent = draw_persistent(kind, seed)
    options.out.mkdir(parents=True, exist_ok=True)
    with PassportStore(options.store) as store:
        while complete_flights(log := read_log(store, p.unit)) < p.flights:
            _fly_next(store, log, options, p, kind, persistent, seed, progress)
    known = knowledge_after(kind, p.unit, log.events)
    rows = tuple(_rows_of(options.out))
    return Season(params=p, rows=rows, incomplete=len(log.incomplete), known=known, persistent=persistent)


def complete_flights(log: FlightLog) -> int:
    """That were entered, with weight or without."""
    return len(log.verdicts)


def _fly_next(
    store: PassportStore,
    log: FlightLog,
    options: SeasonOptions,
    p: SeasonParams,
    kind: InstrumentClass,
    persistent: Floats,
    seed: int,
    progress: Progress,
) -> None:
    """Enter its beginning, fly, enter its end. One that is cut off stays a beginning."""
    number = complete_flights(log) + len(log.incomplete) + 1
    routes = [r.strip() for r in p.routes.split(",") if r.strip()]
    if not routes:
        raise BadInput(expected("a scenario", "none", f"{NAME}: routes"))
    out = options.out / f"flight-{number:03d}"
    out.mkdir(parents=True, exist_ok=True)
    flight_scenario(routes[(number - 1) % len(routes)], kind, persistent, out / "scenario.yaml")
    begun = FIRST_DAY + number * BETWEEN
    known = knowledge_after(kind, p.unit, log.events)
    key = begin_flight(store, p.unit, UNIT_TYPE, begun)
    flight = KoiOptions(
        out=out,
        scenario=out / "scenario.yaml",
        seed=FLIGHT_SEEDS * seed + number,
        params=options.params,
    )
    done = run_flight(flight, progress, serial=p.unit, time_s=begun.timestamp(), known=known)
    page.write_page(out, done)
    end_flight(store, UNIT_TYPE, key, done.found.estimate, verdict=done.found.verdict)
    _write_row(out, number, known, persistent)


def _write_row(out: Path, number: int, known: Knowledge, persistent: Floats) -> None:
    """What the season's page needs beside result.json."""
    unknown = (persistent - known.p)[:6].tolist()
    (out / "season.json").write_text(json.dumps({"number": number, "unknown": unknown}) + "\n", encoding="utf-8")


def _rows_of(out: Path) -> list[FlightRow]:
    """Of the folders that hold a whole flight."""
    rows = []
    for folder in sorted(out.glob("flight-*")):
        if not (folder / "season.json").is_file():
            continue
        result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
        told = json.loads((folder / "season.json").read_text(encoding="utf-8"))
        rows.append(
            FlightRow(
                number=told["number"],
                verdict=result["verdict"],
                weight=result["estimate"]["weight"],
                corrected=result["corrected"],
                hour_error_m=(result["truth"] or {}).get("hour_error_m"),
                unknown=tuple(told["unknown"]),
            )
        )
    return rows
