"""A recording of the lines of a board as the panel shows it: edges in a window, frames, values of its channels."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from psabench.boards.devices import of_board
from psabench.boards.registry import BOARDS
from psabench.boards.stream import FrameCounters
from psabench.errors import BadInput, expected, input_error
from psabench.link.vcd import Vcd, VcdPart, read_vcd_part
from psabench.panel.channels import Channels, overview_row, unit_message
from psabench.panel.recorded import line_window
from psabench.panel.recorded.base import PlayedView
from psabench.panel.recorded.line_words import NS, decode_lines

MOST_EDGES = 10_000_000  # half a minute of a PSA-2; 0.2 GB while they are read
MOST_NAMES = 1024  # of lines, as `link.vcd` reads them
SCOPE = re.compile(r"\$scope\s+module\s+(\w+)\s+\$end")
READ, DECODED = 0.9, 0.95  # parts of the work


class LinesView(PlayedView):
    """See `view.View`. Raises BadInput for a file that cannot be read. Time is that of the recording."""

    opens_paused = True

    def __init__(self, path: Path, files: Mapping[str, Path], look: Callable[[float], None]) -> None:
        super().__init__(path, files)
        part = _read_lines(path, look)
        self._vcd = Vcd(max(1, part.unit_fs // 10**6), part.start_ns, part.end_ns, part.wires)
        self._damage = part.note
        self._found = decode_lines(self._vcd, lambda: look(DECODED))
        scope = SCOPE.search(part.head)
        self._title = of_board(scope[1]).title if scope and scope[1] in BOARDS else "lines"
        if self._found.samples is not None:
            self.unit = scope[1][:40] if scope else "lines"
            self.titles = {self.unit: (self._title, 0)}
        self._look: Callable[[], None] = lambda: None
        self._begin()

    def _begin(self) -> None:
        self._now_ns, self._taken = self._vcd.start_ns, 0
        self.channels = {name: Channels() for name in self.titles}

    # ---- time

    def look_between(self, look: Callable[[], None]) -> None:
        self._look = look

    def wait(self, for_s: float) -> None:
        self.go_to(self.now_s() + for_s)

    def now_s(self) -> float:
        return self._now_ns / NS

    def go_to(self, t_s: float) -> None:
        t_ns = min(max(round(min(t_s, self._vcd.end_ns / NS) * NS), self._vcd.start_ns), self._vcd.end_ns)
        if t_ns < self._now_ns:
            self._begin()
        self._now_ns = t_ns
        self._look()

    def ended(self) -> str:
        return (self._damage or "end") if self._now_ns >= self._vcd.end_ns else ""

    # ---- what a page asks for

    def about(self) -> Mapping[str, Any]:
        v, found = self._vcd, self._found
        span = {"start_ns": v.start_ns, "end_ns": v.end_ns, "length_s": (v.end_ns - v.start_ns) / NS}
        counts = {"frames": len(found), "errors": len(found.wrong), "torn": len(found.torn)}
        read = {"whole": not self._damage, "damage": self._damage, "board": self._title, "what": found.what}
        chosen = [*found.lines, *(n for n in v.wires if n not in found.lines)]
        return {"kind": "lines", **span, **counts, **read, "lines": chosen[:MOST_NAMES], "shown": len(found.lines)}

    def window(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Edges and words between two instants, as far as they are recorded. Raises Wrong."""
        return line_window.window_of(self._vcd, self._found, request)

    def next_frame(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Raises Wrong where there is none."""
        return line_window.next_frame(self._found, request)

    # ---- what goes by itself

    def take(self, every_unit: bool) -> dict[str, Any]:
        """New buckets of the unit."""
        s = self._found.samples
        if s is None:
            return {}
        end = int(np.searchsorted(s.t_s, self.now_s(), "right"))
        new = slice(self._taken, max(end, self._taken))
        self._taken = new.stop
        c = self.channels[self.unit]
        buckets = c.add(replace(s, t_s=s.t_s[new], values=s.values[new]))
        return unit_message(self.unit, c, buckets) if buckets else {}

    def state(self, *, lines: bool) -> dict[str, Any]:
        """The overview; lost and torn: up to now."""
        if not self.unit:
            return self.played([])
        past = int(np.searchsorted(self._found.end_ns, self._now_ns, "right"))
        lost = int(self._found.missing[:past].sum())
        counters = FrameCounters(frames=past, lost=lost, torn=int(np.searchsorted(self._found.torn, past)))
        row = overview_row(self.unit, self._title, self.channels[self.unit], counters)
        return self.played([row | {"lines": [0, 0]}])

    def can(self, now_s: float) -> dict[str, Any]:
        """The CAN card: lines have none."""
        return {"kind": "can", "buses": []}


def _read_lines(path: Path, look: Callable[[float], None]) -> VcdPart:
    """Raises BadInput for what is no recording of lines, and what `look` raises."""
    try:
        size = max(1, path.stat().st_size)
        with path.open("rb") as file:
            part = read_vcd_part(
                file, str(path), most_edges=MOST_EDGES, look=lambda: look(READ * min(1.0, file.tell() / size))
            )
    except OSError as e:
        raise input_error(path, "a VCD file", e) from e
    except ValueError as e:
        raise BadInput(str(e)) from e
    if part.start_ns < 0 or not part.wires:
        raise BadInput(f"{path}: {part.note or expected('a time and a level of a 1-bit wire', 'none')}")
    return part
