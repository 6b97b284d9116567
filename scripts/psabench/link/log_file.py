"""Logs in python-can's formats and our own (psabench.logs), with the number of messages that are on the disk.

python-can's writers buffer, and one of them (SQLite) writes on a thread of its own, whose failure it does not report.
Here a message counts when it is stored: after an error the file is cut behind its last whole record and read back.
"""

from __future__ import annotations

import errno
import os
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import cast

import can
from can.io.generic import MessageWriter, TextIOMessageWriter
from can.io.logger import MESSAGE_WRITERS

from psabench.errors import BadInput, BenchError, expected, output_error
from psabench.lcm.can_io import LcmWriter
from psabench.link.own import OutputFile, Owned, sqlite_error
from psabench.places import no_package


class LogFile:
    """Writes messages into a file of its own. `error` is what ended it, if the machine did."""

    def __init__(self, path: Path, boards: Mapping[int, str] | None = None) -> None:
        """boards: by node, for formats that decode. Raises BadInput: unknown ending, path, file of another process."""
        if path.suffix not in FORMATS:
            raise BadInput(expected(f"an ending of {' '.join(FORMATS)}", path.suffix or "none", path))
        self.path = path
        self.error: BenchError | None = None
        self._written = 0
        self._owned = Owned(path)
        try:
            self._writer = _open_writer(path, boards)
        except ImportError as e:
            self._owned.release()
            raise no_package(e, path) from e
        except NotImplementedError as e:
            self._owned.release()
            raise BadInput(f"{path}: {e}") from e
        except OSError as e:
            self._owned.release()
            raise output_error(path, e) from e

    def __call__(self, message: can.Message) -> bool:
        """Write it; False when that, or what was written before it, failed: then `close` says what is stored."""
        if self.error is None:
            with self._errors_kept():
                self._writer(message)
                self._written += 1
        return self.error is None

    def check(self) -> bool:
        """Push what is buffered out and see whether the file is there and has room. False: it is over."""
        if self.error is None:
            with self._errors_kept():
                if isinstance(self._writer, TextIOMessageWriter):
                    self._writer.file.flush()
                elif isinstance(self._writer, Checked):
                    self._writer.check()
                if self._owned.gone():
                    raise OSError(errno.ESTALE, "moved")
        return self.error is None

    @contextmanager
    def _errors_kept(self) -> Iterator[None]:
        """Keeps the first error of the work."""
        try:
            yield
        except OSError as e:
            error = OSError(errno.ESTALE, "moved") if self._owned.gone() else e
            self.error = self.error or output_error(self.path, error)

    def close(self) -> int:
        """Close the file and return how many messages it holds."""
        self.check()
        with self._errors_kept():
            self._writer.stop()
        try:
            return self._stored()
        finally:
            self._owned.release()

    def _stored(self) -> int:
        if self.error is None:
            return self._written
        if self._owned.gone() or not self.path.is_file():  # a device or a pipe cannot be read back
            return 0
        if isinstance(self._writer, Checked):
            return self._writer.stored(self._written)
        return _cut_lines(self.path)


class Checked(MessageWriter):
    """A writer that says what has failed and what it has stored. `stop` raises OSError for an error it kept."""

    def check(self) -> None:
        """Raises OSError for an error that the writer kept for itself, or that is about to come."""

    def stored(self, written: int) -> int:
        """Messages in the file, of those written, after `stop`."""
        raise NotImplementedError


class Blf(can.BLFWriter, Checked):
    """A container that does not fit is taken back: the file ends with a whole one, and its header counts it."""

    def __init__(self, path: Path) -> None:
        self._path, self._cut = path, False
        super().__init__(OutputFile(path, "wb"))

    def _flush(self) -> None:
        begin, size = self.file.tell(), self.uncompressed_size
        try:
            super()._flush()
        except OSError:
            self._cut, self.uncompressed_size = True, size
            self._buffer, self._buffer_size = [], 0
            self.file.seek(self.file.truncate(begin))
            raise

    def stop(self) -> None:
        if self._cut:
            messages = _read(self._path)
            self.object_count = len(messages)
            if messages and self.start_timestamp is not None:
                self.stop_timestamp = self.start_timestamp + messages[-1]  # the header does not have the start yet
        super().stop()

    def stored(self, written: int) -> int:
        return int(self.object_count)


