"""SQLite logs of python-can (table `messages`), opened for reading alone and checked row by row.

The table has no column for FD: a frame of more than 8 bytes is one; its bit rate switch and error state are not kept.
A damaged file may name one page many times: rows whose numbers do not rise end it.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import can

from psabench.errors import BadInput, expected

MOST_CELL = 1 << 16  # bytes of a text or blob, and of a row
MOST_CLASSIC = 8  # bytes of data
COLUMNS = "rowid, ts, arbitration_id, extended, remote, error, dlc, data"
DAMAGE = (sqlite3.Error, ValueError, TypeError, OverflowError)


def read_db(path: Path) -> Iterator[can.Message]:
    """Frames in the order of their rows. Raises BadInput for a damaged file, after the frames before it."""
    n = last = 0
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as db:
            db.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MOST_CELL)
            db.execute("PRAGMA trusted_schema = OFF")
            _check_schema(db)
            for row, *values in db.execute(f"SELECT {COLUMNS} FROM messages"):
                if n and row <= last:
                    raise ValueError(expected(f"a row behind {last}", row))
                message = _frame_of(*values)
                n, last = n + 1, row
                yield message
    except DAMAGE as e:
        raise BadInput(f"{path}: message {n + 1}: {' '.join(str(e).split())[:160]}") from e


def _check_schema(db: sqlite3.Connection) -> None:
    """`messages` is a plain table: a view or a virtual table could have rows without end. Raises ValueError."""
    found = db.execute("SELECT sql FROM sqlite_master WHERE name = 'messages' AND type = 'table'").fetchone()
    words = str(found[0]).upper().split() if found else []
    if words[:2] != ["CREATE", "TABLE"]:
        raise ValueError(expected("the table messages of python-can", "none" if not found else " ".join(words[:3])))


def _frame_of(t_s: Any, can_id: Any, extended: Any, remote: Any, error: Any, length: Any, data: Any) -> can.Message:
    """Raises ValueError, TypeError."""
    m = can.Message(
        arbitration_id=can_id,
        is_extended_id=bool(extended),
        is_remote_frame=bool(remote),
        is_error_frame=bool(error),
        is_fd=length > MOST_CLASSIC,
        dlc=length,
        data=data,
        check=True,
    )
    m.timestamp = float(t_s)  # which python-can's check would not let be negative
    return m
