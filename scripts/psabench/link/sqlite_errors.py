"""SQLite's errors as those of a file."""

from __future__ import annotations

import errno
import sqlite3

REMOVED = "moved, removed or replaced while it was written"
ERRNO = {
    sqlite3.SQLITE_FULL: errno.ENOSPC,
    sqlite3.SQLITE_NOTADB: errno.EINVAL,
    sqlite3.SQLITE_ERROR: errno.EINVAL,  # a table of another form
    sqlite3.SQLITE_READONLY: errno.EACCES,
    sqlite3.SQLITE_CANTOPEN: errno.EACCES,
    sqlite3.SQLITE_BUSY: errno.EACCES,
    sqlite3.SQLITE_LOCKED: errno.EACCES,
}


def as_os_error(e: sqlite3.Error) -> OSError:
    """With SQLite's text; EIO for what has no number of its own. SQLite calls a file that has gone read-only."""
    if e.sqlite_errorcode == sqlite3.SQLITE_READONLY_DBMOVED:
        return OSError(errno.ESTALE, REMOVED)
    return OSError(ERRNO.get(e.sqlite_errorcode & 0xFF, errno.EIO), str(e))
