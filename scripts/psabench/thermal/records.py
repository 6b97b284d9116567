"""Recordings of a thermal run: a row of CSV each, appended and flushed as they come; a folder that a run continues in.

`thermal.csv` is what was measured, `thermal-truth.csv` what an emulator says beside it, for graders alone. A
checkpoint is a snapshot of the emulator with the number of rows that it holds in its name: what is resumed from it is
the same to the last digit.
"""

from __future__ import annotations

import csv
import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from psabench.errors import BadInput, expected
from psabench.link.own import replace_file
from psabench.procedures.recording import SeriesFile
from psabench.thermal.schedule import POSITIONS

NAME = "thermal"
SETUP = "thermal-run.json"
FORMAT = 1  # of it
SETUP_KEYS = ("name", "schedule", "ours", "scenario", "node", "accuracy", "g_mps2", "origin_s", "start_degc")
SNAPSHOT = "checkpoint-{rows}.snapshot"


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """The means of one recording: volts at the loads without the filter's known gain, temperatures in deg C."""

    t_s: float  # its middle, s of the bench
    segment: str
    part: int
    position: str
    alpha_deg: float  # scale of the head
    chamber_degc: float  # what the chamber shows
    case_degc: float  # sensor at the converter board, in the case
    element_x_degc: float  # sensors at the accelerometers' elements
    element_y_degc: float
    element_z_degc: float
    x_v: float
    y_v: float
    z_v: float
    sd_x_v: float  # of these means, from their scatter
    sd_y_v: float
    sd_z_v: float


COLUMNS = tuple(f.name for f in fields(Recording))
TEXTS, WHOLE = ("segment", "position"), ("part",)
TRUTH_COLUMNS = ("t_s", "case_degc", "element_degc", *(f"a_{c}_g" for c in "xyz"), *(f"out_{c}_v" for c in "xyz"))


def recording_row(r: Recording) -> list[object]:
    """Its values, in the order of COLUMNS."""
    return [getattr(r, name) for name in COLUMNS]


def whole_lines(path: Path) -> list[str]:
    """Lines of a file that end; [] where there is none. What a crash cut short is left out. Raises BadInput."""
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return []
    except (OSError, UnicodeDecodeError) as e:
        raise BadInput(f"{path}: {getattr(e, 'strerror', None) or e}") from e
    return text[: text.rfind("\n") + 1].splitlines()


def read_recordings(path: Path) -> list[Recording]:
    """Raises BadInput with file and line for what `store_recording` has not written."""
    rows = list(csv.reader(whole_lines(path)))
    if rows and tuple(rows[0]) != COLUMNS:
        raise BadInput(expected(f"the columns {','.join(COLUMNS)}", ",".join(rows[0]), f"{path}:1"))
    return [_recording_of(row, f"{path}:{line}") for line, row in enumerate(rows[1:], start=2)]


def _recording_of(row: Sequence[str], where: str) -> Recording:
    try:
        values = {
            name: text if name in TEXTS else int(text) if name in WHOLE else float(text)
            for name, text in zip(COLUMNS, row, strict=True)
        }
        if not all(math.isfinite(v) for v in values.values() if isinstance(v, float)):
            raise ValueError(expected("finite numbers", "others"))
        if values["position"] not in POSITIONS:
            raise ValueError(expected(", ".join(POSITIONS), values["position"]))
    except ValueError as e:
        raise BadInput(expected("a recording", e, where)) from e
    return Recording(**values)  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class RunFolder:
    """Where a run is kept."""

    path: Path

    @property
    def data(self) -> Path:
        return self.path / f"{NAME}.csv"

    @property
    def truth(self) -> Path:
        return self.path / f"{NAME}-truth.csv"

    def store_setup(self, setup: Mapping[str, Any]) -> None:
        """What the run was asked for; checkpoints and rows of an earlier run go. Raises OutputError."""
        self.path.mkdir(parents=True, exist_ok=True)
        for old in (*self._snapshots().values(), self.data, self.truth, self.path / "result.json"):
            old.unlink(missing_ok=True)
        replace_file(self.path / SETUP, json.dumps({"format": FORMAT, **setup}, indent=1) + "\n")

    def read_setup(self) -> dict[str, Any]:
        """Raises BadInput where no run was begun."""
        path = self.path / SETUP
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError as e:
            raise BadInput(expected(f"a folder of psabench run thermal, with {SETUP}", "none", self.path)) from e
        except (OSError, ValueError) as e:
            raise BadInput(expected("the set-up of a run", e, path)) from e
        if not isinstance(found, dict) or found.get("format") != FORMAT:
            raise BadInput(expected(f"the set-up of a run, format {FORMAT}", "another", path))
        missing = [key for key in SETUP_KEYS if key not in found]
        if missing:
            raise BadInput(expected(", ".join(missing), "none", path))
        return found

    def _snapshots(self) -> dict[int, Path]:
        """By the number of rows that they hold."""
        found = {}
        for path in self.path.glob(SNAPSHOT.format(rows="*")):
            rows = path.stem.rpartition("-")[2]
            if rows.isdecimal():
                found[int(rows)] = path
        return found

    def last_checkpoint(self, rows: int) -> tuple[int, Path] | None:
        """The latest one of at most so many rows."""
        found = self._snapshots()
        usable = [k for k in found if k <= rows]
        return (max(usable), found[max(usable)]) if usable else None

    def store_checkpoint(self, rows: int, snapshot: Callable[[Path], object]) -> None:
        """Whole under its name or not at all; earlier ones go when it is there. Raises OutputError."""
        path = self.path / SNAPSHOT.format(rows=rows)
        draft = path.with_suffix(".part")
        old = self._snapshots()
        try:
            snapshot(draft)
            os.replace(draft, path)
        finally:
            with suppress(OSError):
                draft.unlink()
        for k, past in old.items():
            if k != rows:
                past.unlink(missing_ok=True)

    def set_aside(self, rows: int) -> None:
        """Recordings after so many, which are made again on a bench that has gone on: into a file of their own."""
        lines = whole_lines(self.data)[rows + 1 :]
        with SeriesFile(self.path / f"{NAME}-aside.csv", COLUMNS, append=True) as aside:
            aside.store_rows(csv.reader(lines))

    def keep_rows(self, rows: int) -> list[Recording]:
        """Cut both series to so many rows, whole or not at all; what is kept. Raises BadInput, OutputError."""
        kept = read_recordings(self.data)[:rows]
        for path in (self.data, self.truth):
            lines = whole_lines(path)
            if lines:
                replace_file(path, "".join(f"{line}\n" for line in lines[: rows + 1]))
        return kept

    def open_series(self) -> SeriesFile:
        """The recordings, for more of them."""
        return SeriesFile(self.data, COLUMNS, "recordings", append=True)

    def open_truth(self) -> SeriesFile:
        return SeriesFile(self.truth, TRUTH_COLUMNS, append=True)
