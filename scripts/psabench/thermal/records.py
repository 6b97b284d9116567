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
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from psabench.errors import BadInput, expected, input_error, output_error
from psabench.link.own import Owned, replace_file
from psabench.procedures.recording import SeriesFile
from psabench.thermal.schedule import POSITIONS

NAME = "thermal"
SETUP = "thermal-run.json"
FORMAT = 1  # of it
LOCK = "thermal.lock"
SNAPSHOT = "checkpoint-{rows}.snapshot"
MOST_SHOWN = 60  # characters of a value in an error


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
        raise input_error(path, "rows of a run", e) from e
    return text[: text.rfind("\n") + 1].splitlines()


def read_recordings(path: Path) -> list[Recording]:
    """Raises BadInput with file and line for what a run has not stored."""
    return [_recording_of(row, where) for where, row in read_rows(path, COLUMNS)]


def read_rows(path: Path, columns: Sequence[str]) -> list[tuple[str, dict[str, str]]]:
    """Whole rows by column, each with its file and line. Raises BadInput for other columns."""
    try:
        rows = list(csv.reader(whole_lines(path)))
    except csv.Error as e:
        raise BadInput(expected("comma-separated values", e, path)) from e
    if rows and tuple(rows[0]) != tuple(columns):
        raise BadInput(expected(f"the columns {','.join(columns)}", ",".join(rows[0]), f"{path}:1"))
    found = []
    for line, row in enumerate(rows[1:], start=2):
        if len(row) != len(columns):
            raise BadInput(expected(f"{len(columns)} values", len(row), f"{path}:{line}"))
        found.append((f"{path}:{line}", dict(zip(columns, row, strict=True))))
    return found


def number_in(name: str, text: str, where: str) -> float:
    """Of a row. Raises BadInput for a text that is no finite number."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BadInput(expected(f"a number for {name}", shown_value(text), where))
    return value


def _recording_of(row: Mapping[str, str], where: str) -> Recording:
    values: dict[str, Any] = {
        name: text if name in TEXTS else number_in(name, text, where) for name, text in row.items()
    }
    if values["position"] not in POSITIONS:
        raise BadInput(expected(f"a position of {', '.join(POSITIONS)}", shown_value(values["position"]), where))
    for name in WHOLE:
        if values[name] != int(values[name]):
            raise BadInput(expected(f"a whole number for {name}", row[name], where))
        values[name] = int(values[name])
    return Recording(**values)


# ---- what a run was asked for


def _is_number(v: object) -> bool:
    if isinstance(v, bool) or not isinstance(v, int | float):
        return False
    try:
        return math.isfinite(v)
    except OverflowError:  # of an int beyond any float
        return False


def _is_whole(v: object) -> bool:
    return isinstance(v, int) and not isinstance(v, bool)


def _are_numbers(v: object) -> bool:
    return isinstance(v, dict) and all(map(_is_number, v.values()))


# Of SETUP: what each key has to be, for the error, and its test.
SETUP_KEYS: Mapping[str, tuple[str, Callable[[object], bool]]] = {
    "name": ("a text", lambda v: isinstance(v, str)),
    "schedule": ("a schedule", lambda v: isinstance(v, dict)),
    "ours": ("true or false", lambda v: isinstance(v, bool)),
    "scenario": ("a text", lambda v: isinstance(v, str)),
    "seed": ("a whole number or null", lambda v: v is None or _is_whole(v)),
    "node": ("a whole number", _is_whole),
    "accuracy": ("numbers by their names", _are_numbers),
    "g_mps2": ("a number", _is_number),
    "origin_s": ("a number", _is_number),
    "start_degc": ("a number", _is_number),
}


def checked_setup(found: object, path: Path) -> dict[str, Any]:
    """Raises BadInput with the key."""
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        raise BadInput(expected(f"the set-up of a run, format {FORMAT}", "another", path))
    missing = [key for key in SETUP_KEYS if key not in found]
    if missing:
        raise BadInput(expected(", ".join(missing), "none", path))
    for key, (what, is_so) in SETUP_KEYS.items():
        if not is_so(found[key]):
            raise BadInput(expected(f"{what} for {key}", shown_value(found[key]), path))
    return found


def shown_value(v: object) -> str:
    """As JSON, in one line that is not long."""
    text = json.dumps(v, ensure_ascii=False, default=str)
    return text if len(text) <= MOST_SHOWN else f"{text[:MOST_SHOWN]}..."


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

    @property
    def setup_path(self) -> Path:
        return self.path / SETUP

    @contextmanager
    def own_folder(self) -> Iterator[None]:
        """This process alone works in the folder, which is made; the lock ends with the process.

        Raises BadInput where another one does.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as e:
            raise output_error(self.path, e) from e
        lock = Owned(self.path / LOCK)
        try:
            yield
        finally:
            lock.release()

    def store_setup(self, setup: Mapping[str, Any]) -> None:
        """What the run was asked for; checkpoints and rows of an earlier run go. Raises OutputError."""
        self.path.mkdir(parents=True, exist_ok=True)
        for old in (*self._snapshots().values(), self.data, self.truth, self.path / "result.json"):
            old.unlink(missing_ok=True)
        replace_file(self.setup_path, json.dumps({"format": FORMAT, **setup}, indent=1) + "\n")

    def read_setup(self) -> dict[str, Any]:
        """Raises BadInput where no run was begun."""
        try:
            found = json.loads(self.setup_path.read_text(encoding="utf-8"))
        except FileNotFoundError as e:
            raise BadInput(expected(f"a folder of psabench run thermal, with {SETUP}", "none", self.path)) from e
        except (OSError, ValueError, RecursionError) as e:
            raise input_error(self.setup_path, "the set-up of a run", e) from e
        return checked_setup(found, self.setup_path)

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

    def drop_checkpoints(self) -> None:
        """Of a run whose report is there. Raises OutputError."""
        for path in (*self._snapshots().values(), *self.path.glob("checkpoint-*.part")):
            path.unlink(missing_ok=True)

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
