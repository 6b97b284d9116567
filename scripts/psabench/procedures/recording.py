"""Readings on disk: one CSV row per reading, flushed as it comes, so an interrupted run loses nothing."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any, Self

from psabench.errors import expected
from psabench.estimate.face import Face
from psabench.link.own import output_text
from psabench.procedures.head_bench import Reading

COLUMNS = ("t_s", "face", "set_deg", "alpha_deg", "axis", "realisation", "u_v")


class SeriesFile:
    """A time series of a run: named columns with their units, a row at a time; the format of all of them."""

    def __init__(self, path: Path, columns: Sequence[str], what: str = "rows") -> None:
        """Raises BadInput or OutputError when the file cannot be made; an earlier file of that name is replaced."""
        self.path = path
        self.rows = 0
        with ExitStack() as stack:
            self._file: IO[str] = stack.enter_context(output_text(path, lambda: f"stored {self.rows} {what}"))
            self._csv = csv.writer(self._file, lineterminator="\n")
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
