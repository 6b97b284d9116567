"""Output files: one writing process, and errors that name the file and what it holds.

The lock is advisory (flock); the kernel releases it when the process ends. A lock of fcntl() would end when the
process closes any descriptor of the file, and SQLite uses those locks itself. The emulator locks its recordings in the
same way. Devices and pipes are not locked.
"""

from __future__ import annotations

import errno
import fcntl
import glob
import io
import os
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from typing_extensions import Buffer

from psabench.errors import BadInput, expected, output_error

LOCKS = Path("/proc/locks")  # proc(5): `1: FLOCK ADVISORY WRITE 708 00:13:26 0 EOF`, the last number the inode


class Owned:
    """A file that this process alone writes, through descriptors of its own."""

    def __init__(self, path: Path) -> None:
        """Raises BadInput when another process writes the file or it cannot be made, OutputError for a full disk."""
        self.path = path
        self._fd: int | None = None
        if path.exists() and not path.is_file() and not path.is_dir():
            return
        try:
            self._fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        except OSError as e:
            raise output_error(path, e) from e
        try:
            fcntl.flock(self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as e:
            pid = owner(self._fd)
            got = f"one of pid {pid}" if pid else "one of another process"
            self.release()
            raise BadInput(expected("a file that no other process writes", got, path)) from e

    def gone(self) -> bool:
        """True if the path no longer names this file."""
        if self._fd is None:
            return False
        try:
            return not os.path.samestat(os.fstat(self._fd), os.stat(self.path))
        except FileNotFoundError:
            return True

    def release(self) -> None:
        """Unlock the file. Does nothing the second time."""
        if self._fd is not None:
            os.close(self._fd)
        self._fd = None


def owner(fd: int) -> int | None:
    """Process that holds flock's lock of an open file; None when there is none, or it is in another PID namespace."""
    st = os.fstat(fd)
    device = f"{os.major(st.st_dev):02x}:{os.minor(st.st_dev):02x}"
    found: dict[bool, int] = {}
    for line in LOCKS.read_text(encoding="ascii").splitlines():
        _, kind, _, _, pid, where, *_ = line.replace("-> ", "").split()
        on, _, inode = where.rpartition(":")
        if kind == "FLOCK" and int(inode) == st.st_ino and int(pid) > 0:
            found[on == device] = int(pid)  # some file systems show another device than stat() does
    return found.get(True, found.get(False))


class Unstored(OSError):
    """The file did not take what was written; not an error of whoever writes into it."""


class OutputFile(io.FileIO):
    """An unbuffered file. A write takes all of the data or raises Unstored."""

    def write(self, data: Buffer, /) -> int:
        view, done = memoryview(data), 0
        try:
            while done < len(view):
                done += super().write(view[done:]) or 0
        except OSError as e:
            raise Unstored(e.errno, e.strerror) from e
        return done

    def sync(self) -> None:
        """Wait until the disk has the data. Raises Unstored."""
        try:
            os.fsync(self.fileno())
        except OSError as e:
            raise Unstored(e.errno, e.strerror) from e


@contextmanager
def output_text(path: Path, stored: Callable[[], str] = str, *, append: bool = False) -> Iterator[IO[str]]:
    """Open a UTF-8 text file for writing, without translation of line ends; an earlier file is replaced, or continued.

    stored: what the file holds, for the error message. Raises BadInput and OutputError as Owned does, when the file
    cannot take all of the text, and when it was moved or removed. On return the disk has the data.
    """
    owned = Owned(path)
    try:
        with (
            _opened(path, append) as raw,
            io.TextIOWrapper(io.BufferedWriter(raw), encoding="utf-8", newline="") as file,
        ):
            yield file
            file.flush()
            if path.is_file():
                raw.sync()
            if owned.gone():
                raise Unstored(errno.ESTALE, "moved")
    except Unstored as e:
        raise output_error(path, e, stored()) from e
    finally:
        owned.release()


def _opened(path: Path, append: bool) -> OutputFile:
    try:
        return OutputFile(path, "a" if append else "w")
    except OSError as e:
        raise output_error(path, e) from e


def replace_file(path: Path, text: str) -> None:
    """Replace a file atomically: readers see the old text or the new text.

    Devices and pipes are written directly. Raises BadInput for a path that cannot be written, OutputError for a full
    disk.
    """
    path = Path(os.path.realpath(path))  # a link stays one
    draft = path.with_name(f"{path.name}.{os.getpid()}.part")
    _remove_dead_drafts(path)
    try:
        if path.exists() and not os.access(path, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        if path.exists() and not path.is_file():
            path.write_text(text, encoding="utf-8")
            return
        draft.write_text(text, encoding="utf-8")
        os.replace(draft, path)
    except OSError as e:
        raise output_error(path, e, "not written") from e
    finally:
        with suppress(OSError):
            draft.unlink()


def _remove_dead_drafts(path: Path) -> None:
    """Of processes that were killed before their draft became the file."""
    for draft in path.parent.glob(f"{glob.escape(path.name)}.*.part"):
        pid = draft.name.removeprefix(f"{path.name}.").removesuffix(".part")
        if pid.isdecimal() and not _is_alive(int(pid)):
            with suppress(OSError):
                draft.unlink()


def _is_alive(pid: int) -> bool:
    """Whether there is such a process; of one that is none of ours, too."""
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True
    return True


SQLITE_ERRNO = {
    sqlite3.SQLITE_FULL: errno.ENOSPC,
    sqlite3.SQLITE_NOTADB: errno.EINVAL,
    sqlite3.SQLITE_ERROR: errno.EINVAL,  # a table of another form
    sqlite3.SQLITE_READONLY: errno.EACCES,
    sqlite3.SQLITE_CANTOPEN: errno.EINVAL,
    sqlite3.SQLITE_BUSY: errno.EINVAL,
    sqlite3.SQLITE_LOCKED: errno.EINVAL,
}


def sqlite_error(e: sqlite3.Error) -> OSError:
    """SQLite's error as one of a file: ESTALE for a file that has moved, EIO for what is not in SQLITE_ERRNO."""
    if e.sqlite_errorcode == sqlite3.SQLITE_READONLY_DBMOVED:
        return OSError(errno.ESTALE, str(e))
    return OSError(SQLITE_ERRNO.get(e.sqlite_errorcode & 0xFF, errno.EIO), str(e))
