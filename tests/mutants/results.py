"""Results so far, kept in mutants.json as they come."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tests.mutants import report
from tests.mutants.declared import Mutant
from tests.mutants.verdict import KILLED, Result

PARTS = ("declared", "random")


class Book:
    """Of one part, declared or random; the other stays as it is in the file."""

    def __init__(self, path: Path, part: str, rows: Sequence[Mutant]) -> None:
        """rows: all of this part. What the file has of them is as long as the row is the same."""
        self._path, self._part, self._rows = path, part, rows
        before = report.read(path)
        stamps = {m.id: m.stamp() for m in rows}
        found = {p: [Result.of(row) for row in before.get(p, [])] for p in PARTS}
        self._results = {r.id: r for r in found[part] if stamps.get(r.id) == r.stamp}
        self._other = {p: rows for p, rows in found.items() if p != part}
        self.facts: dict[str, Any] = {"random_seed": before.get("random_seed")}

    def todo(self, mutants: Sequence[Mutant], again: str | None) -> list[Mutant]:
        """Those that are to be judged, of which nothing is known any more: all, or what `--again` says."""
        found = [m for m in mutants if m.id not in self._results or not _done(again, self._results[m.id])]
        for m in found:
            self._results.pop(m.id, None)
        return found

    def keep(self, r: Result) -> None:
        """One more."""
        self._results[r.id] = r
        report.write(self._path, self.parts(), self.facts)

    def of(self, mutants: Sequence[Mutant]) -> list[Result]:
        """What is known of these."""
        return [self._results[m.id] for m in mutants if m.id in self._results]

    def parts(self) -> dict[str, Sequence[Result]]:
        """Everything that is known."""
        return {p: self.of(self._rows) if p == self._part else self._other[p] for p in PARTS}


def _done(again: str | None, r: Result) -> bool:
    return again == "unknown" or (again == "survived" and r.result in (*KILLED, "equivalent"))
