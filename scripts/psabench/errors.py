"""What can go wrong, and the exit status each kind gives the command line.

Every message says what, where, and what would be right. Bad arguments of functions are plain `ValueError`.
"""

from __future__ import annotations

import errno

# What the machine lacks; any other reason why a file cannot be written lies in the path that the user gave.
MACHINE = {errno.ESTALE, errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EMFILE, errno.ENFILE, errno.ENOMEM}
REASONS = {
    errno.ESTALE: "moved, removed or replaced while it was written",
    errno.EEXIST: "expected a folder, got a file",  # of mkdir(), which takes a folder that is there
    errno.ENOTDIR: "expected a path of folders, got a file among them",
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


def output_error(where: object, e: OSError, stored: str = "") -> BenchError:
    """The error of a file that could not be written: OutputError, or BadInput where another path would do.

    stored: what of it is on the disk.
    """
    kind = OutputError if e.errno in MACHINE else BadInput
    reason = REASONS.get(e.errno or 0) or e.strerror or e
    return kind("; ".join(filter(None, (f"{where}: {reason}", stored))))


class TimeOut(BenchError):
    """It did not happen within the time given."""


class LinkError(BenchError):
    """A link to the bench is missing, was closed, or lost something."""


def port_in_use(port: int, where: str) -> LinkError:
    """A port of this machine that another program has."""
    return LinkError(expected("a free port of 127.0.0.1", f"{port}, which is in use", where))


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
