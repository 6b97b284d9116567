"""The store of results: one SQLite file that says of each number what it was computed from (docs/store.md).

A series is a table of float32 numbers, a row a run, that its origin determines: kind, input, seed, version and build.
Run k of an origin is the same whoever computes it, so a series is filled in parts, in any order, and grows when more
runs are requested. Another build has its own series, never mixed with these. What is written is written
whole: a part lies in the file with its checksum or not at all, whatever ends us. One thread of one process uses a
`Store`; several processes may share the file.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from psabench.errors import BadInput, expected
from psabench.link.database import Database, Kind

CELL = np.dtype("<f4")

Rows = npt.NDArray[np.float32]

SCHEMA = """
CREATE TABLE series (
    id      INTEGER PRIMARY KEY,
    key     TEXT NOT NULL UNIQUE, -- SHA-256 of kind, input, seed, version, build and columns
    kind    TEXT NOT NULL,
    input   TEXT NOT NULL,        -- JSON, keys sorted
    seed    INTEGER NOT NULL,
    version TEXT NOT NULL,
    columns TEXT NOT NULL,        -- JSON, names with their units
    build   TEXT NOT NULL         -- digest of the code that computed it
) STRICT;
CREATE TABLE part (
    series    INTEGER NOT NULL REFERENCES series (id) ON DELETE CASCADE,
    first_run INTEGER NOT NULL,
    runs      INTEGER NOT NULL,
    sha256    BLOB NOT NULL,
    data      BLOB NOT NULL,      -- little-endian float32, a row a run
    PRIMARY KEY (series, first_run)
) STRICT;
"""

KIND = Kind(
    what="a store of results",
    application=0x70736162,  # "psab"
    format=2,
    schema=SCHEMA,
    # Format 1: the same tables, but a series may hold runs of several builds: kept under its old key, for no one.
    conversions={1: ""},
)

_OTHERS = "WHERE kind = ? AND input = ? AND seed = ? AND columns = ? AND key <> ?"


def canonical(value: Any) -> str:
    """JSON that is the same for the same value. Raises ValueError for a number that is not finite."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


@dataclass(frozen=True, kw_only=True)
class Origin:
    """What determines a series."""

    kind: str
    input: Mapping[str, Any]  # of JSON's types
    seed: int
    version: str
    build: str
    columns: tuple[str, ...]

    @cached_property
    def key(self) -> str:
        """SHA-256, 64 hexadecimal digits."""
        whole = canonical([self.kind, self.input, self.seed, self.version, self.build, self.columns])
        return hashlib.sha256(whole.encode()).hexdigest()


@dataclass(frozen=True, kw_only=True)
class Part:
    """Some runs of a series, numbered from `first_run` on; `rows` has a column for each of the origin's."""

    origin: Origin
    first_run: int
    rows: Rows  # (runs, columns)


def _other(o: Origin) -> tuple[Any, ...]:
    """What _OTHERS asks for."""
    return o.kind, canonical(o.input), o.seed, canonical(o.columns), o.key


class Store(AbstractContextManager["Store"]):
    """An open file of results: `with Store(path) as store: ...`; made when there is none.

    Raises BadInput for a file that is not a store, a newer one or a damaged one, and where it cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._db = Database(path, KIND)

    def __exit__(self, *error: object) -> None:
        self._db.__exit__(*error)

    # ---- what there is

    def runs(self, origin: Origin) -> dict[int, int]:
        """Parts that are there: number of runs by first run."""
        found = self._db.execute_sql(
            "SELECT first_run, runs FROM part JOIN series ON series = id WHERE key = ? ORDER BY first_run", origin.key
        )
        return {int(first): int(runs) for first, runs in found}

    def others(self, origin: Origin) -> dict[str, int]:
        """Runs of the same kind, input and seed by another build or version: their number by build."""
        found = self._db.execute_sql(
            f"SELECT build, sum(runs) FROM series JOIN part ON series = id {_OTHERS} GROUP BY build", *_other(origin)
        )
        return {str(build): int(runs) for build, runs in found}

    def rows(self, origin: Origin, runs: int) -> Rows:
        """The first `runs` rows. Raises BadInput where some are missing or damaged."""
        width, at, found = len(origin.columns), 0, []
        parts = self._db.execute_sql(
            "SELECT first_run, runs, sha256, data FROM part JOIN series ON series = id WHERE key = ?"
            " ORDER BY first_run",
            origin.key,
        )
        for first, count, digest, data in parts:
            if at >= runs or first > at:
                break
            whole = len(data) == count * width * CELL.itemsize and hashlib.sha256(data).digest() == digest
            if not whole:
                raise BadInput(expected(f"runs {first} to {first + count - 1} of {origin.kind}", "damage", self.path))
            found.append(np.frombuffer(data, CELL).reshape(count, width)[at - first :])
            at = max(at, first + count)
        if at < runs:
            raise BadInput(expected(f"{runs} runs", at, f"{self.path}: {origin.kind}"))
        return np.concatenate([*found, np.empty((0, width), CELL)])[:runs]

    def origins(self) -> list[Origin]:
        """Of all series, in the order in which they were begun."""
        found = self._db.execute_sql("SELECT kind, input, seed, version, build, columns FROM series ORDER BY id")
        return [
            Origin(
                kind=kind,
                input=json.loads(text),
                seed=seed,
                version=version,
                build=build,
                columns=tuple(json.loads(columns)),
            )
            for kind, text, seed, version, build, columns in found
        ]

    # ---- changes, each whole or not at all

    def put(self, parts: Iterable[Part]) -> None:
        """Add parts, all or none; one that is there already, from the same first run, is replaced."""
        with self._db.whole_change():
            for part in parts:
                self._put(part)

    def _put(self, part: Part) -> None:
        o = part.origin
        if part.rows.ndim != 2 or part.rows.shape[1] != len(o.columns):
            raise ValueError(expected(f"rows of {len(o.columns)} columns", f"shape {part.rows.shape}", o.kind))
        data = np.ascontiguousarray(part.rows, CELL).tobytes()
        self._db.execute_sql(
            "INSERT INTO series (key, kind, input, seed, version, columns, build) VALUES (?, ?, ?, ?, ?, ?, ?)"
            " ON CONFLICT (key) DO NOTHING",
            *(o.key, o.kind, canonical(o.input), o.seed, o.version, canonical(o.columns), o.build),
        )
        self._db.execute_sql(
            "INSERT OR REPLACE INTO part (series, first_run, runs, sha256, data)"
            " VALUES ((SELECT id FROM series WHERE key = ?), ?, ?, ?, ?)",
            *(o.key, part.first_run, len(part.rows), hashlib.sha256(data).digest(), data),
        )

    def forget(self, origin: Origin) -> None:
        """Remove a series with all its parts, if there is one."""
        with self._db.whole_change():
            self._db.execute_sql("DELETE FROM series WHERE key = ?", origin.key)

    def forget_others(self, origin: Origin) -> None:
        """Remove what `others` counts."""
        with self._db.whole_change():
            self._db.execute_sql(f"DELETE FROM series {_OTHERS}", *_other(origin))
