"""Schedules one after the other, in parts that workers take. What is done is in a file; the same search goes on there.

The schedules depend on board, profile, seed and number, not on the number of processes nor on interruptions.
"""

from __future__ import annotations

import itertools
import json
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from psabench.campaign.builds import digest
from psabench.campaign.workers import Workers
from psabench.errors import BadInput, expected
from psabench.explore.finding import Finding, keep_finding
from psabench.explore.oracle import Violation
from psabench.explore.play import catalogue_of, play_schedule
from psabench.explore.schedule import Schedule, draw_schedule
from psabench.link.own import replace_file
from psabench.places import find_emulator

PART = 5  # schedules of a task: long beside what a task costs, short for a person who waits
DONE = "explore.jsonl"


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """Which schedules."""

    board: str
    profile: str
    seed: int
    length_s: float

    def schedule(self, number: int) -> Schedule:
        """That of a number."""
        found = catalogue_of(self.board, self.profile, self.length_s)
        return draw_schedule(found, self.seed, number, self.length_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """Some schedules of a search."""

    search: Search
    first: int
    count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """What came of them. found: number of the schedule, and what it violates."""

    first: int
    count: int
    simulated_s: float
    found: tuple[tuple[int, Violation], ...]


def compute_part(task: Task) -> Part:
    """Play them."""
    simulated_s, found = 0.0, []
    for number in range(task.first, task.first + task.count):
        played = play_schedule(task.search.schedule(number))
        simulated_s += played.time_s
        found += [(number, v) for v in played.violations]
    return Part(first=task.first, count=task.count, simulated_s=simulated_s, found=tuple(found))


@dataclass(slots=True, kw_only=True)
class Tally:
    """What a search came to so far, with what it had done before. times: how often each key was found."""

    schedules: int = 0
    simulated_s: float = 0.0
    times: dict[str, int] = field(default_factory=dict)
    findings: dict[str, Finding] = field(default_factory=dict)  # of this run

    def add(self, part: Mapping[str, Any]) -> None:
        """A row of the file."""
        self.schedules += int(part["count"])
        self.simulated_s += float(part["simulated_s"])
        for key in part["keys"]:
            self.times[key] = self.times.get(key, 0) + 1


class Log:
    """The file of a search, a line a part: what is written is done."""

    def __init__(self, out: Path, search: Search) -> None:
        """Raises BadInput where the file is of another search or another build."""
        self.path = out / DONE
        self.tally = Tally()
        self.done: set[int] = set()
        mine = {"explore": asdict(search), "build": digest([find_emulator()])[:16]}
        out.mkdir(parents=True, exist_ok=True)
        rows = self._read_rows()
        if rows and rows[0] != mine:
            raise BadInput(expected("results of the same search and build (or another --out)", rows[0], self.path))
        for row in rows[1:]:
            self.done |= set(range(row["first"], row["first"] + row["count"]))
            self.tally.add(row)
        if not rows:
            self._write_row(mine)

    def _read_rows(self) -> list[dict[str, Any]]:
        """Whole lines; one that an end of the machine has cut is taken away, and played again."""
        if not self.path.exists():
            return []
        text = self.path.read_text(encoding="utf-8")
        whole = text[: text.rfind("\n") + 1]
        if whole != text:
            replace_file(self.path, whole)
        try:
            return [json.loads(line) for line in whole.splitlines()]
        except ValueError as e:
            raise BadInput(expected("lines of JSON (--fresh begins again)", e, self.path)) from e

    def add(self, part: Part) -> None:
        """A part that is done."""
        keys = sorted({v.key for _, v in part.found})
        row = {"first": part.first, "count": part.count, "simulated_s": round(part.simulated_s, 9), "keys": keys}
        self._write_row(row)
        self.tally.add(row)

    def _write_row(self, row: Mapping[str, Any]) -> None:
        with self.path.open("a", encoding="utf-8") as to:
            to.write(json.dumps(row) + "\n")


def missing_tasks(search: Search, count: int | None, done: Iterable[int], go_on: Callable[[], bool]) -> Iterator[Task]:
    """Parts that are not done, up to a number of schedules (None: without end), while `go_on`.

    done: numbers of schedules. A part of which a shorter search did the first ones has the others left.
    """
    known, first = set(done), 0
    while (count is None or first < count) and go_on():
        end = first + PART if count is None else min(first + PART, count)
        left = [number for number in range(first, end) if number not in known]
        if left:
            yield Task(search=search, first=left[0], count=len(left))
        first += PART


def run_search(
    search: Search,
    out: Path,
    workers: Workers,
    *,
    count: int | None,
    for_s: float | None = None,
    most: int | None = None,
    told: Callable[[Tally, Finding | None], None] = lambda *_: None,
) -> Tally:
    """Play `count` schedules, or as many as `for_s` allows; ends after `most` findings.

    A schedule that violates something for the first time is shrunk and kept, once for all that it violates. told: after
    each part and each finding. Raises BadInput.
    """
    log = Log(out, search)
    tally = log.tally
    ends_s = None if for_s is None else time.monotonic() + for_s

    def is_enough() -> bool:
        return most is not None and len(tally.findings) >= most

    def go_on() -> bool:
        return not is_enough() and (ends_s is None or time.monotonic() < ends_s)

    known = set(tally.times)
    for part in workers.map(compute_part, missing_tasks(search, count, log.done, go_on)):
        for number, violations in itertools.groupby(part.found, key=lambda found: found[0]):
            new = [v for _, v in violations if v.key not in known]
            if new and not is_enough():
                known |= {v.key for v in new}
                tally.findings[new[0].key] = keep_finding(out, search.schedule(number), new[0])
                told(tally, tally.findings[new[0].key])
        log.add(part)
        told(tally, None)
    return tally
