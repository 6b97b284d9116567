"""One process writes a file, and an error of writing names it: what was stored is said, nothing is lost in silence.

The lock is flock's (advisory): the kernel drops it when the process ends, however it ends. fcntl's would end with the
first descriptor of the file that this process closes, and SQLite unlocks it by itself. The emulator takes the same lock
on what it records: each refuses a file of the other. Devices and pipes are not locked: they have any number of writers.
"""

from __future__ import annotations

import errno
import fcntl
import io
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from typing_extensions import Buffer

from psabench.errors import BadInput, OutputError, expected, output_error

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
        """True when the name leads to another file or to none: what is written from now on cannot be found."""
        if self._fd is None:
            return False
        try:
            return not os.path.samestat(os.fstat(self._fd), os.stat(self.path))
        except FileNotFoundError:
            return True

    def release(self) -> None:
        """Another process may write the file now. Harmless once more."""
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


class _Unstored(OSError):
    """The file did not take what was written."""


class _File(io.FileIO):
    """A file whose errors differ from those of whoever writes into it."""

    def write(self, data: Buffer, /) -> int:
        try:
            return super().write(data) or 0
        except OSError as e:
            raise _Unstored(e.errno, e.strerror) from e

    def sync(self) -> None:
        try:
            os.fsync(self.fileno())
        except OSError as e:
            raise _Unstored(e.errno, e.strerror) from e


@contextmanager
def output_text(path: Path, stored: Callable[[], str] = str) -> Iterator[IO[str]]:
    """A text file to write, UTF-8, its ends of line as they are written; an earlier one is replaced.

    stored: what of it is in the file, for the message of an error. Raises BadInput and OutputError as Owned does, and
    when the file cannot take all or has been removed. A file that is complete is with the disk.
    """
    owned = Owned(path)
    try:
        with _opened(path) as raw, io.TextIOWrapper(io.BufferedWriter(raw), encoding="utf-8", newline="") as file:
            yield file
            file.flush()
            if path.is_file():
                raw.sync()
            check_there(owned, stored)
    except _Unstored as e:
        raise output_error(path, e, stored()) from e
    finally:
        owned.release()


def _opened(path: Path) -> _File:
    try:
        return _File(path, "w")
    except OSError as e:
        raise output_error(path, e) from e


def check_there(owned: Owned, stored: Callable[[], str] = str) -> None:
    """Raises OutputError when the file has gone; stored: what had been written into it."""
    if owned.gone():
        text = f"{owned.path}: moved, removed or replaced while it was written"
        raise OutputError("; ".join(filter(None, (text, stored()))))


def replace_file(path: Path, text: str) -> None:
    """Write a file in one stroke for whoever reads: it is there whole, or as it was before.

    A device or a pipe is written as it is. Raises BadInput for a path that cannot be written, OutputError for a full
    disk.
    """
    path = Path(os.path.realpath(path))  # a link stays one
    draft = path.with_name(f"{path.name}.{os.getpid()}.part")
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
