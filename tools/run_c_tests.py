#!/usr/bin/env python3
"""Run C test programs, several at once, and add up what they say: `make check`.

The output of each is kept in PROGRAM.log and shown when a test failed. The last line is the total.
Usage: run_c_tests.py [--jobs N] PROGRAM...
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

LIMIT_S = 900.0
RESULT = re.compile(r"^\[  (PASSED |FAILED |SKIPPED)[ ]?\] (\d+) test\(s\)", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Ended:
    """A program that has ended."""

    program: Path
    status: str
    """Empty when it exited with 0."""
    duration_s: float
    output: str

    def counts(self) -> Counter[str]:
        """Tests by result. A program that fails and names no failed test is one failure."""
        found = Counter(dict.fromkeys(("passed", "failed", "skipped"), 0))
        for kind, count in RESULT.findall(self.output):
            found[kind.strip().lower()] += int(count)
        if self.status and not found["failed"]:
            found["failed"] = 1
        return found


def run(program: Path, limit_s: float = LIMIT_S) -> Ended:
    """To its end or the time limit, its output into PROGRAM.log."""
    log = program.with_name(program.name + ".log")
    began_s = time.monotonic()
    with log.open("wb") as out:
        try:
            code = subprocess.run(
                [program], stdin=subprocess.DEVNULL, stdout=out, stderr=out, timeout=limit_s
            ).returncode
            status = "" if code == 0 else f"exit status {code}" if code > 0 else f"signal {-code}"
        except subprocess.TimeoutExpired:
            status = f"ended after {limit_s:g} s"
        except OSError as error:
            status = str(error)
    return Ended(program, status, time.monotonic() - began_s, log.read_text(encoding="utf-8", errors="replace"))


def show(ended: Ended) -> None:
    """One line for what passed, the whole output of what did not."""
    counts = ended.counts()
    if ended.status or counts["failed"]:
        print(f"{ended.output.rstrip()}\n{ended.program}: FAILED, {ended.status or 'a test failed'}")
    else:
        print(f"{ended.program}: {counts['passed']} passed, {ended.duration_s:.1f} s")
    for name in dict.fromkeys(re.findall(r"^\[  SKIPPED \] (\w+)$", ended.output, re.MULTILINE)):
        print(f"SKIPPED {ended.program.name}: {name}")
    sys.stdout.flush()


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point: 0 when something ran and nothing failed."""
    p = argparse.ArgumentParser(prog="run_c_tests.py", description=__doc__.splitlines()[0])
    p.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="programs at once (one per core)")
    p.add_argument("programs", nargs="*", type=Path, metavar="PROGRAM")
    args = p.parse_args(argv)
    total: Counter[str] = Counter()
    with ThreadPoolExecutor(args.jobs) as pool:
        for ended in pool.map(run, args.programs):
            show(ended)
            total += ended.counts()
    print(f"check: {total['passed']} passed, {total['failed']} failed, {total['skipped']} skipped", flush=True)
    return 0 if total["passed"] and not total["failed"] else 1


if __name__ == "__main__":
    sys.exit(main())
