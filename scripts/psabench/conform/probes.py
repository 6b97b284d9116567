"""Probes on the lines of a board: the line port (or an adapter of its kind), all pins of an emulated board.

A probe is started and stopped by the stimulus; what it saw meanwhile is a `LineLog`.
"""

from __future__ import annotations

import os
import selectors
import tempfile
import threading
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Protocol

from psabench.bench import Bench
from psabench.conform.capture.log import LineLog
from psabench.conform.sources.samples import line_log
from psabench.errors import LinkError, link_error, path_found
from psabench.link.lineport import SAMPLE_HZ, open_line
from psabench.link.vcd import read_vcd

BLOCK = 1 << 16
MOST = 1 << 30  # samples of one stimulus: two minutes at 8 MHz


class LineProbe(Protocol):
    """Where lines can be seen."""

    def start(self) -> None:
        """Look from now on."""
        ...

    def stop(self) -> LineLog:
        """What was seen since `start`."""
        ...


class PinProbe:
    """All pins of an emulated board, to the nanosecond: as a logic analyser with a clip on each pin."""

    def __init__(self, bench: Bench, unit: str) -> None:
        self._bench, self._unit = bench, unit
        self.pairs = False  # the next look has the wires A and B of differential lines, too
        self._dir = tempfile.TemporaryDirectory(prefix="psabench-")
        self._path = Path(self._dir.name) / "pins.vcd"

    def start(self) -> None:
        self._bench.probe.start(self._path, self._unit, pairs=self.pairs)

    def stop(self) -> LineLog:
        self._bench.probe.stop()
        recording = read_vcd(self._path)
        return LineLog(recording=recording, resolution_ns=float(recording.unit_ns))

    def close(self) -> None:
        self._dir.cleanup()


class PortProbe:
    """The line port at a path. A thread takes the bytes as they come: in step pace time waits for whoever reads."""

    def __init__(self, path: Path, family: str, sample_hz: float = SAMPLE_HZ) -> None:
        self._path, self._family, self._sample_hz = path, family, sample_hz
        self._wake: tuple[int, int] | None = None
        self._thread: threading.Thread | None = None
        self._data = bytearray()
        self._trouble = ""

    @property
    def path(self) -> Path:
        return self._path

    @property
    def data(self) -> bytes:
        """The bytes as they came, of the last look."""
        return bytes(self._data)

    def start(self) -> None:
        """Raises LinkError when there is nothing at the path."""
        try:
            port = open_line(self._path)
        except OSError as e:
            raise link_error(self._path, "a line port", e) from e
        self._data.clear()
        self._trouble = ""
        self._wake = os.pipe()
        self._thread = threading.Thread(target=self._read, args=(port, self._wake[0]), daemon=True)
        self._thread.start()

    def stop(self) -> LineLog:
        """Raises LinkError when the port ended, or gave more than a stimulus may hold."""
        assert self._thread is not None
        assert self._wake is not None
        os.write(self._wake[1], b"x")
        self._thread.join()
        for end in self._wake:
            os.close(end)
        self._thread = self._wake = None
        if self._trouble:
            raise LinkError(f"{self._path}: {self._trouble}")
        return line_log(bytes(self._data), self._family, self._sample_hz)

    def _read(self, port: BinaryIO, wake: int) -> None:
        """Take what comes; what has come when the end is asked for is taken to the last byte."""
        with port, selectors.DefaultSelector() as ready:
            ready.register(port, selectors.EVENT_READ, port)
            ready.register(wake, selectors.EVENT_READ)
            while not self._trouble:
                found = [key.data for key, _ in ready.select()]
                if port in found:
                    self._take(port)
                else:
                    return

    def _take(self, port: BinaryIO) -> None:
        try:
            data = port.read(BLOCK)
        except OSError as e:
            self._trouble = path_found(e)
            return
        self._data += data
        if not data or len(self._data) > MOST:
            self._trouble = f"more than {MOST} samples in one scene" if data else "the port has ended"

    def __enter__(self) -> PortProbe:
        return self

    def __exit__(self, kind: type[BaseException] | None, err: BaseException | None, tb: TracebackType | None) -> None:
        if self._thread is not None:
            self.stop()
