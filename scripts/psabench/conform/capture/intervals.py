"""What checks share: facts and lines that they need, intervals, coincidences of edges, levels at instants."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from psabench.conform.capture.log import Bools, Capture
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, conclusive, none_of
from psabench.link.signals import Floats, Ints


def fact(e: Capture, name: str, lacking: str = "") -> Any:
    """What the stimulus noted under this name. Raises Inconclusive, in these words, where it has not."""
    conclusive(name in e.facts, lacking or f"the scene has no {name}")
    return e.facts[name]


def wires_needed(e: Capture, *names: str) -> None:
    """Raises Inconclusive for a line that the recording lacks."""
    for name in names:
        conclusive(name in e.wires, f"the recording has no line {name}")


def first_of(bad: Bools) -> int | None:
    """Place of the first that is true; None: none is."""
    return int(np.argmax(bad)) if bad.any() else None


def first_bad(
    bad: npt.NDArray[np.bool_], at_ns: Ints, saw: Sequence[str] | str, due: str, lines: Sequence[str]
) -> None:
    """Raises Failed for the first of `bad`, saying what was seen there (a text for each, or for all) and how many."""
    if (k := first_of(bad)) is not None:
        what = saw if isinstance(saw, str) else saw[k]
        raise Failed(f"{what} ({int(bad.sum())} of {len(bad)})", due, at_ns=int(at_ns[k]), lines=lines)


def none_at(at_ns: Ints, saw: str, due: str, lines: Sequence[str]) -> None:
    """Raises Failed at the first of these instants."""
    if len(at_ns):
        raise Failed(saw, due, at_ns=int(at_ns[0]), lines=lines)


def at_levels(e: Capture, names: Sequence[str], at_ns: int, row: Requirement, when: str, beside: Sequence[str]) -> str:
    """Each line has its level of the row, `name_level`, 0 by default. Raises Failed, showing the lines beside it."""
    for name in names:
        due = int(row.limits.get(f"{name.lower()}_level", 0))
        if int(e.wires[name].at(at_ns)) != due:
            raise Failed(f"{name} {1 - due} {when}", f"{due}", at_ns=at_ns, lines=(name, *beside))
    return f"{len(names)} lines at rest"


def interval(
    e: Capture, from_ns: Ints, to_ns: Ints, due_ns: float, tolerance_ns: float, what: str, lines: Sequence[str]
) -> str:
    """(n,) each to_ns - from_ns is due_ns, as far as no samples were lost between. Returns what was seen.

    Raises Failed, Inconclusive where there is none.
    """
    known = e.wires.known(np.minimum(from_ns, to_ns), np.maximum(from_ns, to_ns))
    from_ns, to_ns = from_ns[known], to_ns[known]
    conclusive(len(from_ns), f"nothing to measure: {what}")
    took_ns = (to_ns - from_ns).astype(np.float64)
    slack_ns = tolerance_ns + e.slack_ns(due_ns)
    saw = [f"{t:.0f} ns {what}" for t in took_ns]
    first_bad(np.abs(took_ns - due_ns) > slack_ns, from_ns, saw, f"{due_ns:.1f} +- {slack_ns:.1f} ns", lines)
    return f"{len(took_ns)} times {took_ns.min():.0f} to {took_ns.max():.0f} ns {what}"


def rises_at_rate(e: Capture, row: Requirement, line: str, what: str) -> str:
    """Rises of the line come at `period_us` of the row, as exact as its clock. As interval()."""
    rises, period_ns = e.wires.rises(line), row.limit("period_us") * 1e3
    tolerance_ns = period_ns * row.limit("clock_error_ppm") * 1e-6
    return interval(e, rises[:-1], rises[1:], period_ns, tolerance_ns, what, (line,))


def counted(numbers: Ints | Floats, modulo: int, name: str) -> str:
    """(n,) readings are numbered without a gap, over the wrap. Raises Failed."""
    n: Ints = numbers.astype(np.int64)
    steps: Ints = np.diff(n) % modulo
    none_of(np.flatnonzero(steps != 1).tolist(), lambda k: f"{name} {n[k]}, then {n[k + 1]}", "one more")
    return f"{len(numbers)} readings without a gap"


def nearest(edges_ns: Ints, at_ns: Ints) -> Ints:
    """(n,) the edge nearest to each instant; far away where there are no edges."""
    if not len(edges_ns):
        return np.full(len(at_ns), np.iinfo(np.int64).max // 4, np.int64)
    k = np.searchsorted(edges_ns, at_ns)
    before, after = edges_ns[np.maximum(k - 1, 0)], edges_ns[np.minimum(k, len(edges_ns) - 1)]
    return np.where(np.abs(at_ns - before) <= np.abs(after - at_ns), before, after)


def before(edges_ns: Ints, at_ns: Ints) -> Ints:
    """(n,) the last edge before each instant; far before where there is none."""
    padded = np.concatenate(([np.int64(np.iinfo(np.int64).min // 4)], edges_ns))
    found: Ints = padded[np.searchsorted(edges_ns, at_ns, "left")]
    return found


def after(edges_ns: Ints, at_ns: Ints) -> Ints:
    """(n,) the first edge strictly after each instant; far away where there is none."""
    padded = np.concatenate((edges_ns, [np.int64(np.iinfo(np.int64).max // 4)]))
    found: Ints = padded[np.searchsorted(edges_ns, at_ns, "right")]
    return found


def within(edges_ns: Ints, begin_ns: int, end_ns: int) -> Ints:
    """Those from one instant to the other, both included."""
    return edges_ns[np.searchsorted(edges_ns, begin_ns, "left") : np.searchsorted(edges_ns, end_ns, "right")]


def together(e: Capture, at_ns: Ints, edges_ns: Ints, tolerance_ns: float, what: str, lines: Sequence[str]) -> str:
    """Each instant (n,) is one of these edges. Returns what was seen; raises Failed, Inconclusive."""
    conclusive(len(at_ns), f"nothing to compare: {what}")
    off_ns = np.abs(at_ns - nearest(edges_ns, at_ns))
    slack_ns = tolerance_ns + e.slack_ns(0.0)
    saw = [f"{min(int(t), 10**9)} ns between {what}" for t in off_ns]
    first_bad(off_ns > slack_ns, at_ns, saw, f"not more than {slack_ns:.1f} ns", lines)
    return f"{len(at_ns)} times, not more than {off_ns.max()} ns between {what}"


def overlaps(n: int, m: int) -> Iterator[tuple[slice, slice]]:
    """Where n things of one row lie beside m of another that shows the same: by each shift that leaves out few.

    Few: those that only one of them has at its ends, two at the most.
    """
    for shift in range(-(m - 1), n):
        a, b = max(0, shift), min(n, shift + m)
        if b - a >= min(n, m) - 2:
            yield slice(a, b), slice(a - shift, b - shift)


def edges(e: Capture, name: str) -> Ints:
    """All edges of a line in the recording."""
    found: Ints = e.wires[name].t_ns[1:]
    return found


def bus_word(e: Capture, prefix: str, bits: int, at_ns: Ints) -> Ints:
    """(n,) what the lines prefix0 .. make up at these instants."""
    word = np.zeros(len(at_ns), np.int64)
    for k in range(bits):
        word |= e.wires[f"{prefix}{k}"].at(at_ns).astype(np.int64) << k
    return word
