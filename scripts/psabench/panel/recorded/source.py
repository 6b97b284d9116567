"""Which recording is shown: a file, or one of a folder; by its ending a log of the bus or lines of a board."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from psabench.errors import BadInput, expected
from psabench.logs.formats import READABLE
from psabench.panel.recorded.base import PlayedView
from psabench.panel.recorded.can_view import CanView
from psabench.panel.recorded.lines_view import LinesView

FILES = 200  # of a folder that are offered
LINES = ".vcd"  # ending of a recording of lines

Look = Callable[[float], None]


def recording_files(path: Path) -> list[Path]:
    """The file, or those of a folder that a recording may be. Raises BadInput."""
    if path.exists() and not (path.is_dir() or path.is_file()):  # going back reads it again
        raise BadInput(expected("a file or a folder", "a pipe or a device", path))
    if not path.is_dir():
        return [path]
    endings = (*READABLE, LINES)
    found = sorted(p for p in path.iterdir() if p.is_file() and p.suffix.lower() in endings)
    if not found:
        raise BadInput(expected(f"a file with an ending of {' '.join(endings)}", "none", path))
    return found[:FILES]


def _look_at_nothing(_: float) -> None:
    """Where no one waits."""


@dataclass(frozen=True, slots=True)
class RecordingSource:
    """path: a file or a folder; chosen: the file of it that is shown."""

    path: Path
    board: str = "psa2"
    node: int | None = None
    chosen: str = ""

    is_own = False

    def open(self) -> PlayedView:
        """Raises BadInput."""
        return self.open_slowly(_look_at_nothing)

    def open_slowly(self, look: Look) -> PlayedView:
        """look: called again and again with the part that has been read, 0 to 1; what it raises ends it.

        Raises BadInput.
        """
        files = {p.name: p for p in recording_files(self.path)}
        name = self.chosen or next(iter(files))
        if name not in files:
            raise BadInput(expected(", ".join(files), repr(name[:40]), "recording"))
        if files[name].suffix.lower() == LINES:
            return LinesView(files[name], files, look)
        return CanView(files[name], files, self.board, self.node, look)

    @property
    def name(self) -> str:
        return self.chosen or self.path.name

    def choose(self, name: str) -> RecordingSource:
        return replace(self, chosen=name)