class Db(Checked):
    """The table of python-can's SqliteWriter, which stops with what its thread has not yet stored, and says nothing."""

    BATCH = 500  # messages of one transaction
    TABLE = "(ts REAL, arbitration_id INTEGER, extended INTEGER, remote INTEGER, error INTEGER, dlc INTEGER, data BLOB)"

    def __init__(self, path: Path) -> None:
        self._rows: list[tuple[float, int, bool, bool, bool, int, bytes]] = []
        self._stored = 0
        with _sqlite_errors():
            self._db = sqlite3.connect(path)
            self._db.execute(f"CREATE TABLE IF NOT EXISTS messages {self.TABLE}")

    def on_message_received(self, m: can.Message) -> None:
        extended, remote, error = m.is_extended_id, m.is_remote_frame, m.is_error_frame
        self._rows.append((m.timestamp, m.arbitration_id, extended, remote, error, m.dlc, bytes(m.data)))
        if len(self._rows) >= self.BATCH:
            self.check()

    def check(self) -> None:
        """Commit what was collected."""
        with _sqlite_errors(), self._db:
            self._db.executemany("INSERT INTO messages VALUES (?, ?, ?, ?, ?, ?, ?)", self._rows)
        self._stored += len(self._rows)
        self._rows.clear()

    def stop(self) -> None:
        try:
            self.check()
        finally:
            self._db.close()

    def stored(self, written: int) -> int:
        return self._stored


@contextmanager
def _sqlite_errors() -> Iterator[None]:
    try:
        yield
    except sqlite3.Error as e:
        raise sqlite_error(e) from e


class Lcm(LcmWriter, Checked):
    """An event log of LCM. An event that does not fit is taken back."""

    def __init__(self, path: Path) -> None:
        super().__init__(OutputFile(path, "wb"))

    def on_message_received(self, m: can.Message) -> None:
        try:
            super().on_message_received(m)
        except OSError:
            with suppress(OSError):  # a device or a pipe
                self.file.truncate(self.size)
            raise

    def stored(self, written: int) -> int:
        return self.count


# Writers of our own by ending: module and class, loaded when such a file is written.
WRITERS = {
    ".blf": "psabench.link.log_file:Blf",
    ".db": "psabench.link.log_file:Db",
    ".lcmlog": "psabench.link.log_file:Lcm",
    ".mcap": "psabench.logs.mcap_log:Mcap",
    ".mf4": "psabench.logs.mf4_log:Mf4",
    ".pcap": "psabench.logs.pcap:Pcap",
}
DECODING = (".mcap", ".mf4")  # they hold decoded messages, too
FORMATS = sorted({*MESSAGE_WRITERS, *WRITERS})  # .log candump, .blf and .asc Vector ...


def _open_writer(path: Path, boards: Mapping[int, str] | None) -> MessageWriter:
    """boards: by node, where they differ from the DBC's."""
    if path.suffix not in WRITERS:
        return MESSAGE_WRITERS[path.suffix](path)
    module, _, name = WRITERS[path.suffix].partition(":")
    kind = getattr(import_module(module), name)
    return cast(MessageWriter, kind(path, boards) if path.suffix in DECODING else kind(path))


def _cut_lines(path: Path) -> int:
    """Cut a file of lines behind its last whole one; how many messages it has."""
    text = path.read_bytes()
    os.truncate(path, text.rfind(b"\n") + 1)
    if path.suffix == ".txt":  # printed messages, a line each; nothing reads them back
        return text.count(b"\n")
    return len(_read(path))


def _read(path: Path) -> list[float]:
    """Stamps of the messages in a file, which may hold none and no header."""
    with suppress(EOFError, ValueError, StopIteration), can.LogReader(path) as messages:
        return [m.timestamp for m in messages]
    return []
