#!/usr/bin/env python3
"""Fuzz for long: each target until it has had so many minutes of CPU, several at once. docs/fuzzing.md"""

from __future__ import annotations

import argparse
import csv
import hashlib
import os
import re
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event, Lock

from psabench.whole_file import replace_file

ROOT = Path(__file__).resolve().parents[1]
BINARIES = ROOT / "build-fuzz/fuzz"
RECORD = ROOT / "tests/fuzz/minutes.csv"
PAGE = ROOT / "docs/fuzzing.md"
FIELDS = ("target", "sources", "cpu_s", "inputs")
SLICE_S = 300  # what is lost at most when the machine goes down
INPUT_S = 120  # an input that takes longer is a finding: a thousand times the usual
EXECUTED = re.compile(r"^stat::number_of_executed_units: *(\d+)", re.MULTILINE)
WRITTEN = re.compile(r"Test unit written to (\S+)")
BEGIN, END = "<!-- minutes:begin -->", "<!-- minutes:end -->"

EPILOG = """\
examples:
  make fuzz-long                                            all targets, 60 minutes of CPU each, a target a core
  make fuzz-long LONG='psa2 pik'                            these, one after the other as cores get free
  make fuzz-long LONG='--minutes 5 --jobs 1'                a shorter time, one core
  make fuzz-long LONG='--minutes 0 --docs'                  run nothing, write the table of docs/fuzzing.md

What was run stands in tests/fuzz/minutes.csv, a row for each target and state of the sources, and counts the next time.
What a target was run before a finding does not count: its time begins anew.
Ctrl-C ends it and loses nothing. Exit status: 0 all have had their time, 1 a finding, 2 bad input, 130 ended by Ctrl-C.
"""


@dataclass
class Spent:
    """Of one target with one state of the sources."""

    cpu_s: float = 0.0
    inputs: int = 0


Record = dict[tuple[str, str], Spent]  # (target, sources)


def read(path: Path) -> Record:
    """What was run so far. Raises ValueError, KeyError for a file that is not ours."""
    if not path.exists():
        return {}
    with path.open(newline="", encoding="ascii") as f:
        return {(r["target"], r["sources"]): Spent(float(r["cpu_s"]), int(r["inputs"])) for r in csv.DictReader(f)}


def write(path: Path, record: Record) -> None:
    """The whole file or none of it."""
    rows = [",".join(FIELDS)]
    rows += [f"{name},{sources},{s.cpu_s:.1f},{s.inputs}" for (name, sources), s in sorted(record.items())]
    replace_file(path, "\n".join(rows) + "\n")


