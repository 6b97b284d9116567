"""A window of recorded lines for the page: edges, or what a column of pixels has of them where there are more."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from psabench.errors import expected
from psabench.link.vcd import MOST_NS, Vcd, Wire
from psabench.panel.recorded.line_words import Decoded
from psabench.shell.lexer import Wrong

COLUMNS = 4000  # of pixels
MOST_LINES = 64
MOST_FRAMES = 40  # whose words are written out
MOST_MARKS = 400  # of frames that are wrong


def line_part(name: str, wire: Wire, begin_ns: int, end_ns: int, columns: int) -> dict[str, Any]:
    """Level at the begin, and instants of the edges; with more edges than columns each column's levels instead.

    columns: a character each: "0", "1" for a level that stays, "2" for both.
    """
    a, b = np.searchsorted(wire.t_ns, [begin_ns, end_ns], "right").tolist()
    level = int(wire.level[max(a - 1, 0)])
    found: dict[str, Any] = {"name": name, "level": level, "edges": b - a}
    if b - a <= columns:
        return found | {"t_ns": wire.t_ns[a:b].tolist()}
    limits = begin_ns + (end_ns - begin_ns) * np.arange(columns + 1) // columns
    count = np.searchsorted(wire.t_ns, limits, "right") - a
    kind = np.where(np.diff(count) > 0, 2, level ^ (count[:-1] & 1))
    return found | {"columns": "".join(map(str, kind.tolist()))}


def window_of(vcd: Vcd, found: Decoded, request: Mapping[str, Any]) -> dict[str, Any]:
    """What the page draws between two instants. Raises Wrong for what cannot be drawn."""
    begin_ns, end_ns = _whole_number(request, "from_ns", MOST_NS), _whole_number(request, "to_ns", MOST_NS)
    columns, names = _whole_number(request, "columns", COLUMNS), _names_in(request, vcd)
    if not begin_ns < end_ns or not columns:
        raise Wrong(expected("from_ns < to_ns, columns > 0", f"{begin_ns}, {end_ns}, {columns}", "window"))
    seen = found.between(begin_ns, end_ns)
    wrong = found.wrong[slice(*np.searchsorted(found.wrong, [seen.start, seen.stop]))]
    return {
        "from_ns": begin_ns,
        "to_ns": end_ns,
        "lines": [line_part(n, vcd.wires[n], begin_ns, end_ns, columns) for n in names],
        "seen": len(seen),
        "frames": [frame_part(found, k) for k in seen] if len(seen) <= MOST_FRAMES else [],
        "wrong": found.begin_ns[wrong[:MOST_MARKS]].tolist(),
    }


def frame_part(found: Decoded, k: int) -> dict[str, Any]:
    """A frame with its words."""
    words = [{"begin_ns": t.start_ns, "end_ns": t.end_ns, "text": t.text} for t in found.tags(k)]
    return frame_place(found, k) | {"words": words}


def frame_place(found: Decoded, k: int) -> dict[str, Any]:
    """Where a frame is, and what is wrong with it."""
    begin_ns, end_ns = int(found.begin_ns[k]), int(found.end_ns[k])
    return {"place": k + 1, "begin_ns": begin_ns, "end_ns": end_ns, "wrong": found.why(k)}


def next_frame(found: Decoded, request: Mapping[str, Any]) -> dict[str, Any]:
    """The next frame, torn one or wrong one after an instant, or before it where "back" is true. Raises Wrong."""
    at_ns, what = _whole_number(request, "at_ns", MOST_NS), str(request.get("what", ""))[:40]
    kinds = {"frame": np.arange(len(found)), "torn": found.torn, "error": found.wrong}
    if what not in kinds:
        raise Wrong(expected(", ".join(kinds), repr(what), "what"))
    places = kinds[what]
    begins, back = found.begin_ns[places], request.get("back") is True
    k = int(np.searchsorted(begins, at_ns, "left")) - 1 if back else int(np.searchsorted(begins, at_ns, "right"))
    if not 0 <= k < len(places):
        name = {"frame": found.what, "torn": f"torn {found.what}", "error": "error"}[what]
        raise Wrong(expected(f"a {name} {'before' if back else 'after'} {at_ns / 1e9:.9f} s", "none", "lines"))
    return frame_place(found, int(places[k]))


def _whole_number(request: Mapping[str, Any], name: str, most: int) -> int:
    value = request.get(name)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= most:
        raise Wrong(expected(f"an integer from 0 to {most}", repr(value)[:40], name))
    return value


def _names_in(request: Mapping[str, Any], vcd: Vcd) -> list[str]:
    names = request.get("lines")
    if (
        not isinstance(names, list)
        or len(names) > MOST_LINES
        or not all(isinstance(n, str) and n in vcd.wires for n in names)
    ):
        known = f"up to {MOST_LINES} lines of the recording"
        raise Wrong(expected(known, repr(names)[:40], "lines"))
    return names
