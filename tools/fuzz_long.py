#!/usr/bin/env python3
"""Fuzz for long: each target until it has had so many minutes of CPU, several at once. docs/fuzzing.md"""

from __future__ import annotations

import argparse
import csv
import math
import os
import re
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event, RLock

import between
from psabench.link.own import replace_file
from sources import digest

ROOT = Path(__file__).resolve().parents[1]
RUN = ROOT / "tests/fuzz/run"
BINARIES = ROOT / "build-fuzz/fuzz"
RECORD = ROOT / "tests/fuzz/minutes.csv"
PAGE = ROOT / "docs/fuzzing.md"
FIELDS = ("target", "sources", "cpu_s", "inputs")
SLICE_S = 300  # what is lost at most when the machine goes down
JOBS_MAX = 64
INPUTS = re.compile(r"^fuzz_\w+: (\d+) inputs$", re.MULTILINE)  # of RUN, after a target that found nothing
FINDING, BAD, INTERRUPTED = 1, 2, 130  # exit statuses, of RUN as of ours
MARKS = between.marks("minutes")

EPILOG = """\
examples:
  make fuzz-long                                            all targets, 60 minutes of CPU each, a target a core
  make fuzz-long LONG='psa2 pik'                            these, one after the other as cores get free
  make fuzz-long LONG='--minutes 5 --jobs 1'                a shorter time, one core

What was run is in tests/fuzz/minutes.csv, a row for each target and state of the sources, and in docs/fuzzing.md.
It counts the next time. What a target was run before a finding does not count: its time begins again.
Ctrl-C ends it and loses nothing. Exit status: 0 all have had their time, 1 a finding, 2 bad input or a target that does
not run, 130 ended by Ctrl-C.
"""


@dataclass
class Spent:
    """Of one target with one state of the sources."""

    cpu_s: float = 0.0
    inputs: int = 0


Record = dict[tuple[str, str], Spent]  # (target, sources)


def read(path: Path) -> Record:
    """What was run so far. Raises ValueError, with the place, for a file that is not ours."""
    if not path.exists():
        return {}
    with path.open(newline="", encoding="ascii") as f:
        rows = csv.DictReader(f)
        try:
            return {(r["target"], r["sources"]): Spent(float(r["cpu_s"]), int(r["inputs"])) for r in rows}
        except (ValueError, KeyError, TypeError):
            raise ValueError(f"{path}: line {rows.line_num}: wanted {','.join(FIELDS)}") from None


def write(path: Path, record: Record) -> None:
    """The whole file or none of it."""
    rows = [",".join(FIELDS)]
    rows += [f"{name},{sources},{s.cpu_s:.1f},{s.inputs}" for (name, sources), s in sorted(record.items())]
    replace_file(path, "\n".join(rows) + "\n")


def state() -> str:
    """Of the sources that are fuzzed, and of the targets."""
    return digest(ROOT, ("emu", "tests/fuzz"), (".c", ".h"))[:12]


def in_all(record: Record, target: str) -> Spent:
    """With whatever sources."""
    mine = [s for (name, _), s in record.items() if name == target]
    return Spent(sum(s.cpu_s for s in mine), sum(s.inputs for s in mine))


def table(record: Record) -> Iterator[str]:
    """Lines of Markdown."""
    yield "| target | CPU-minutes | inputs | states of the sources |"
    yield "|---|---|---|---|"
    for target, states in sorted(Counter(name for name, _ in record).items()):
        spent = in_all(record, target)
        yield f"| `{target}` | {spent.cpu_s / 60:.0f} | {spent.inputs:,} | {states} |"


def page(path: Path, record: Record) -> None:
    """The text between the marks."""
    between.write(path, MARKS, "\n".join(table(record)))


