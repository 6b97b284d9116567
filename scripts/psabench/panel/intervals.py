"""What a procedure that runs knows so far: its estimates with their intervals, as it writes them down line by line."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

MOST = 60  # points of an estimate; when there are more every second one goes
SHOWN = 6  # estimates


@dataclass(slots=True)
class Course:
    """One estimate: (readings, value, half of the 95 % interval) for each look."""

    unit: str
    points: list[tuple[int, float, float]] = field(default_factory=list)

    def add(self, point: tuple[int, float, float]) -> None:
        self.points.append(point)
        if len(self.points) > MOST:
            del self.points[-2::-2]  # the latest stays


@dataclass(slots=True)
class Intervals:
    """Follows the file that $PSABENCH_INTERVALS names (psabench.progress)."""

    path: Path
    courses: dict[str, Course] = field(default_factory=dict)
    _at: int = 0
    _readings: int = 0

    def forget(self) -> None:
        """A procedure is about to begin."""
        self.path.unlink(missing_ok=True)
        self.courses, self._at, self._readings = {}, 0, 0

    def follow(self) -> None:
        """Take the whole lines that have come."""
        if not self.path.exists():
            return
        with self.path.open("rb") as file:
            file.seek(self._at)
            whole, _, _ = file.read().rpartition(b"\n")
        if whole:
            self._at += len(whole) + 1
            for line in whole.splitlines():
                self._take(json.loads(line))

    def _take(self, known: dict[str, Any]) -> None:
        readings = int(known["readings"])
        if readings < self._readings:  # the same procedure on another bench
            self.courses = {}
        self._readings = readings
        for e in known["estimates"]:
            course = self.courses.setdefault(str(e["name"]), Course(str(e["unit"])))
            course.add((readings, float(e["value"]), float(e["half"])))

    def message(self) -> list[dict[str, Any]]:
        """For the page: columns, as uPlot takes them."""
        shown = list(self.courses.items())[:SHOWN]
        return [
            {"name": name, "unit": c.unit, "columns": [list(column) for column in zip(*c.points, strict=True)]}
            for name, c in shown
        ]
