"""What is kept of a test that fails: the lines and the frames since power-on, and the bench as it was."""

from __future__ import annotations

import shlex
import shutil
from collections.abc import Callable
from pathlib import Path

from psabench.bench import Bench
from psabench.errors import BenchError, ControlError

LIMIT_MB = 200.0  # of the lines of one test: 100 s of a PSA-2 at 1000 frames/s
VCD, LOG, SNAPSHOT = "lines.vcd", "can.log", "bench.snapshot"


class Recording:
    """Of a bench from its first instant, in a folder that is thrown away unless `keep` is called."""

    def __init__(self, bench: Bench, work: Path, folder: Path) -> None:
        """work: has LOG already. folder: where `keep` puts the files; one from an earlier run is removed."""
        self._bench = bench
        self._work = work
        self._folder = folder
        shutil.rmtree(folder, ignore_errors=True)
        try:
            bench.probe.start(work / VCD, limit_mb=LIMIT_MB)
            self._no_lines = ""
        except ControlError as e:  # a board without lines, as the inertial unit
            self._no_lines = str(e)

    def keep(self, test: str) -> str:
        """Saves the files while the bench is there; returns what is where, and the commands that go on from there."""
        self._folder.mkdir(parents=True, exist_ok=True)
        rows = [
            self._row(SNAPSHOT, "the bench at this instant, with its history since power-on", self._save_snapshot),
            self._row(VCD, "lines of the first unit since power-on", self._end_lines),
            self._row(LOG, "frames since power-on, candump -L", lambda: None),
        ]
        again = ["run the test again:", f"  python -m pytest {shlex.quote(test)}"]
        return "\n".join([f"kept in {self._folder}:", *rows, *self._commands(), *again])

    def _commands(self) -> list[str]:
        """That go on from the snapshot, if there is one."""
        snapshot = self._folder / SNAPSHOT
        if not snapshot.exists():
            return []
        python = f"from psabench import Bench; bench = Bench.restore({str(snapshot)!r})"
        first = f"  psa-emu --restore {shlex.quote(str(snapshot))}"
        return ["go on from this instant:", first, f'  python -i -c "{python}"']

    def finish(self) -> None:
        """After the bench is closed, which completes the log: keeps it, too, if anything is kept."""
        if self._folder.is_dir():
            self._take(LOG)

    def _save_snapshot(self) -> None:
        self._bench.snapshot(self._folder / SNAPSHOT)

    def _end_lines(self) -> None:
        if self._no_lines:
            raise BenchError(self._no_lines)
        try:
            self._bench.probe.stop()
        finally:  # one that has reached its limit is kept up to there
            self._take(VCD)

    def _take(self, name: str) -> None:
        if not (self._work / name).exists():
            raise BenchError("no such recording")
        shutil.copyfile(self._work / name, self._folder / name)

    @staticmethod
    def _row(name: str, what: str, save: Callable[[], None]) -> str:
        """One file of the list; a test must show its own failure, whatever the bench is able to save."""
        try:
            save()
        except (BenchError, OSError) as e:
            return f"  {name:16}{what}; not complete: {e}"
        return f"  {name:16}{what}"
