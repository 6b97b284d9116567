"""Where the bench of a panel comes from: opened, and again after it was lost; begun with another scenario; restored."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from psabench.bench import Bench
from psabench.errors import BenchError
from psabench.panel.bench_view import BenchView
from psabench.shell.connect import Opening


@dataclass(slots=True)
class Source:
    """out: the folder for files. truth: a port that is not the emulator's own to tell."""

    opening: Opening
    out: Path
    truth: Path | None = None

    @property
    def is_own(self) -> bool:
        """Whether its emulator is the panel's: only that one may be exchanged."""
        return not self.opening.there

    @property
    def scenario(self) -> str:
        return self.opening.scenario or "calibrate"

    def open(self) -> BenchView:
        """Raises BenchError."""
        return self._view_of(self.opening)

    def _view_of(self, opening: Opening) -> BenchView:
        def opened() -> Bench:
            bench = opening.open()
            if self.truth is not None:
                bench.truth_path = self.truth
            return bench

        return bench_of(opened, lambda b: BenchView(b, self.out, opening.start))

    def begin(self, scenario: str, seed: int | None) -> BenchView:
        """Another scenario from now on, also after a loss. Raises BenchError, and nothing has changed."""
        self.check_own("start")
        opening = replace(self.opening, scenario=scenario, seed=seed, node=None)
        view = self._view_of(opening)
        self.opening = opening
        return view

    def restored(self, path: Path) -> BenchView:
        """From a snapshot. Raises BenchError."""
        self.check_own("go back")
        pace = self.opening.pace or "step"
        return bench_of(lambda: Bench.restore(path, pace=pace), lambda b: BenchView(b, self.out))

    def check_own(self, what: str) -> None:
        if not self.is_own:
            raise BenchError(f"panel: {what}: this emulator was not started by the panel")


def forked(view: BenchView) -> BenchView:
    """A second bench that goes on from this instant, with the script that leads there. Raises BenchError."""
    new = bench_of(view.bench.fork, lambda b: BenchView(b, view.out, view.start))
    new.histories = view.histories
    new.session.transcript = view.session.transcript.copy()
    if view.session.dut_name in new.bench.units:
        new.session.use(view.session.dut_name)
    return new


def bench_of(opened: Callable[[], Bench], make: Callable[[Bench], BenchView]) -> BenchView:
    """A view of a bench that is closed again where there is none to be had."""
    bench = opened()
    try:
        return make(bench)
    except BaseException:
        bench.close()
        raise
