"""A unit's flights in its passport (docs/tools/passports.md): each enters twice, when it begins and when it is over.

Both entries are whole or not at all. A flight during which the program ends or the power is lost, or which another one
follows, has only begun: it is incomplete and has no weight. Nothing is ever changed: a roll-back is an entry, too.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any

import numpy as np

from psabench.errors import BadInput, expected
from psabench.koi.autocal import FlightEstimate, RollBack, standing_flights
from psabench.passport.store import Covariance, Measured, PassportStore, UnitRun

BEGUN, OVER, BACK = "koi-flight begun", "koi-flight", "koi-flight roll-back"


@dataclass(frozen=True, kw_only=True)
class FlightLog:
    """What a passport says of a unit's flights. A roll-back counts numbers of complete flights, from 1."""

    events: tuple[FlightEstimate | RollBack, ...]
    incomplete: tuple[str, ...]  # beginnings without an end
    verdicts: tuple[str, ...]  # of each complete flight: why it has no weight, or nothing


def begin_flight(store: PassportStore, serial: str, kind: str, begun: datetime) -> str:
    """Enter a flight that begins; its key. Raises BadInput for a time that is not later than the last beginning."""
    key, before = _iso_time(begun), _keys_of(store, serial, BEGUN)
    if before and datetime.fromisoformat(key) <= datetime.fromisoformat(before[-1]):
        raise BadInput(expected(f"a beginning after {before[-1]}", key, serial))
    _put_entry(store, serial, kind, BEGUN, key, {})
    return key


def end_flight(store: PassportStore, kind: str, key: str, found: FlightEstimate, *, verdict: str = "") -> None:
    """Enter what a flight that has begun found. Names end with their units. verdict: why it has no weight.

    Raises BadInput for one that has not begun, is over or began at another time, for a weight that its verdict denies.
    """
    if bool(verdict) != (found.weight == 0.0):
        what = "weight 0" if verdict else "a verdict for weight 0"
        raise BadInput(expected(what, f"weight {found.weight:g}, verdict {verdict!r}", found.serial))
    if key not in (begun := _keys_of(store, found.serial, BEGUN)):
        raise BadInput(expected("a flight that has begun", key, found.serial))
    if key != begun[-1]:
        raise BadInput(expected(f"the last flight, {begun[-1]}", key, found.serial))
    if key in _keys_of(store, found.serial, OVER):
        raise BadInput(expected("a flight that is not over", key, found.serial))
    if found.time_s != (begun_s := datetime.fromisoformat(key).timestamp()):
        raise BadInput(expected(f"a flight that began at {begun_s} s", found.time_s, found.serial))
    sd = np.sqrt(np.diag(found.covariance))
    quantities = tuple(
        Measured(name=name, unit="", value=float(x), half_width=2.0 * float(s))
        for name, x, s in zip(found.names, found.x, sd, strict=True)
    )
    covariance = Covariance(names=found.names, matrix=tuple(tuple(row) for row in found.covariance.tolist()))
    more = {"weight": found.weight, "verdict": verdict}
    _put_entry(store, found.serial, kind, OVER, key, more, quantities, covariance)


def roll_back(store: PassportStore, serial: str, kind: str, number: int, now: datetime) -> None:
    """Flights after this one of the complete ones count no longer. Raises BadInput for one that has not been."""
    log = read_log(store, serial)
    try:
        standing_flights((*log.events, RollBack(number)))
    except ValueError as e:
        raise BadInput(f"{serial}: {e}") from None
    _put_entry(store, serial, kind, BACK, _iso_time(now), {"number": number})


def read_log(store: PassportStore, serial: str) -> FlightLog:
    """In the order in which things were entered. Raises BadInput for an entry that does not describe a flight."""
    events, verdicts, open_keys = list[FlightEstimate | RollBack](), list[str](), list[str]()
    for run in _flight_runs(store, serial):
        where = f"{store.path}: {serial}@{run.number}"
        try:
            key = str(run.provenance["flight"])
            if run.method == BEGUN:
                open_keys.append(key)
            elif run.method == BACK:
                events.append(RollBack(int(run.provenance["number"])))
            else:
                open_keys.remove(key)
                events.append(_estimate_of(serial, run, where))
                verdicts.append(str(run.provenance["verdict"]))
        except KeyError as e:
            raise BadInput(expected(f"an entry of a flight with the key {e}", "none", where)) from None
        except (TypeError, ValueError) as e:
            raise BadInput(expected("an entry of a flight", e, where)) from None
    return FlightLog(events=tuple(events), incomplete=tuple(open_keys), verdicts=tuple(verdicts))


def _estimate_of(serial: str, run: UnitRun, where: str) -> FlightEstimate:
    if run.covariance is None:
        raise BadInput(expected("a covariance", "none", where))
    return FlightEstimate(
        serial=serial,
        names=run.covariance.names,
        time_s=datetime.fromisoformat(run.begun).timestamp(),
        x=np.array([q.value for q in run.quantities]),
        covariance=np.array(run.covariance.matrix),
        weight=float(run.provenance["weight"]),
    )


def _flight_runs(store: PassportStore, serial: str) -> list[UnitRun]:
    if serial not in store.unit_serials():
        return []
    return [run for run in store.read_passport(serial).runs if run.method in (BEGUN, OVER, BACK)]


def _keys_of(store: PassportStore, serial: str, method: str) -> list[str]:
    return [str(run.provenance["flight"]) for run in _flight_runs(store, serial) if run.method == method]


def _put_entry(
    store: PassportStore,
    serial: str,
    kind: str,
    method: str,
    key: str,
    more: dict[str, Any],
    quantities: tuple[Measured, ...] = (),
    covariance: Covariance | None = None,
) -> None:
    provenance = {"flight": key, **more}
    values = [[q.name, q.value] for q in quantities]
    text = json.dumps([method, provenance, values, covariance.matrix if covariance else None], sort_keys=True)
    run = UnitRun(
        method=method,
        begun=key,
        version=version("psabench"),
        data_sha256=hashlib.sha256(text.encode()).hexdigest(),
        quantities=quantities,
        covariance=covariance,
        provenance=provenance,
    )
    store.put_run(serial, kind, run)


def _iso_time(when: datetime) -> str:
    if when.tzinfo is None:
        raise BadInput(expected("a time with its zone", when, "flight"))
    return when.astimezone(UTC).isoformat()