@dataclass
class Campaign:
    """Targets that have not had their time yet, taken by as many threads as there are jobs."""

    targets: list[str]
    cpu_minutes: float  # each is to have had in all
    record: Record
    path: Path  # of the record
    page: Path  # shows it
    binaries: Path
    slice_s: int = SLICE_S
    sources: str = field(default_factory=state)
    wrong: dict[str, int] = field(default_factory=dict)  # targets that found something or did not run: FINDING, BAD
    ended: Event = field(default_factory=Event)
    _running: set[subprocess.Popen[str]] = field(default_factory=set)
    _lock: RLock = field(default_factory=RLock)  # a signal's handler may come while another has it

    def run(self, jobs: int) -> int:
        """Until all have had their time, or end(). The exit status."""
        with ThreadPoolExecutor(jobs) as pool:
            done = [pool.submit(self.whole, target) for target in self.targets]
            wait(done)  # signals reach the main thread only
            for d in done:
                d.result()
        return min(self.wrong.values(), default=INTERRUPTED if self.ended.is_set() else 0)

    def end(self) -> None:
        """What runs is ended, whenever this is called; nothing more is begun."""
        self.ended.set()
        with self._lock:
            for process in self._running:
                os.killpg(process.pid, signal.SIGINT)

    def whole(self, target: str) -> None:
        """All slices of a target that are left."""
        while not self.ended.is_set():
            left_s = 60 * self.cpu_minutes - in_all(self.record, target).cpu_s
            if left_s <= 0 or not self.one_slice(target, min(self.slice_s, math.ceil(left_s))):
                return

    def one_slice(self, target: str, slice_s: int) -> bool:
        """False when it is the last one."""
        status, cpu_s, text = self.child([str(RUN), str(slice_s), str(self.binaries / f"fuzz_{target}")])
        inputs = INPUTS.search(text)
        with self._lock:
            if inputs and status in (0, INTERRUPTED):
                self.count(target, Spent(cpu_s, int(inputs[1])))
            elif not self.ended.is_set() or status == FINDING:
                self.lose(target, status, text)
                return False
        return True

    def child(self, command: list[str]) -> tuple[int, float, str]:
        """Exit status, seconds of CPU, what it said. In a session of its own: Ctrl-C is ours to hand on."""
        with self._lock:
            if self.ended.is_set():
                return INTERRUPTED, 0.0, ""
            process = subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
                start_new_session=True,
            )  # fmt: skip
            self._running.add(process)
        with process:
            assert process.stdout
            text = process.stdout.read()
            with self._lock:  # once it is waited for, its number may be another's
                self._running.remove(process)
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
        return process.returncode, usage.ru_utime + usage.ru_stime, text

    def count(self, target: str, slice_: Spent) -> None:
        """Into the record, with a line."""
        spent = self.record.setdefault((target, self.sources), Spent())
        spent.cpu_s += slice_.cpu_s
        spent.inputs += slice_.inputs
        self.keep()
        spent = in_all(self.record, target)
        print(f"{target}: {spent.cpu_s / 60:.1f} of {self.cpu_minutes:g} min, {spent.inputs:,} inputs", flush=True)

    def lose(self, target: str, status: int, text: str) -> None:
        """After a finding its time begins again. A target that does not run keeps what it has had."""
        self.wrong[target] = FINDING if status == FINDING else BAD
        print(text, file=sys.stderr, flush=True)
        if status == FINDING:
            for key in [k for k in self.record if k[0] == target]:
                del self.record[key]
            self.keep()

    def keep(self) -> None:
        """The record, and the page that shows it."""
        write(self.path, self.record)
        page(self.page, self.record)


def cpu_minutes(text: str) -> float:
    """Of the command line. Raises ArgumentTypeError."""
    try:
        minutes = float(text)
    except ValueError:
        minutes = math.nan
    if not 0 <= minutes < math.inf:
        raise argparse.ArgumentTypeError(f"{text}: expected minutes, 0 or more")
    return minutes


def jobs(text: str) -> int:
    """Of the command line. Raises ArgumentTypeError."""
    if not (text.isdecimal() and 1 <= int(text) <= JOBS_MAX):
        raise argparse.ArgumentTypeError(f"{text}: expected 1 to {JOBS_MAX}")
    return int(text)


def parser() -> argparse.ArgumentParser:
    """Options."""
    p = argparse.ArgumentParser(
        prog="fuzz_long.py", description=__doc__, epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    p.add_argument("targets", nargs="*", metavar="TARGET", help="without its fuzz_ (all), in this order")
    p.add_argument("--minutes", type=cpu_minutes, default=60.0, metavar="N", help="CPU each is to have had in all (60)")
    p.add_argument("--jobs", type=jobs, default=os.cpu_count() or 1, metavar="N", help="targets at once (one a core)")
    p.add_argument("--docs", action="store_true", help="run nothing, write the table of docs/fuzzing.md (make docs)")
    return p


def chosen(names: Sequence[str], built: Sequence[str]) -> list[str]:
    """All without names. Raises ValueError."""
    if not built:
        raise ValueError(f"no target is built in {BINARIES}: make fuzz-long builds them")
    if unknown := [n for n in names if n not in built]:
        raise ValueError(f"no such target: {' '.join(unknown)}; there are {' '.join(built)}")
    return list(names or built)


def carry_out(args: argparse.Namespace) -> int:
    """Exit status. Raises ValueError for bad input."""
    record = read(RECORD)
    page(PAGE, record)
    if args.docs:
        return 0
    built = sorted(p.name.removeprefix("fuzz_") for p in BINARIES.glob("fuzz_*"))
    campaign = Campaign(chosen(args.targets, built), args.minutes, record, RECORD, PAGE, BINARIES)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: campaign.end())
    return campaign.run(args.jobs)


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = parser().parse_args(argv)
    try:
        return carry_out(args)
    except ValueError as e:
        print(f"fuzz_long: {e}", file=sys.stderr)
        return BAD


if __name__ == "__main__":
    sys.exit(main())
