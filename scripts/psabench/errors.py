"""What can go wrong, and the exit status each kind gives the command line.

Every message says what, where, and what would be right. Bad arguments of functions are plain `ValueError`.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

# What the machine lacks; any other reason why a file cannot be written lies in the path that the user gave.
MACHINE = {errno.ESTALE, errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EMFILE, errno.ENFILE, errno.ENOMEM}
PROGRAM_FAULT = 70  # exit status of an exception of no kind below: EX_SOFTWARE of sysexits.h
# What was found at a path or a port, for `expected`; any other error of the system in its own words.
FOUND = {
    errno.ENOENT: "no such file",
    errno.EISDIR: "a folder",
    errno.ENOTDIR: "a file among the folders of the path",
    errno.EACCES: "one without permission",
    errno.EPERM: "one without permission",
    errno.EROFS: "a read-only file system",
    errno.ELOOP: "a loop of links",
    errno.ENAMETOOLONG: "too long a name",
    errno.EEXIST: "a file",  # of mkdir(), which takes a folder that is there
    errno.ENXIO: "a socket, or a pipe without a reader",
    errno.ENOTTY: "a file that is no terminal",
    errno.ECONNREFUSED: "one that no process serves",
    errno.EADDRINUSE: "one in use",
    errno.ENETUNREACH: "none",
}


def expected(what: str, got: object = None, where: object = "") -> str:
    """The text of an error about an input: `<where>: expected <what>, got <value>`.

    got: None leaves the last part out. where: "" when the caller's prefix says it.
    """
    text = f"expected {what}" if got is None else f"expected {what}, got {got}"
    return f"{where}: {text}" if where else text


class BenchError(Exception):
    """A device or the bench failed; the base of all others."""

    exit_status = 3


class BadInput(BenchError):
    """The user's input (file, option, name) cannot be used."""

    exit_status = 2


class OutputError(BenchError):
    """The machine could not store an output: full disk, quota, device error, file moved or removed."""


def path_found(e: Exception) -> str:
    """What there was in place of a file or a port, by the error it gave: for `expected`."""
    if isinstance(e, UnicodeDecodeError):
        return "bytes that are not UTF-8"
    number = _errno_of(e)
    return FOUND.get(number) or getattr(e, "strerror", None) or (os.strerror(number) if number else _in_one_line(e))


def _in_one_line(e: Exception) -> str:
    return " ".join(str(e).split())[:160]


def _errno_of(e: BaseException | None) -> int:
    """Of the error, or of those that led to it: pySerial and python-can wrap them. 0: none has one."""
    while e is not None:
        number = getattr(e, "errno", None) or next(iter(e.args), None)
        if isinstance(number, int) and number > 0:
            return number
        e = e.__cause__ or e.__context__
    return 0


def input_error(where: object, what: str, e: Exception) -> BadInput:
    """The error of a file that could not be read; what it should be: "a CAN log"."""
    return BadInput(expected(what, path_found(e), where))


def check_there(path: Path, what: str) -> None:
    """Raises BadInput, as `input_error`, where there is no file: before anything is printed. Does not open it."""
    try:
        if stat.S_ISDIR(os.stat(path).st_mode):
            raise IsADirectoryError(errno.EISDIR, "")
    except OSError as e:
        raise input_error(path, what, e) from e


def output_error(where: object, e: OSError, stored: str = "") -> BenchError:
    """The error of a file that could not be written: OutputError, or BadInput where another path would do.

    stored: what of it is on the disk.
    """
    if e.errno == errno.ESTALE:
        text = f"{where}: moved, removed or replaced while it was written"
    elif e.errno in MACHINE:
        text = f"{where}: {e.strerror or e}"
    else:
        what = "a folder" if e.errno == errno.EEXIST else "a path that can be written"
        text = expected(what, "no such folder" if e.errno == errno.ENOENT else path_found(e), where)
    kind = OutputError if e.errno in MACHINE else BadInput
    return kind("; ".join(filter(None, (text, stored))))


class TimeOut(BenchError):
    """It did not happen within the time given."""


class LinkError(BenchError):
    """A link to the bench is missing, was closed, or lost something."""


def link_error(where: object, what: str, e: Exception, hint: str = "") -> LinkError:
    """The error of a port, socket or server that could not be opened. hint: what may be amiss."""
    return LinkError("; ".join(filter(None, (expected(what, path_found(e), where), hint))))


def listen_error(where: str, port: int, e: Exception) -> LinkError:
    """The error of a port of this machine that could not be listened at."""
    return LinkError(expected("a free port of 127.0.0.1 or 0 (any free port)", f"{port}: {path_found(e)}", where))


class StartError(BenchError):
    """The emulator did not start: what the machine lacks, as a free port."""


class ControlError(BenchError):
    """The emulator's control socket rejected a command; nothing has changed."""

    def __init__(self, command: str, code: str, text: str) -> None:
        super().__init__(f"{command}: {text} ({code})")
        self.code = code
        self.text = text


class InstrumentError(BenchError):
    """An instrument rejected a command: number and text of its error queue (SCPI 1999, chapter 21)."""

    def __init__(self, instrument: str, command: str, number: int, text: str) -> None:
        super().__init__(f"{instrument}: {command}: {text} ({number})")
        self.number = number


class DeviceError(BenchError):
    """The board aborted an access: CiA 301 abort code, with the board's own text where it has any."""

    def __init__(self, what: str, abort_code: int, text: str) -> None:
        super().__init__(f"{what}: abort {abort_code:08X}h, {text}")
        self.what = what
        self.abort_code = abort_code
        self.text = text


class CycleRefused(DeviceError):
    """The board rejected a cycle on its parallel bus, or did not finish it; the text is the board's (object 2031h)."""
