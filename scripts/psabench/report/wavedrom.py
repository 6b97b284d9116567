"""A window of a recording as WaveDrom JSON, one column a tick, or as our own picture.

WaveJSON (wavedrom.com/tutorial.html): `signal` is a list of lines with `name` and `wave`, a character a column; `=` is
a value that `data` names, `.` continues the column before. Every edge of the window is an edge of the picture: a tick
is never longer than the shortest pulse. Edges that lie between two columns appear at the later one.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from psabench.errors import expected
from psabench.link.vcd import Ints, Vcd
from psabench.report.drawing import Panel, Section, need, render

MOST_COLUMNS = 2000
NARROW_COLUMNS = 100  # from here on a column is half as wide


@dataclass(frozen=True, slots=True)
class Window:
    """What is cut out of a recording; tick_ns 0: the longest that shows every edge."""

    lines: Sequence[str]  # or a name before numbers: D is D0, D1 ...
    start_ns: int
    end_ns: int
    tick_ns: int = 0
    title: str = ""  # of the picture


def wavedrom_text(vcd: Vcd, window: Window, title: str) -> str:
    """The JSON file. Raises ValueError: no such line, an empty window, too many columns."""
    wires = [_wires_of(vcd, name) for name in window.lines]
    _need_time(vcd, window)
    edges = _edge_instants(vcd, [wire for names in wires for wire in names], window)
    tick_ns, first_ns = _column_grid(edges, window)
    at_ns = np.arange(first_ns, window.end_ns + 1, tick_ns)
    signal = [
        _signal_row(name, _column_levels(vcd, names, at_ns), names)
        for name, names in zip(window.lines, wires, strict=True)
    ]
    foot = f"a column is {tick_ns} ns, the first begins at {first_ns} ns"
    return "\n".join(_json_lines(signal, title, foot, {"skin": "narrow"} if len(at_ns) >= NARROW_COLUMNS else {}))


def window_picture(vcd: Vcd, windows: Sequence[Window], title: str) -> str:
    """Windows below one another as SVG, time from the begin of each. Raises ValueError as above."""
    panels = []
    for window in windows:
        rows = [wire for name in window.lines for wire in _wires_of(vcd, name)]
        _need_time(vcd, window)
        panels.append(Panel(rows, (Section(window.start_ns, window.end_ns, window.start_ns, window.title),)))
    return render(vcd, panels, title)


def _wires_of(vcd: Vcd, name: str) -> list[str]:
    """A line, or the lines of a bus, bit 0 first."""
    if name in vcd.wires:
        return [name]
    bits = [wire for wire in vcd.wires if wire.removeprefix(name).isdigit() and wire.startswith(name)]
    if not bits:
        need(vcd, {name})
    return sorted(bits, key=lambda wire: int(wire.removeprefix(name)))


def _need_time(vcd: Vcd, window: Window) -> None:
    if not vcd.start_ns <= window.start_ns < window.end_ns <= vcd.end_ns:
        span = f"{vcd.start_ns} <= from < to <= {vcd.end_ns} ns"
        raise ValueError(expected(span, f"from {window.start_ns} to {window.end_ns} ns", "window"))


def _edge_instants(vcd: Vcd, wires: Sequence[str], window: Window) -> list[Ints]:
    """Of each line, instants of its changes inside the window."""
    found = []
    for wire in wires:
        t_ns = vcd.wires[wire].t_ns[1:]
        found.append(t_ns[(t_ns > window.start_ns) & (t_ns <= window.end_ns)])
    return found


def _column_grid(edges: Sequence[Ints], window: Window) -> tuple[int, int]:
    """Tick and begin of the first column, at the window's begin or up to a tick before it.

    By default every edge begins a column where so many columns do, else the shortest pulse is a column.
    """
    every, span_ns = np.concatenate([*edges, np.empty(0, np.int64)]), window.end_ns - window.start_ns
    pulses = [np.diff(t_ns) for t_ns in edges if len(t_ns) > 1]
    shortest_ns = int(min((d.min() for d in pulses), default=span_ns))
    tick_ns = window.tick_ns
    if not tick_ns:
        common_ns = int(np.gcd.reduce(np.diff(np.unique(every)))) if len(np.unique(every)) > 1 else span_ns
        tick_ns = common_ns if _columns_of(span_ns, common_ns) <= MOST_COLUMNS else shortest_ns
    if not 0 < tick_ns <= shortest_ns:
        raise ValueError(
            expected(f"up to {shortest_ns} ns, the shortest pulse of these lines", f"{tick_ns} ns", "tick")
        )
    columns = _columns_of(span_ns, tick_ns)
    if columns > MOST_COLUMNS:
        raise ValueError(expected(f"at most {MOST_COLUMNS} columns", f"{columns} of {tick_ns} ns", "window"))
    late_ns = (int(every.min()) - window.start_ns) % tick_ns if len(every) else 0
    return tick_ns, window.start_ns + late_ns - (tick_ns if late_ns else 0)


def _columns_of(span_ns: int, tick_ns: int) -> int:
    """At most: one more where the first begins earlier, one with the end."""
    return span_ns // tick_ns + 2


def _column_levels(vcd: Vcd, wires: Sequence[str], at_ns: Ints) -> list[int]:
    """The number that the lines are, bit 0 first, in each column."""
    bits = [vcd.wires[wire].at(at_ns).astype(np.int64) << bit for bit, wire in enumerate(wires)]
    return [int(value) for value in np.sum(bits, axis=0)]


def _signal_row(name: str, levels: Sequence[int], wires: Sequence[str]) -> dict[str, object]:
    wave = "".join(_wave_marks(levels, len(wires)))
    if len(wires) == 1:
        return {"name": name, "wave": wave}
    digits = (len(wires) + 3) // 4
    values = [v for v, mark in zip(levels, wave, strict=True) if mark == "="]
    return {"name": f"{name}[{len(wires) - 1}:0]", "wave": wave, "data": [f"{v:0{digits}X}h" for v in values]}


def _wave_marks(levels: Sequence[int], bits: int) -> Iterator[str]:
    before = None
    for level in levels:
        yield "." if level == before else str(level) if bits == 1 else "="
        before = level


def _json_lines(signal: Sequence[dict[str, object]], title: str, foot: str, config: dict[str, str]) -> Iterator[str]:
    """JSON with a line a signal."""
    yield '{"signal": ['
    yield ",\n".join("  " + json.dumps(row, ensure_ascii=False) for row in signal)
    rest = {"head": {"text": title}, "foot": {"text": foot}, "config": config}
    yield f"], {json.dumps(rest, ensure_ascii=False)[1:]}"
    yield ""
