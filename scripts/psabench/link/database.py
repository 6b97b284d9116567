"""An SQLite file of ours: known by its application_id, of one format, changed whole or not at all.

One thread of one process uses a `Database`; several processes may share the file. Errors name the file and what it
should be: BadInput for another program's file, a newer format, damage; OutputError where it cannot be written.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from psabench.errors import BadInput, expected, output_error
from psabench.link.own import sqlite_error

TIMEOUT_S = 60.0  # for another process that writes
_TABLES = "SELECT count(*) FROM sqlite_schema"


@dataclass(frozen=True, kw_only=True)
class Kind:
    """What a file is."""

    what: str  # for people: a store of results
    application: int  # the file's application_id: `file` and we know what it is
    format: int  # the file's user_version
    schema: str  # statements that end with ";\n"
    conversions: Mapping[int, str] = field(default_factory=dict)  # statements, by the format that they read


class Database(AbstractContextManager["Database"]):
    """An open file: `with Database(path, kind) as db: ...`; made when there is none, unless it is only read."""

    def __init__(self, path: Path, kind: Kind, *, read_only: bool = False) -> None:
        self.path, self.kind, self.read_only = path, kind, read_only
        if read_only and not path.is_file():
            raise BadInput(expected(kind.what, "no such file", path))
        try:
            if not read_only:
                path.parent.mkdir(parents=True, exist_ok=True)
            where = f"{path.resolve().as_uri()}?mode={self._open_mode()}"
            self._db = sqlite3.connect(where, uri=True, timeout=TIMEOUT_S, isolation_level=None)
        except (OSError, sqlite3.Error) as e:
            raise BadInput(expected(f"{kind.what} (SQLite)", e, path)) from e
        try:
            self._prepare_file()
        except BaseException:
            self._db.close()
            raise

    def __exit__(self, *_: object) -> None:
        self._db.close()

    def _open_mode(self) -> str:
        """How SQLite opens the file. To read it, it may have to undo what a writer that was killed had begun."""
        if not self.read_only:
            return "rwc"
        return "rw" if os.access(self.path, os.W_OK) else "ro"

    def _prepare_file(self) -> None:
        if self.read_only:
            self.execute_sql("PRAGMA query_only = ON")
            self._check_kind(convert=False)
        else:
            with self.whole_change():
                if (
                    self.first_value("PRAGMA application_id") == 0
                    and self.first_value("SELECT count(*) FROM sqlite_schema") == 0
                ):
                    self._carry_out(self.kind.schema)
                    self.execute_sql(f"PRAGMA application_id = {self.kind.application}")
                    self.execute_sql(f"PRAGMA user_version = {self.kind.format}")
                self._check_kind(convert=True)
        self.execute_sql("PRAGMA foreign_keys = ON")

    def _check_kind(self, *, convert: bool) -> None:
        k = self.kind
        if self.first_value("PRAGMA application_id") != k.application:
            raise BadInput(expected(k.what, "an SQLite file of another program", self.path))
        found = int(self.first_value("PRAGMA user_version"))
        while convert and found in k.conversions:
            self._carry_out(k.conversions[found])
            found += 1
            self.execute_sql(f"PRAGMA user_version = {found}")
        if found != k.format:
            raise BadInput(expected(f"{k.what} of format {k.format}", f"format {found}", self.path))

    def _carry_out(self, statements: str) -> None:
        for statement in statements.split(";\n"):
            self.execute_sql(statement)

    @contextmanager
    def whole_change(self) -> Iterator[None]:
        """All of a block, or nothing; takes the right to write at once, so that it cannot be rejected later."""
        self.execute_sql("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            if self._db.in_transaction:  # a full disk ends it by itself; report that error
                self.execute_sql("ROLLBACK")
            raise
        self.execute_sql("COMMIT")

    def first_value(self, sql: str, *values: Any) -> Any:
        """The first column of the first row."""
        return self.execute_sql(sql, *values).fetchone()[0]

    def execute_sql(self, sql: str, *values: Any) -> sqlite3.Cursor:
        """Carry out one statement."""
        try:
            return self._db.execute(sql, values)
        except sqlite3.OperationalError as e:  # locked, read-only, disk full
            raise output_error(self.path, sqlite_error(e)) from e
        except sqlite3.DatabaseError as e:
            raise BadInput(expected(self.kind.what, f"a damaged or other file ({e})", self.path)) from e
