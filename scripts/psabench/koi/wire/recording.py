"""What a flight over the wire leaves in its folder, and how it is read again to the same digits.

can.log       every CAN frame, as candump -L writes it
receiver.log  the bytes of the receiver's port: (time) gps#BEGIN#FRAMES#HEX, a line for each look at the port. time and
              BEGIN are of the last CAN frame before this look and before the one before it, FRAMES how many frames of
              can.log had come. Without bytes: HEX is empty
flight.json   what was known at the start: node, weights, class, serial number, time of the beginning
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, NamedTuple, Self

from psabench.errors import BadInput, expected, input_error
from psabench.link.can_host import Message
from psabench.link.own import output_text, replace_file

CAN_LOG, PORT_LOG, SETUP = "can.log", "receiver.log", "flight.json"
PIECE = 1 << 16


class Frame(NamedTuple):
    """Of a log: as much of python-can's message as listeners read."""

    timestamp: float
    arbitration_id: int
    data: bytes
    is_error_frame: bool = False
    is_remote_frame: bool = False


@dataclass(frozen=True, slots=True)
class Look:
    """At the receiver's port."""

    t_s: float  # of the last CAN frame before it
    begin_s: float  # of the last CAN frame before the look before
    frames: int  # of the recording before it
    data: bytes


class FlightRecorder:
    """Writes a flight as it comes; what is written survives the death of the process. Raises BadInput, OutputError."""

    def __init__(self, folder: Path, setup: dict[str, Any]) -> None:
        self.frames, self.last_s = 0, 0.0
        self._lines = list[str]()
        with ExitStack() as stack:
            self._can: IO[str] = stack.enter_context(output_text(folder / CAN_LOG))
            self._port: IO[str] = stack.enter_context(output_text(folder / PORT_LOG))
            replace_file(folder / SETUP, json.dumps(setup, indent=2) + "\n")
            self._stack = stack.pop_all()

    def on_message(self, m: Message | Frame) -> None:
        """A listener of the bus."""
        if m.is_error_frame:
            return
        self._lines.append("(%.6f) %03X#%s\n" % (m.timestamp, m.arbitration_id, m.data.hex()))  # noqa: UP031 - quicker
        self.frames += 1
        self.last_s = round(m.timestamp, 6)  # as it is read again

    def look(self, look: Look) -> None:
        """After the frames before it."""
        self._store_frames()
        head = f"({look.t_s:.6f}) gps#{look.begin_s:.6f}#{look.frames}"
        self._port.write(f"{head}#{look.data.hex().upper()}\n")
        if look.data:
            self._can.flush()
            self._port.flush()

    def _store_frames(self) -> None:
        """Capitals and the name of the bus all at once: 1.8 million frames an hour."""
        self._can.write("".join(self._lines).upper().replace(") ", ") can0 "))
        self._lines.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: Any) -> None:
        self._store_frames()
        self._stack.__exit__(*exc)


def read_setup(folder: Path) -> dict[str, Any]:
    """flight.json. Raises BadInput."""
    path = folder / SETUP
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except OSError as e:
        raise input_error(path, "a file of a recorded flight", e) from e
    except ValueError as e:
        raise BadInput(expected("JSON", e, path)) from e
    if not isinstance(found, dict):
        raise BadInput(expected("an object", type(found).__name__, path))
    return found


def read_events(folder: Path) -> Iterator[Frame | Look]:
    """Frames and looks in the order in which they came. A last line that was cut is left out. Raises BadInput."""
    looks = _read_looks(folder / PORT_LOG)
    look, count = next(looks, None), 0
    for frame in _read_can(folder / CAN_LOG):
        while look is not None and look.frames <= count:
            yield look
            look = next(looks, None)
        yield frame
        count += 1
    while look is not None and look.frames <= count:  # later ones: their frames were not written any more
        yield look
        look = next(looks, None)


def _whole_lines(path: Path) -> Iterator[tuple[int, str]]:
    try:
        with path.open(encoding="ascii", errors="replace", newline="") as file:
            for number, line in enumerate(file, start=1):
                if line.endswith("\n"):
                    yield number, line
    except OSError as e:
        raise input_error(path, "a file of a recorded flight", e) from e


def _read_can(path: Path) -> Iterator[Frame]:
    for number, line in _whole_lines(path):
        try:
            stamp, _, frame = line.split()[:3]
            ident, _, data = frame.partition("#")
            yield Frame(float(stamp[1:-1]), int(ident, 16), bytes.fromhex(data))
        except ValueError as e:
            raise BadInput(expected("a line of candump -L", line.strip()[:80], f"{path}: line {number}")) from e


def _read_looks(path: Path) -> Iterator[Look]:
    for number, line in _whole_lines(path):
        try:
            stamp, rest = line.split()
            _, begin, frames, data = rest.split("#")
            yield Look(float(stamp[1:-1]), float(begin), int(frames), bytes.fromhex(data))
        except ValueError as e:
            what = "(time) gps#BEGIN#FRAMES#HEX"
            raise BadInput(expected(what, line.strip()[:80], f"{path}: line {number}")) from e
