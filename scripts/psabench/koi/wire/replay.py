"""`psabench koi replay`: recorded flights again, without and with what a passport knows: the article's own study."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from psabench.errors import BadInput, expected
from psabench.koi.autocal import Knowledge, RollBack, knowledge_after, standing_flights
from psabench.koi.flight_log import read_log
from psabench.koi.sensors import instrument_class
from psabench.koi.wire.params import TRUTH_LOG, KoiParams
from psabench.koi.wire.recording import read_setup
from psabench.koi.wire.run import grade_feed, read_flight
from psabench.native.nav import Refused
from psabench.passport.store import PassportStore
from psabench.procedures.head_bench import Progress

WHERE = "koi replay"


@dataclass(frozen=True, slots=True, kw_only=True)
class Replayed:
    """One recorded flight, twice."""

    folder: Path
    without_m: float  # the largest autonomous error within an hour
    with_m: float
    seen: bool  # the estimates are of this flight, too, or of later ones


def read_estimates(given: str, unit: str, p: KoiParams) -> Knowledge:
    """PASSPORT[@N]: what is known of the unit after its N-th complete flight, or after all. Raises BadInput."""
    name, at, number = given.rpartition("@")
    path = Path(name if at and number.isdecimal() else given)
    if not path.is_file():
        raise BadInput(expected("a store of passports", "none", path))
    kind = instrument_class(p.setup().cfg)
    with PassportStore(path, read_only=True) as store:
        if unit not in store.unit_serials():
            raise BadInput(expected(f"one of {', '.join(store.unit_serials()) or 'no units'}", unit, f"{path}: --unit"))
        events = list(read_log(store, unit).events)
    if at and number.isdecimal():
        events.append(RollBack(int(number)))
    try:
        known = knowledge_after(kind, unit, events)
        if not standing_flights(events):
            raise BadInput(expected("complete flights of the unit", "none", f"{path}: {unit}"))
        return known
    except ValueError as e:
        raise BadInput(f"{given}: {e}") from None


def replay_flights(folders: Sequence[Path], known: Knowledge, p: KoiParams, progress: Progress) -> Iterator[Replayed]:
    """Each as soon as it is done. Raises BadInput for a folder without a truth to compare with."""
    for folder in folders:
        if not (folder / TRUTH_LOG).is_file():
            raise BadInput(expected(f"a recorded flight with {TRUTH_LOG}", "none", folder))
        errors = list[float]()
        with progress.step(str(folder), 2) as advance:
            for now in (None, known):
                errors.append(_hour_error_m(folder, now, p))
                advance(f"{errors[-1]:.0f} m")
        seen = known.time_s is not None and float(read_setup(folder).get("time_s", math.inf)) <= known.time_s
        yield Replayed(folder=folder, without_m=errors[0], with_m=errors[1], seen=seen)


def _hour_error_m(folder: Path, known: Knowledge | None, p: KoiParams) -> float:
    serial, time_s = ("unit", 0.0) if known is None else (known.serial, known.time_s or 0.0)
    try:
        feed = read_flight(folder, p, p.setup(serial, time_s, known))
        found = feed.finish()
    except Refused as e:
        raise BadInput(f"{folder}: {e}") from e
    graded = grade_feed(feed, found, folder)
    if graded is None:
        raise BadInput(expected("a truth of the flight's time", "none", folder))
    return graded.hour_error_m(found.take_off_s)


def replay_lines(rows: Sequence[Replayed]) -> Iterator[str]:
    """A line each flight; the root mean square of all."""
    for r in rows:
        seen = "; its own estimates, or later ones, are among them" if r.seen else ""
        yield f"{r.folder}: autonomous {r.without_m:.0f} m without, {r.with_m:.0f} m with estimates{seen}"
    rms = [math.sqrt(sum(x * x for x in m) / len(m)) for m in ([r.without_m for r in rows], [r.with_m for r in rows])]
    yield f"rms of {len(rows)}: {rms[0]:.0f} m without, {rms[1]:.0f} m with: {rms[0] / rms[1]:.2f} times"
