"""What a procedure may ask of a bench, and nothing else.

A procedure is written against `HeadBench`; the same procedure then runs on the emulator over CAN, on a real
dividing head and on the in-memory bench of the tests. Faces are those of `psabench.estimate.face`. Angles are degrees
here because the head's scale is (estimators take radians), voltages are volts at the load resistor, before the
board's divider.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import numpy.typing as npt

from psabench.estimate.face import Face
from psabench.progress import Advance, Estimated, Known


class HeadBench(Protocol):
    """A dividing head with an accelerometer on it, wired to one axis of a converter board."""

    g_mps2: float  # local gravity; only used to print SI, the estimates are in V per local g

    @property
    def t_s(self) -> float:
        """Bench time, s: simulated or wall, monotonic."""
        ...

    def turn(self, angle_deg: float) -> float:
        """Set the head and return its own readout, deg (setting error and resolution are the head's)."""
        ...

    def mount(self, face: Face) -> None:
        """Put the sensor into its mount with this face."""
        ...

    def read(self, axis: str, readings: int) -> npt.NDArray[np.float64]:
        """Settled readings of `axis` ("x", "y" or "z"), volts at the load, shape (readings,)."""
        ...

    def wait(self, dwell_s: float) -> None:
        """Let the bench's time pass."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """One voltage, with everything needed to estimate from it later."""

    t_s: float
    face: Face
    set_deg: float  # what the head was asked for
    alpha_deg: float  # what the head answered; this is what the estimator uses
    axis: str
    realisation: int  # 0-based repetition of the whole series
    u_v: float  # at the load


class Progress(Protocol):
    """Where a procedure tells how far it is. The command line draws a bar, the tests count."""

    def step(self, name: str, total: int) -> AbstractContextManager[Advance]:
        """Enter a step of `total` equal parts; the value entered is called once per part done."""
        ...


class Silent:
    """A `Progress` that says nothing."""

    @contextmanager
    def step(self, name: str, total: int) -> Iterator[Advance]:
        yield lambda note="": None


def _drop(_: Reading) -> None:
    """No one wants the readings as they come."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Watch:
    """Who follows a run: progress, and a callback that gets each reading as soon as it exists.

    After Ctrl-C (`KeyboardInterrupt` goes through the procedure untouched) whatever `record` got is all there
    is, so it writes through: `recording.CsvRecorder` does.
    """

    progress: Progress = field(default_factory=Silent)
    record: Callable[[Reading], None] = _drop
    estimated: Estimated | None = None  # gets what is known so far

    def estimate(self, readings: Sequence[Reading], fit: Callable[[], Sequence[Known]]) -> None:
        """Say what the readings tell by now; nothing while they do not suffice."""
        if self.estimated is not None:
            with suppress(ValueError):
                self.estimated(len(readings), fit())
