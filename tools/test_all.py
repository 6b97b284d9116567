#!/usr/bin/env python3
"""Every test there is, in order, with each step's output visible and kept in build/test/: `make test` after set-up.

Goes on after a failure, closes with the runners' own closing lines and a line of counts; exits 1 if anything failed.
Usage: test_all.py [STEP...] (names as printed; all without one).
"""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LOGS = ROOT / "build/test"
MAKE = ["make", "--no-print-directory", f"-j{os.cpu_count() or 1}"]
STRICT = [*MAKE, "WERROR=1"]
SANITIZED = "SAN=address,undefined"

# name, command, seconds it may take: so many that only what hangs is ended, on a busy machine, too
STEPS: list[tuple[str, list[str], float]] = [
    ("build", [*STRICT, "all"], 600),
    ("lint", [*MAKE, "lint"], 1200),
    ("C tests, gcc", [*STRICT, "check"], 600),
    ("C tests, clang", [*STRICT, "CC=clang", "check"], 600),
    ("C tests, gcc, sanitizers", [*STRICT, SANITIZED, "check"], 1200),
    ("C tests, clang, sanitizers", [*STRICT, "CC=clang", SANITIZED, "check"], 1200),
    ("fuzz targets, a short run", [*STRICT, "fuzz-check"], 1800),
    ("other builds of the emulator", [*STRICT, "builds"], 1200),
    ("Python tests and golden traces", [*MAKE, "pytest"], 1800),
    ("end to end on the host", [*MAKE, "e2e"], 1200),
    ("end to end, sanitizers", [*MAKE, "e2e-san"], 1800),
    ("end to end on vcan0", [*MAKE, "e2e-vcan"], 1200),
    ("end to end on slc0", [*MAKE, "e2e-slc0"], 1200),
    ("real time, a minute each", [*MAKE, "soak"], 1800),
]

ANSI = re.compile(r"\x1b\[[0-9;]*m")
CMOCKA = re.compile(r"\[  (PASSED |FAILED |SKIPPED)[ ]?\] (\d+) test\(s\)")
PYTEST = re.compile(r"=*\s*((?:\d+ [a-z]+(?:, )?)+) in [\d.]+s\b.*")
PYTEST_KIND = {"passed": "passed", "failed": "failed", "error": "failed", "errors": "failed", "skipped": "skipped"} | {
    "xfailed": "skipped",
    "xpassed": "failed",
}


@dataclass
class Outcome:
    """What a step came to; counts are those its runners printed."""

    name: str
    passed: int = 0
    failed: int = 0
    skipped: int = 0
    status: int = 0
    duration_s: float = 0.0
    closing: list[str] = field(default_factory=list)

    def read(self, line: str) -> None:
        """Count a runner's closing line; every other line changes nothing."""
        line = ANSI.sub("", line).rstrip()
        if m := CMOCKA.fullmatch(line) or CMOCKA.match(line):
            self.add(m.group(1).strip().lower(), int(m.group(2)))
        elif m := PYTEST.fullmatch(line):
            for count, kind in re.findall(r"(\d+) ([a-z]+)", m.group(1)):
                if kind in PYTEST_KIND:
                    self.add(PYTEST_KIND[kind], int(count))
            self.closing.append(line)

    def add(self, kind: str, count: int) -> None:
        setattr(self, kind, getattr(self, kind) + count)

    def close(self, status: int, duration_s: float) -> None:
        """A step that fails without a runner saying so (a crash, a compiler, lint) is one failure."""
        self.status, self.duration_s = status, duration_s
        if status != 0 and self.failed == 0:
            self.failed = 1
        if status == 0 and self.failed:
            self.status = 1


def run(name: str, command: list[str], limit_s: float) -> Outcome:
    """Run one step to its end or its time limit; its output goes to ours and into a log."""
    outcome = Outcome(name)
    log = LOGS / (re.sub(r"\W+", "-", name) + ".log")
    print(f"\n--- {name}: {' '.join(command)}", flush=True)
    began_s = time.monotonic()
    # make's own flags must not leak into the makes we start.
    env = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")} | {
        "PYTHONUNBUFFERED": "1"
    }
    with (
        log.open("w", encoding="utf-8") as keep,
        subprocess.Popen(
            command,
            cwd=ROOT,
            env=env,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            start_new_session=True,
        ) as step,
    ):
        assert step.stdout is not None
        # The alarm ends the whole group, and with it the pipe that we read.
        signal.signal(signal.SIGALRM, lambda *_: os.killpg(step.pid, signal.SIGTERM))
        signal.setitimer(signal.ITIMER_REAL, limit_s)
        try:
            for line in step.stdout:
                print(line, end="", flush=True)
                keep.write(line)
                outcome.read(line)
            status = step.wait()
        except KeyboardInterrupt:
            os.killpg(step.pid, signal.SIGTERM)
            raise
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
    outcome.close(status, time.monotonic() - began_s)
    if outcome.duration_s >= limit_s:
        print(f"--- {name}: ended after {limit_s:.0f} s")
    return outcome


def summary(outcomes: Iterable[Outcome]) -> bool:
    """Print a row for each step, pytest's closing lines and the sum; true when nothing failed and something ran."""
    outcomes = list(outcomes)
    print(f"\n{'step':34} {'':7} {'passed':>7} {'failed':>7} {'skipped':>7} {'time/s':>7}")
    for o in outcomes:
        verdict = "ok" if o.status == 0 else "FAILED"
        print(f"{o.name:34} {verdict:7} {o.passed:7} {o.failed:7} {o.skipped:7} {o.duration_s:7.1f}")
    print()
    for o in outcomes:
        for line in o.closing:
            print(f"{o.name}:\n{line}")
    passed, failed, skipped = (sum(getattr(o, kind) for o in outcomes) for kind in ("passed", "failed", "skipped"))
    print(f"\n{passed} passed, {failed} failed, {skipped} skipped", flush=True)
    return bool(passed) and not failed


def main(names: list[str]) -> int:
    if unknown := set(names) - {name for name, _, _ in STEPS}:
        print(
            f"test_all: no step {', '.join(sorted(unknown))}; there are: {'; '.join(n for n, _, _ in STEPS)}",
            file=sys.stderr,
        )
        return 2
    LOGS.mkdir(parents=True, exist_ok=True)
    outcomes = []
    try:
        for name, command, limit_s in STEPS:
            if not names or name in names:
                outcomes.append(run(name, command, limit_s))
    except KeyboardInterrupt:
        print("\ninterrupted")
        summary(outcomes)
        return 130
    return 0 if summary(outcomes) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
