"""The receiver's serial port, and when to look at it so that arrivals are known well."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass

import serial

from psabench.errors import LinkError, expected, link_error

BAUD = 115_200
LOOK_S = 0.23  # between two looks, at most: the kernel's buffer of 4 kB lasts 0.35 s at 115200 bit/s
LEAST_S = 0.004  # half a window: the least that is gained
WALL_S, PIECE = 0.01, 4096
LONGEST_PERIOD_S = 2.0


class SerialPort:
    """8 data bits, no parity, 1 stop bit; a pseudo-terminal or a device."""

    def __init__(self, path: str, baud: int = BAUD) -> None:
        """Raises LinkError for a port that cannot be opened."""
        self.path = path
        try:
            self._port = serial.Serial(path, baud, timeout=0)
        except (OSError, ValueError) as e:
            raise link_error(f"--receiver {path}", "a serial port", e) from e

    def take(self) -> bytes:
        """All that has come. Raises LinkError where the device has gone.

        Until there is nothing: the kernel moves the bytes of a pseudo-terminal behind the writer's back, and waits for
        that where a reader would find none.
        """
        found = b""
        try:
            while piece := self._port.read(PIECE):
                found += piece
            return found
        except (OSError, serial.SerialException) as e:
            raise LinkError(expected("the receiver's port", "one that has gone", self.path)) from e

    def close(self) -> None:
        with suppress(OSError):
            self._port.close()


@dataclass
class LookPlan:
    """Where simulated time stops for looks: close about the next arrival, as the last ones came.

    Each look halves the interval in which the next arrival is known to be. Times are of the bench.
    """

    _period_s: float = 1.0  # of the receiver's solutions
    _tow_s: float = -math.inf  # of the last one
    _middle_s: float | None = None  # of the next arrival
    _half_s: float = LOOK_S

    def next_look_s(self, now_s: float) -> float:
        """When to look next."""
        due = now_s + LOOK_S
        if self._middle_s is not None:
            edges = (self._middle_s - self._half_s, self._middle_s, self._middle_s + self._half_s)
            due = min([due, *(e for e in edges if e > now_s + LEAST_S / 4)])
        return due

    def arrived(self, begin_s: float, end_s: float, tow_s: float) -> None:
        """A solution of this time of week came between two looks."""
        if 0.0 < tow_s - self._tow_s <= LONGEST_PERIOD_S:
            self._period_s = tow_s - self._tow_s
        self._tow_s = tow_s
        middle = (begin_s + end_s) / 2.0
        self._half_s = max(LEAST_S, (end_s - begin_s) / 2.0)
        self._middle_s = middle + self._period_s

    def missed(self, now_s: float) -> None:
        """Nothing came: the next window is wider."""
        if self._middle_s is not None and now_s > self._middle_s + self._half_s + LOOK_S:
            self._half_s = min(2.0 * self._half_s, LOOK_S)
            self._middle_s += self._period_s
