"""What a platform told, on disk: a row for each step of a window, a row for each look at a hold, as they come.

OUT/gyrocompass-READING.csv and OUT/heading-hold-READING.csv, the format of all series (`recording.SeriesFile`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

from psabench.procedures.platform_bench import Compensation, Look, PlatformBench, Table, Window
from psabench.procedures.recording import SeriesFile

STEP_ARRAYS = ("beta_rad", "gamma_rad", "u1_radps", "u2_radps", "encoder_rad", "turned_rad")  # of a Window
WINDOW_COLUMNS = ("t_s", "part", "position", "set_rad", *STEP_ARRAYS, "lost", "faults")
LOOK_COLUMNS = ("t_s", "encoder_rad", "heading_rad", "faults")


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