def state(root: Path = ROOT) -> str:
    """Of the sources that are fuzzed, and of the targets."""
    digest = hashlib.sha256()
    for part in ("emu", "tests/fuzz"):
        for path in sorted(p for p in (root / part).rglob("*") if p.suffix in (".c", ".h")):
            digest.update(str(path.relative_to(root)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


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
    """What stands between the marks."""
    head, rest = path.read_text(encoding="utf-8").split(BEGIN)
    tail = rest.split(END)[1]
    replace_file(path, f"{head}{BEGIN}\n" + "\n".join(table(record)) + f"\n{END}{tail}")


@dataclass
class Campaign:
    """Targets that have not had their time yet, taken by as many threads as there are jobs."""

    targets: list[str]
    minutes: float
    record: Record
    path: Path
    binaries: Path
    slice_s: float = SLICE_S
    sources: str = field(default_factory=state)
    findings: list[str] = field(default_factory=list)
    ended: Event = field(default_factory=Event)
    _running: set[subprocess.Popen[str]] = field(default_factory=set)
    _lock: Lock = field(default_factory=Lock)

    def run(self, jobs: int) -> None:
        """Until all have had their time, or KeyboardInterrupt, which is raised when everything is down and kept."""
        with ThreadPoolExecutor(jobs) as pool:
            done = [pool.submit(self.whole, target) for target in self.targets]
            try:
                while not all(d.done() for d in done):
                    time.sleep(0.2)  # signals reach the main thread only
            except KeyboardInterrupt:
                self.ended.set()
                with self._lock:
                    for process in self._running:
                        process.send_signal(signal.SIGINT)
                raise
            for d in done:
                d.result()

    def whole(self, target: str) -> None:
        """All slices of a target that are left."""
        while not self.ended.is_set():
            left_s = 60 * self.minutes - in_all(self.record, target).cpu_s
            if left_s <= 0 or not self.one_slice(target, min(self.slice_s, left_s + 1)):
                return

    def one_slice(self, target: str, slice_s: float) -> bool:
        """False after a finding."""
        name = f"fuzz_{target}"
        found = self.binaries.parent / "corpus" / name
        found.mkdir(parents=True, exist_ok=True)
        command = [self.binaries / name, f"-artifact_prefix={self.binaries.parent}/{name}-", "-max_len=512"]
        command += [f"-timeout={INPUT_S}", f"-max_total_time={max(1, round(slice_s))}", "-verbosity=0"]
        command += ["-print_final_stats=1", found, ROOT / "tests/fuzz/corpus" / name]
        status, cpu_s, text = self.child([str(c) for c in command])
        executed = EXECUTED.search(text)
        with self._lock:
            spent = self.record.setdefault((target, self.sources), Spent())
            spent.cpu_s += cpu_s
            spent.inputs += int(executed[1]) if executed else 0
            good = self.told(target, status, text)
            if not good:
                for key in [k for k in self.record if k[0] == target]:
                    del self.record[key]
            write(self.path, self.record)
            return good

    def child(self, command: list[str]) -> tuple[int, float, str]:
        """Exit status, seconds of CPU, what it said. In a session of its own: Ctrl-C is ours to hand on."""
        env = os.environ | {"UBSAN_OPTIONS": "print_stacktrace=1"}
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", env=env,
            start_new_session=True,
        ) as process:  # fmt: skip
            with self._lock:
                self._running.add(process)
            assert process.stdout
            text = process.stdout.read()
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            with self._lock:
                self._running.remove(process)
        return process.returncode, usage.ru_utime + usage.ru_stime, text

    def told(self, target: str, status: int, text: str) -> bool:
        """A line about a slice; False after a finding."""
        spent = in_all(self.record, target)
        print(f"{target}: {spent.cpu_s / 60:.1f} of {self.minutes:g} min, {spent.inputs:,} inputs", flush=True)
        if status == 0 or self.ended.is_set():
            return True
        file = WRITTEN.search(text)
        again = f"; again with: {self.binaries}/fuzz_{target} {file[1]}" if file else f", status {status}"
        self.findings.append(target)
        print(f"{text}\n{target}: a finding{again}", file=sys.stderr, flush=True)
        return False


def parser() -> argparse.ArgumentParser:
    """Options."""
    p = argparse.ArgumentParser(
        prog="fuzz_long.py", description=__doc__, epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    p.add_argument("targets", nargs="*", metavar="TARGET", help="without its fuzz_ (all), in this order")
    p.add_argument("--minutes", type=float, default=60.0, metavar="N", help="CPU each is to have had in all (60)")
    p.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="targets at once (one a core)")
    p.add_argument("--docs", action="store_true", help="at the end, write the table of docs/fuzzing.md")
    return p


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = parser().parse_args(argv)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a script may have started us in the background
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C
    built = sorted(p.name.removeprefix("fuzz_") for p in BINARIES.glob("fuzz_*"))
    unknown = [t for t in args.targets if t not in built]
    if unknown or not built or args.jobs < 1:
        print(
            f"fuzz_long: {' '.join(unknown) or 'nothing'}: not a target that is built: {' '.join(built)}",
            file=sys.stderr,
        )
        return 2
    campaign = Campaign(args.targets or built, args.minutes, read(RECORD), RECORD, BINARIES)
    interrupted = False
    try:
        campaign.run(args.jobs)
    except KeyboardInterrupt:
        interrupted = True
    if args.docs:
        page(PAGE, campaign.record)
    return 1 if campaign.findings else 130 if interrupted else 0


if __name__ == "__main__":
    sys.exit(main())
