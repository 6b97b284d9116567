"""What a unit's serial port sends, and time in step with it: no byte waits in a pseudo-terminal while time moves."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from psabench.emulator import Emulator
from psabench.link.control import Control

SLICE_S = 0.1  # of simulated time; the kernel takes 4 kB before time waits for the reader
SITE = "site: {latitude_deg: 55.75, longitude_deg: 37.61, height_m: 150}\n"
QUIET = "white_m: 0, slow_m: 0, white_mps: 0, slow_mps: 0"


def receiver_scenario(folder: Path, fields: str = "", site: str = SITE) -> Path:
    """One receiver, `gps`, with these fields of its profile."""
    path = folder / "receiver.yaml"
    path.write_text(
        f"seed: 5\n{site}start: true\nunits:\n  - {{name: gps, board: receiver, profile_set: {{{fields}}}}}\n"
    )
    return path


class SerialPort:
    """The slave side of the pseudo-terminal at `path`, opened as any program would."""

    def __init__(self, control: Control, path: str) -> None:
        self.control = control
        self._fd = os.open(path, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)

    def run(self, dwell_s: float) -> bytes:
        """Move time; what came meanwhile."""
        got, left_s = b"", dwell_s
        while left_s > 1e-9:
            self.control.call("run", for_s=min(SLICE_S, left_s))
            left_s -= SLICE_S
            got += self._taken()
        return got

    def _taken(self) -> bytes:
        got = b""
        while True:
            try:
                chunk = os.read(self._fd, 65536)
            except BlockingIOError:
                return got
            if not chunk:
                return got
            got += chunk

    def close(self) -> None:
        """Harmless once more."""
        if self._fd >= 0:
            os.close(self._fd)
        self._fd = -1


@contextmanager
def serial_port(scenario: Path | None, *extra: str | Path, can: str = "none") -> Iterator[tuple[SerialPort, Emulator]]:
    """An emulator in step pace with the serial port of its receiver open. scenario None: `extra` restores one."""
    with (
        Emulator(scenario, cans=[can], extra=["--serial", "-", *extra]) as emulator,
        Control(_path(emulator)) as control,
    ):
        port = SerialPort(control, emulator.endpoint(serial="8n1")["pty"])
        try:
            yield port, emulator
        finally:
            port.close()


def _path(emulator: Emulator) -> Path:
    assert emulator.control_path is not None
    return emulator.control_path
