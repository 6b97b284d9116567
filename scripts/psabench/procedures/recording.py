"""What a run read, on disk: CSV rows, flushed as they come, so an interrupted run loses nothing.

A row is a reading of a calibration, a step of a platform in a window (OUT/gyrocompass-READING.csv), a look at a hold
(OUT/heading-hold-READING.csv). `psabench.load` reads all of them.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any, Self

from psabench.errors import expected
from psabench.estimate.face import Face
from psabench.link.own import output_text
from psabench.procedures.head_bench import Reading
from psabench.procedures.platform_bench import Compensation, Look, PlatformBench, Table, Window

STEP_ARRAYS = ("beta_rad", "gamma_rad", "u1_radps", "u2_radps", "encoder_rad", "turned_rad")  # of a Window
WINDOW_COLUMNS = ("t_s", "part", "position", "set_rad", *STEP_ARRAYS, "lost", "faults")
LOOK_COLUMNS = ("t_s", "encoder_rad", "heading_rad", "faults")
COLUMNS = ("t_s", "face", "set_deg", "alpha_deg", "axis", "realisation", "u_v")


class SeriesFile:
    """A time series of a run: named columns with their units, a row at a time; the format of all of them."""

    def __init__(self, path: Path, columns: Sequence[str], what: str = "rows", *, append: bool = False) -> None:
        """Raises BadInput or OutputError when the file cannot be made; an earlier file of that name is replaced.

        append: it is continued after its last row, which has to be complete.
        """
        self.path = path
        self.rows = 0
        with ExitStack() as stack:
            file = output_text(path, lambda: f"stored {self.rows} {what}", append=append)
            self._file: IO[str] = stack.enter_context(file)
            self._csv = csv.writer(self._file, lineterminator="\n")
            if not append or path.stat().st_size == 0:
                self._csv.writerow(columns)
            self._file.flush()  # a run that is interrupted at once leaves a series without rows
            self._stack = stack.pop_all()

    def store_rows(self, rows: Iterable[Sequence[object]]) -> None:
        """Store rows. Raises Unstored; at the end of the context that becomes OutputError."""
        for row in rows:
            # repr of a float is the shortest text that reads back to the same bits
            self._csv.writerow([repr(float(x)) if isinstance(x, float) else x for x in row])
            self.rows += 1
        self._file.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: Any) -> None:
        self._stack.__exit__(*exc)


class CsvRecorder(SeriesFile):
    """`Watch(record=recorder)`. Rows survive Ctrl-C, an exception and the death of the process."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, COLUMNS, "readings")

    def __call__(self, r: Reading) -> None:
        """Store a reading."""
        self.store_rows([[r.face.value if name == "face" else getattr(r, name) for name in COLUMNS]])


def window_rows(part: str, w: Window) -> Iterator[tuple[object, ...]]:
    """A row for each step: its instant, s of the bench, counted from the middle of the window."""
    arrays = [getattr(w, name).tolist() for name in STEP_ARRAYS]
    n = len(w.beta_rad)
    faults = "; ".join(w.faults)
    for k, values in enumerate(zip(*arrays, strict=True)):
        t_s = w.t_mid_s + (k - (n - 1) / 2.0) * w.step_s
        yield (t_s, part, w.number + 1, w.set_rad, *values, w.lost, faults)


class PlatformRecorder:
    """A `PlatformBench` that stores what another one tells."""

    def __init__(self, platform: PlatformBench, folder: Path, label: str, *, holds: bool) -> None:
        """label: of the reading. holds: heading is kept as well. Raises BadInput, OutputError for the files."""
        self._platform = platform
        with ExitStack() as stack:
            self._windows = stack.enter_context(SeriesFile(folder / f"gyrocompass-{label}.csv", WINDOW_COLUMNS))
            held = SeriesFile(folder / f"heading-hold-{label}.csv", LOOK_COLUMNS) if holds else None
            self._looks = stack.enter_context(held) if held else None
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: Any) -> None:
        self._stack.__exit__(*exc)

    # ---- PlatformBench

    @property
    def t_s(self) -> float:
        return self._platform.t_s

    def prepare(self, *, latitude_rad: float, m1_per_s: float, m2_per_s: float) -> None:
        self._platform.prepare(latitude_rad=latitude_rad, m1_per_s=m1_per_s, m2_per_s=m2_per_s)

    def level(self, timeout_s: float) -> None:
        self._platform.level(timeout_s)

    def measure(self, table: Table, done: Callable[[Window], None]) -> Sequence[Window]:
        def keep(w: Window) -> None:
            self._windows.store_rows(window_rows("position", w))
            done(w)

        return self._platform.measure(table, keep)

    def calibrate(self, length_s: float, settle_s: float) -> Window:
        w = self._platform.calibrate(length_s, settle_s)
        self._windows.store_rows(window_rows("calibration", w))
        return w

    def navigate(self, c: Compensation) -> None:
        self._platform.navigate(c)

    def moved(self, *, latitude_rad: float, speed_mps: float, track_rad: float) -> None:
        self._platform.moved(latitude_rad=latitude_rad, speed_mps=speed_mps, track_rad=track_rad)

    def look(self) -> Look:
        seen = self._platform.look()
        if self._looks is not None:
            self._looks.store_rows([(seen.t_s, seen.encoder_rad, seen.heading_rad, "; ".join(seen.faults))])
        return seen

    def wait(self, dwell_s: float) -> None:
        self._platform.wait(dwell_s)


def load_csv(path: Path) -> tuple[Reading, ...]:
    """Read back what `CsvRecorder` wrote; a last row cut short by a crash is left out.

    Raises ValueError with file and line when the columns or a complete row are not as written.
    """
    with path.open(newline="", encoding="utf-8") as f:
        text = f.read()
    complete = text[: text.rfind("\n") + 1]
    rows = list(csv.reader(complete.splitlines()))
    if not rows or tuple(rows[0]) != COLUMNS:
        raise ValueError(expected(f"the columns {','.join(COLUMNS)}", None, f"{path}:1"))
    return tuple(_reading(path, n, row) for n, row in enumerate(rows[1:], start=2))


def _reading(path: Path, line: int, row: Sequence[str]) -> Reading:
    try:
        t_s, face, set_deg, alpha_deg, axis, realisation, u_v = row
        return Reading(
            t_s=float(t_s),
            face=Face(face),
            set_deg=float(set_deg),
            alpha_deg=float(alpha_deg),
            axis=axis,
            realisation=int(realisation),
            u_v=float(u_v),
        )
    except ValueError as err:
        raise ValueError(expected(",".join(COLUMNS), err, f"{path}:{line}")) from err
