"""What holds for all lines of a board alike: each moves where it has work, none is at a level for too short a time.

Figures are limits of a requirement. NAME_edges: how often the line moves at least in the stimulus. NAME_high_min_ns,
NAME_low_min_ns: how long it stays at a level at least; NAME_min_ns: at either. NAME is a line in small letters, or what
numbered lines have in common: d for D0, D1 ... What begins in the first begin_ns of a recording may lack an edge.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from psabench.conform.capture.intervals import edges
from psabench.conform.capture.log import Capture, apart
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, conclusive, expect

LEAST = re.compile(r"(?P<line>\w+?)(_(?P<level>high|low))?_min_ns")
LEVELS = {"high": (1,), "low": (0,), None: (0, 1)}


def lines_of(e: Capture, name: str) -> list[str]:
    """The lines that a limit is for. Raises Inconclusive where the recording has none of them."""
    pattern = re.compile(rf"{name}\d*", re.IGNORECASE)
    exact = [wire for wire in e.wires.recording.wires if wire.lower() == name]
    found = exact or [wire for wire in e.wires.recording.wires if pattern.fullmatch(wire)]
    conclusive(found, f"the recording has no line {name.upper()}")
    return found


def shortest(row: Requirement) -> Iterator[tuple[str, int, float]]:
    """Name of a line, level, and how long it stays there at least, ns."""
    for name, least_ns in row.limits.items():
        if m := LEAST.fullmatch(name):
            yield from ((m["line"], level, float(least_ns)) for level in LEVELS[m["level"]])


def none_is_too_short(e: Capture, row: Requirement) -> str:
    """Measure every stay of every line at its levels. Returns what was seen; raises Failed, Inconclusive."""
    count, seen = 0, set()
    whole_ns = e.wires.start_ns + row.limits.get("begin_ns", -1)
    for name, level, least_ns in shortest(row):
        slack_ns = row.limit("tolerance_ns") + apart(least_ns, row.limit("clock_error_ppm")) + e.slack_ns(least_ns)
        for wire in lines_of(e, name):
            begin, end = e.wires.pulses(wire, level)
            begin, end = begin[begin > whole_ns], end[begin > whole_ns]
            short = np.flatnonzero(end - begin < least_ns - slack_ns)
            if len(short):
                k = int(short[0])
                saw = f"{wire} {('low', 'high')[level]} for {end[k] - begin[k]} ns ({len(short)} of {len(begin)})"
                raise Failed(saw, f"{least_ns:g} ns or longer", at_ns=int(begin[k]), lines=(wire,))
            count += len(begin)
            seen.add(wire)
    conclusive(count, "no line moves in the recording")
    return f"{count} stays of {len(seen)} lines, none too short"


def all_move(e: Capture, row: Requirement, ending: str = "_edges") -> str:
    """Count edges of the lines that have work. Returns what was seen; raises Failed, Inconclusive."""
    due = {name.removesuffix(ending): int(least) for name, least in row.limits.items() if name.endswith(ending)}
    names = {wire: least for name, least in due.items() for wire in lines_of(e, name)}
    for wire, least in names.items():
        count = len(edges(e, wire))
        saw = f"{count} edges of {wire}, always {int(e.wires[wire].level[0])}"
        expect(count >= least, saw, f"{least} or more", at_ns=e.wires.start_ns, lines=(wire,))
    return f"{len(names)} lines with their edges"


def bus_moves(e: Capture) -> str:
    """CS, and lines of the bus that a cycle has at 1, have edges. Raises Failed, Inconclusive."""
    conclusive(e.cycles, "no cycle on the bus")
    words = {"AB": 0, "D": 0}
    for c in e.cycles:
        words["AB"] |= c.address
        words["D"] |= c.data
    due = ["CS", *(["RW"] if any(c.write for c in e.cycles) else [])]
    due += [f"{name}{k}" for name, word in words.items() for k in range(16) if word >> k & 1]
    for wire in due:
        conclusive(wire in e.wires, f"the recording has no line {wire}")
        if not len(edges(e, wire)):
            level = int(e.wires[wire].level[0])
            raise Failed(f"{wire} always {level}", "a cycle moves it", at_ns=e.wires.start_ns, lines=(wire, "CS"))
    return f"{len(due)} lines of the bus move in {len(e.cycles)} cycles"
