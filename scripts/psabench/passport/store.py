"""The store of passports: one SQLite file with units, runs, their results and calibrations (docs/tools/passports.md).

It is not the store of results: that one may be emptied and computed again, a passport may not. A run enters whole, with
all its numbers and what it supersedes, or not at all, whatever ends us.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from psabench.errors import BadInput, expected
from psabench.link.database import Database, Kind
from psabench.thermal.compensation import Compensation, compensation_dict, compensation_of_dict

MOST_SERIAL = 64  # characters

SCHEMA = """
CREATE TABLE unit (
    id     INTEGER PRIMARY KEY,
    serial TEXT NOT NULL UNIQUE,
    type   TEXT NOT NULL            -- mems, quartz, ...
) STRICT;
CREATE TABLE run (
    id          INTEGER PRIMARY KEY,
    unit        INTEGER NOT NULL REFERENCES unit (id),
    number      INTEGER NOT NULL,   -- of the unit's runs, from 1
    method      TEXT NOT NULL,      -- procedure and reading
    begun       TEXT NOT NULL,      -- ISO 8601, UTC
    seed        TEXT,               -- of 64 bits, in decimal digits; NULL: not of an emulator
    version     TEXT NOT NULL,      -- of psabench
    data_sha256 TEXT NOT NULL,      -- of the result that was entered
    within      INTEGER,            -- limits: 1 kept, 0 not, NULL none
    low_c       REAL,               -- temperatures for which it is valid
    high_c      REAL,
    supersedes  INTEGER REFERENCES run (id), -- the latest run of the method that had begun before, as it was entered
    provenance  TEXT NOT NULL,      -- JSON
    UNIQUE (unit, number),
    UNIQUE (unit, data_sha256)
) STRICT;
CREATE TABLE quantity (
    run          INTEGER NOT NULL REFERENCES run (id),
    name         TEXT NOT NULL,
    unit         TEXT NOT NULL,
    value        REAL NOT NULL,
    half_width   REAL NOT NULL,     -- of the 95 % interval, or U (k = 2)
    compensation TEXT,              -- JSON: the quantity against temperature
    PRIMARY KEY (run, name)
) STRICT;
CREATE TABLE covariance (
    run    INTEGER PRIMARY KEY REFERENCES run (id),
    names  TEXT NOT NULL,           -- JSON
    matrix TEXT NOT NULL            -- JSON, rows
) STRICT;
"""

KIND = Kind(what="a store of passports", application=0x70737070, format=1, schema=SCHEMA)  # "pspp"


@dataclass(frozen=True, kw_only=True)
class Measured:
    """One quantity of a run."""

    name: str  # with its unit at the end
    unit: str
    value: float
    half_width: float
    compensation: Compensation | None = None


@dataclass(frozen=True, kw_only=True)
class Covariance:
    """Of some quantities of a run; matrix: (n, n)."""

    names: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]


@dataclass(frozen=True, kw_only=True)
class UnitRun:
    """What a procedure found of a unit."""

    method: str
    begun: str
    version: str
    data_sha256: str
    quantities: tuple[Measured, ...]
    seed: int | None = None
    within: bool | None = None
    range_c: tuple[float, float] | None = None
    covariance: Covariance | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    number: int = 0  # the store gives it
    supersedes: int | None = None  # number of the run that this one replaces; the store gives it

    @property
    def curves(self) -> dict[str, Compensation]:
        """What was fitted against temperature, by the quantity's name."""
        return {q.name: q.compensation for q in self.quantities if q.compensation}


@dataclass(frozen=True, kw_only=True)
class Passport:
    """A unit and its runs, in the order in which they were entered."""

    serial: str
    type: str
    runs: tuple[UnitRun, ...]

    def current_runs(self) -> tuple[UnitRun, ...]:
        """Of each method the one that began last, whenever it was entered."""
        last = {run.method: run for run in sorted(self.runs, key=lambda run: (run.begun, run.number))}
        return tuple(run for run in self.runs if last[run.method] is run)

    def run_of(self, number: int) -> UnitRun:
        """Raises BadInput."""
        for run in self.runs:
            if run.number == number:
                return run
        raise BadInput(expected(f"a run of 1 to {len(self.runs)}", number, self.serial))


