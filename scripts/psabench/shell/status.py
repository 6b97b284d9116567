"""The status bar: how the bench is, in one line."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from psabench.bench import Bench
from psabench.errors import BenchError
from psabench.status import GrowingFile, Status

EVERY_S = 0.25  # real time between two looks


def line(s: Status, t_ns: int | None) -> str:
    """`1.2 s wall | table 10.0 deg 1.0 deg/s | 25.00 degC | frames 1000 | late 0 | lost 0 | vcd 1.2 of 1000 MB`."""
    parts = ["real bench" if t_ns is None else f"{t_ns / 1e9:.3f} s {s.pace}"]
    if s.angle_deg is not None:
        rate = "" if s.rate_dps is None else f" {s.rate_dps:.4f} deg/s"
        parts.append(f"table {s.angle_deg:.4f} deg{rate}")
    if s.temp_degc is not None:
        parts.append(f"{s.temp_degc:.2f} degC")
    parts.append(f"frames {s.frames}")
    if s.late is not None:
        parts.append(f"late {s.late}")
    parts.append(f"lost {s.lost}")
    parts.extend(map(_file_text, s.files))
    return " | ".join(parts)


def _file_text(file: GrowingFile) -> str:
    if file.error:
        return f"{file.kind}: {file.error}"
    limit = f" of {file.max_bytes / 1e6:g}" if file.max_bytes else ""
    return f"{file.kind} {file.size_bytes / 1e6:.1f}{limit} MB"


@dataclass(slots=True)
class Watch:
    """Looks at a bench now and then, and takes the frames that came meanwhile: none may pile up or be lost for it."""

    bench: Bench
    now_ns: Callable[[], int | None]  # simulated time, None where no one tells it
    clock: Callable[[], float] = time.monotonic
    _text: str = ""
    _next_s: float = field(default=-1.0)

    def text(self) -> str:
        """The status bar, at most EVERY_S old."""
        if self.clock() >= self._next_s:
            try:
                self._take_frames()
                self._text = line(self.bench.status(), self.now_ns())
            except BenchError as e:
                self._text = str(e)
            self._next_s = self.clock() + EVERY_S
        return self._text

    def _take_frames(self) -> None:
        """Not in step pace: there nothing comes while time stands still."""
        if self.bench.pace == "step":
            return
        for unit in self.bench.units.values():
            while unit.host.receive(0.0):
                pass
            unit.frames.take()
