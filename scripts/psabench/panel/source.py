"""Where the bench of a panel comes from: opened, and again after it was lost; begun with another scenario; restored."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

from psabench.bench import Bench
from psabench.errors import BenchError, expected
from psabench.panel import view
from psabench.panel.bench_view import BenchView
from psabench.shell.connect import Opening
from psabench.shell.transcript import Transcript


@dataclass(slots=True)
class Source:
    """out: the folder for files. truth: a port that is not the emulator's own to tell."""

    opening: Opening
    out: Path
    truth: Path | None = None
    histories: dict[str, Transcript] = field(default_factory=dict)  # what led to each snapshot of any of its benches

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

        return bench_of(opened, lambda b: BenchView(b, self.out, opening.start, self.histories))

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
        return bench_of(
            lambda: Bench.restore(path, pace=pace), lambda b: BenchView(b, self.out, histories=self.histories)
        )

    def check_own(self, what: str) -> None:
        if not self.is_own:
            raise BenchError(f"panel: {what}: this emulator was not started by the panel")


def own_source(source: view.Source, what: str) -> Source:
    """That of an emulator which the panel has started. Raises BenchError."""
    if not isinstance(source, Source):
        raise BenchError(expected("a bench", "a recording", f"panel: {what}"))
    source.check_own(what)
    return source


def bench_view(shown: view.View) -> BenchView:
    """What is shown, where it is a bench. Raises BenchError."""
    if not isinstance(shown, BenchView):
        raise BenchError(expected("a bench", "a recording", "panel"))
    return shown


def forked_view(origin: BenchView) -> BenchView:
    """A second bench that goes on from this instant, with the script that leads there. Raises BenchError."""
    new = bench_of(origin.bench.fork, lambda b: BenchView(b, origin.out, origin.start, origin.histories))
    new.session.transcript = origin.session.transcript.copy()
    if origin.unit in new.bench.units:
        new.session.use(origin.unit)
    return new


def bench_of(opened: Callable[[], Bench], make: Callable[[Bench], BenchView]) -> BenchView:
    """A view of a bench that is closed again where there is none to be had."""
    bench = opened()
    try:
        return make(bench)
    except BaseException:
        bench.close()
        raise