class PassportStore(AbstractContextManager["PassportStore"]):
    """An open store: `with PassportStore(path) as store: ...`; made when there is none, unless it is only read.

    Raises BadInput for a file that is not a store, a newer or a damaged one, OutputError where it cannot be written.
    """

    def __init__(self, path: Path, *, read_only: bool = False) -> None:
        self.path = path
        self._db = Database(path, KIND, read_only=read_only)

    def __exit__(self, *error: object) -> None:
        self._db.__exit__(*error)

    # ---- what there is

    def unit_serials(self) -> list[str]:
        """Of all units, in alphabetical order."""
        return [str(row[0]) for row in self._db.execute_sql("SELECT serial FROM unit ORDER BY serial")]

    def read_passport(self, serial: str) -> Passport:
        """Raises BadInput for a unit that is not there."""
        row = self._db.execute_sql("SELECT id, type FROM unit WHERE serial = ?", serial).fetchone()
        if row is None:
            raise BadInput(expected("a serial number of the store", serial, self.path))
        return Passport(serial=serial, type=str(row[1]), runs=tuple(self._runs_of(int(row[0]))))

    def _runs_of(self, unit: int) -> Iterator[UnitRun]:
        found = self._db.execute_sql(
            "SELECT r.id, r.number, r.method, r.begun, r.seed, r.version, r.data_sha256, r.within, r.low_c, r.high_c,"
            " r.provenance, s.number, names, matrix FROM run r LEFT JOIN run s ON r.supersedes = s.id"
            " LEFT JOIN covariance ON covariance.run = r.id WHERE r.unit = ? ORDER BY r.number",
            unit,
        ).fetchall()
        for row, number, method, begun, seed, version, sha, within, low, high, origin, gone, names, matrix in found:
            yield UnitRun(
                number=number,
                method=method,
                begun=begun,
                seed=None if seed is None else int(seed),
                version=version,
                data_sha256=sha,
                within=None if within is None else bool(within),
                range_c=None if low is None else (low, high),
                provenance=json.loads(origin),
                supersedes=gone,
                quantities=tuple(self._quantities_of(row)),
                covariance=None if names is None else _covariance_of(names, matrix),
            )

    def _quantities_of(self, run: int) -> Iterator[Measured]:
        found = self._db.execute_sql(
            "SELECT name, unit, value, half_width, compensation FROM quantity WHERE run = ? ORDER BY rowid", run
        )
        for name, unit, value, half_width, text in found.fetchall():
            where = f"{self.path}: compensation of {name}"
            made = None if text is None else compensation_of_dict(json.loads(text), where)
            yield Measured(name=name, unit=unit, value=value, half_width=half_width, compensation=made)

    # ---- changes, each whole or not at all

    def put_run(self, serial: str, kind: str, run: UnitRun) -> int:
        """Enter a run of a unit, which is made where it is new; the number it has. It supersedes the run of its method
        that began before it. What is there already, the same data of the same unit, is left as it is.

        Raises BadInput for a serial number that is none, or one of another type of unit.
        """
        if not (serial.isprintable() and serial.strip() == serial and 0 < len(serial) <= MOST_SERIAL):
            raise BadInput(expected(f"1 to {MOST_SERIAL} printable characters", repr(serial), "serial number"))
        if _parted_name(serial)[1] is not None:
            raise BadInput(expected("no @ and number at its end, which names a run", repr(serial), "serial number"))
        with self._db.whole_change():
            self._db.execute_sql(
                "INSERT INTO unit (serial, type) VALUES (?, ?) ON CONFLICT (serial) DO NOTHING", serial, kind
            )
            unit, found = self._db.execute_sql("SELECT id, type FROM unit WHERE serial = ?", serial).fetchone()
            if found != kind:
                raise BadInput(expected(f"a unit of type {found}", kind, serial))
            same = self._db.execute_sql(
                "SELECT number FROM run WHERE unit = ? AND data_sha256 = ?", unit, run.data_sha256
            )
            there = same.fetchone()
            return int(there[0]) if there else self._insert_run(int(unit), run)

    def _insert_run(self, unit: int, run: UnitRun) -> int:
        number = int(self._db.first_value("SELECT coalesce(max(number), 0) + 1 FROM run WHERE unit = ?", unit))
        before = self._db.execute_sql(
            "SELECT id FROM run WHERE unit = ? AND method = ? AND begun <= ? ORDER BY begun DESC, number DESC LIMIT 1",
            *(unit, run.method, run.begun),
        ).fetchone()
        low, high = run.range_c or (None, None)
        seed = None if run.seed is None else str(run.seed)
        cursor = self._db.execute_sql(
            "INSERT INTO run (unit, number, method, begun, seed, version, data_sha256, within, low_c, high_c,"
            " supersedes, provenance) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
            *(unit, number, run.method, run.begun, seed, run.version, run.data_sha256, run.within, low, high),
            *(before[0] if before else None, json.dumps(run.provenance, ensure_ascii=False)),
        )
        for q in run.quantities:
            text = None if q.compensation is None else json.dumps(compensation_dict(q.compensation))
            self._db.execute_sql(
                "INSERT INTO quantity (run, name, unit, value, half_width, compensation) VALUES (?, ?, ?, ?, ?, ?)",
                *(cursor.lastrowid, q.name, q.unit, q.value, q.half_width, text),
            )
        if run.covariance:
            names, matrix = json.dumps(run.covariance.names), json.dumps(run.covariance.matrix)
            self._db.execute_sql("INSERT INTO covariance VALUES (?, ?, ?)", cursor.lastrowid, names, matrix)
        return number


def _covariance_of(names: str, matrix: str) -> Covariance:
    rows: Sequence[Sequence[float]] = json.loads(matrix)
    return Covariance(names=tuple(json.loads(names)), matrix=tuple(tuple(row) for row in rows))


def _parted_name(name: str) -> tuple[str, int | None]:
    """SERIAL@NUMBER: both; SERIAL: None for the number."""
    serial, at, number = name.rpartition("@")
    return (serial, int(number)) if at and number.isascii() and number.isdigit() else (name, None)


def find_run(
    store: PassportStore, name: str, suits: Callable[[UnitRun], bool] = lambda _: True, what: str = "a run"
) -> UnitRun:
    """SERIAL@NUMBER: a run; SERIAL: its latest one that suits, `what`. Raises BadInput for what is not there."""
    serial, number = _parted_name(name)
    passport = store.read_passport(serial)
    if number is not None:
        return passport.run_of(number)
    found = [run for run in passport.current_runs() if suits(run)]
    if not found:
        raise BadInput(expected(what, "none", serial))
    return max(found, key=lambda run: (run.begun, run.number))
