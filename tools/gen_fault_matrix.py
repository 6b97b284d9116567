#!/usr/bin/env python3
"""What the conformance suite says of each fault: tests/conform/support/fault_matrix.yaml as a table of docs/faults.md.

Usage:
    gen_fault_matrix.py           write the text between the marks conform:begin and conform:end of the page
    gen_fault_matrix.py --check   exit 1 if it is out of date
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import Any

from between import marks, spliced
from protogen.source import parse_yaml
from psabench.conform.profile import variant
from psabench.conform.requirements import requirements

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs/faults.md"
TABLE = ROOT / "tests/conform/support/fault_matrix.yaml"


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A kind at some points of a board: what it breaks, why it breaks nothing, or why the suite does not find it."""

    board: str  # with the profile that it has where none is named
    kind: str
    at: tuple[str, ...]  # points
    values: Mapping[str, Any] = field(default_factory=dict)  # of the fault; its event, where it does not begin at once
    bench: str = ""  # what the inputs are: sensors by current, or one that feels 1 g
    breaks: frozenset[str] = frozenset()  # requirements that fail, whatever else does
    unseen: str = ""  # why none does
    open: str = ""  # why the suite does not find it, or was not asked


@cache
def load(path: Path = TABLE) -> tuple[Row, ...]:
    """Raises ValueError for a row that says neither or both, and for a requirement that its board has not."""
    rows = []
    for board, entries in parse_yaml(path.read_text(encoding="utf-8")).items():
        for e in entries:
            row = Row(
                board=board,
                kind=e.pop("kind"),
                at=tuple(e.pop("at")),
                values=e.pop("with", {}),
                bench=e.pop("bench", ""),
                breaks=frozenset(e.pop("breaks", ())),
                unseen=e.pop("unseen", ""),
                open=e.pop("open", ""),
            )
            _checked(row, e)
            rows.append(row)
    return tuple(rows)


def _checked(row: Row, rest: Mapping[str, Any]) -> None:
    where = f"{row.board}: {row.kind} at {', '.join(row.at)}"
    if rest:
        raise ValueError(f"{where}: no such key: {', '.join(rest)}")
    if sum(map(bool, (row.breaks, row.unseen, row.open))) != 1:
        raise ValueError(f"{where}: it wants one of breaks, unseen, open")
    if strange := sorted(row.breaks - {r.id for r in requirements().of(row.board, variant(row.board).profile)}):
        raise ValueError(f"{where}: no requirements of that board: {', '.join(strange)}")


def places(points: tuple[str, ...]) -> str:
    """As the page's other tables: `UNIT.line.CS\\|D0..15`, in the order of the points."""
    found: dict[str, list[str]] = {}
    for point in points:
        where, _, name = re.sub(r"^a\.", "UNIT.", point).rpartition(".")
        found.setdefault(where, []).append(name)
    return ", ".join(f"`{'.'.join(filter(None, (w, _short(names))))}`" for w, names in found.items())


def _short(names: list[str]) -> str:
    """With D0..2 for D0, D1, D2."""
    parts: list[str] = []
    for (stem, _), run in groupby(enumerate(names), lambda at: _numbered(*at)):
        those = [name for _, name in run]
        parts += [f"{those[0]}..{those[-1].removeprefix(stem)}"] if len(those) > 2 else those
    return "\\|".join(parts)


def _numbered(place: int, name: str) -> tuple[str, int]:
    """The same for names at places that follow each other as their numbers do."""
    m = re.fullmatch(r"(\D+)(\d+)", name)
    return (m[1], int(m[2]) - place) if m else (name, 0)


def table() -> str:
    """For the page: a line for each row."""
    lines = ["| board | fault | at | requirements that fail |", "|---|---|---|---|"]
    for r in load():
        found = ", ".join(sorted(r.breaks)) or (f"none: {r.unseen}" if r.unseen else f"not found: {r.open}")
        lines.append(f"| {r.board} | `{r.kind}` | {places(r.at)} | {found} |")
    return "\n".join(lines)


def main(check: bool) -> int:
    was = PAGE.read_text(encoding="utf-8")
    text = spliced(was, marks("conform"), table(), PAGE.name)
    if not check:
        PAGE.write_text(text, encoding="utf-8")
    elif text != was:
        print("gen_fault_matrix: docs/faults.md is out of date (make docs)")
    return int(check and text != was)


if __name__ == "__main__":
    try:
        sys.exit(main("--check" in sys.argv[1:]))
    except ValueError as e:
        sys.exit(f"gen_fault_matrix: {e}")
