#!/usr/bin/env python3
"""The steps of `make test` and `make test-all`, each one's output visible and kept in build/test/.

Steps that keep all cores busy by themselves run one after the other; those of one process beside each other, one more
than there are cores, for each waits at times. The earliest one is seen as it goes; another one's output follows when
that has ended, and grows in build/test/ meanwhile.
Goes on after a failure, closes with a table of times, the runners' own closing lines, the reasons of skips and a line
of counts; exits 1 if anything failed.
"""

import argparse
import itertools
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LOGS = ROOT / "build/test"
OUTCOMES = "outcomes.json"
MAKE = ["make", "--no-print-directory", f"-j{os.cpu_count() or 1}"]
STRICT = [*MAKE, "WERROR=1"]
SANITIZED = "SAN=address,undefined"
TIERS = ("test", "rest", "all")
# A step waits a quarter of its time, for a peer or a timer: one more keeps the cores busy. At most 4: memory.
LANES = min((os.cpu_count() or 1) + 1, 4)
GRACE_S = 20.0  # for a step that is ended: pytest's fixtures end what they have started


@dataclass(frozen=True)
class Step:
    """A command and the seconds it may take: so many that only what hangs is ended, on a busy machine, too."""

    name: str
    command: Sequence[str]
    limit_s: float
    beside: bool = False
    """Leaves room for another step beside it: one process, no time that is judged by this machine's clock."""
    waits: bool = False
    """Mostly for real time to pass: runs beside those in the lanes, and takes none of theirs."""
    builds: Sequence[str] = ()
    """What its make builds before it tests, where other steps build, too: made before it runs beside one."""
    tiers: Sequence[str] = TIERS
    """Where it belongs: `test` is make test, `rest` what make test leaves out, `all` make test-all."""


TIER = "TIER={tier}"  # in a command: the tests of tests/tiers.toml that it runs
REST = ("rest", "all")
# What pages print, and the tests that look at the same runs of a minute (tests/e2e/conftest.py): half of the end-to-end
# tests' time, so a process of their own.
PAGES = [
    f"tests/e2e/{name}.py"
    for name in ("bench/test_docs", "procedures/test_calibration", "procedures/test_compare_chamber")
]
STEPS: list[Step] = [
    Step("build", [*STRICT, "all"], 600),
    # The steps below compile everything with WERROR=1 and both compilers: lint does not look for their warnings again.
    Step("lint", [*MAKE, "lint", "LINT={tier}", "BUILT=1"], 1200, tiers=REST),
    Step("C tests, gcc", [*STRICT, "check", TIER], 600, tiers=["test", "all"]),
    # Without those that only the rest has: an hour, or many units, of what the others run too. clang's step has them.
    Step("C tests, gcc, sanitizers", [*STRICT, SANITIZED, "check", "TIER=test"], 1200, tiers=REST),
    # clang's sanitizers run the fuzz targets, and an emulator of `builds` beside the others.
    Step("C tests, clang", [*STRICT, "CC=clang", "check"], 600, tiers=REST),
    Step("other builds of the emulator", [*STRICT, "builds"], 1200, tiers=REST),
    # The long ones first, and what fits beside them last: all lanes end at about the same time.
    Step("real time, a minute each", [*MAKE, "soak"], 3000, beside=True, waits=True, builds=["all"], tiers=REST),
    Step(
        "Python tests and golden traces",
        [*MAKE, "pytest", "PYTESTS=tests/py tests/golden", TIER],
        3600,
        beside=True,
        builds=["bench-bin"],
    ),
    Step("end to end, pages", [*MAKE, "e2e", f"E2E={' '.join(PAGES)}", TIER], 3600, beside=True, builds=["all"]),
    Step(
        "end to end on the host",
        [*MAKE, "e2e", " ".join(["E2E=tests/e2e", *(f"--ignore={name}" for name in PAGES)]), TIER],
        3600,
        beside=True,
        builds=["all"],
    ),
    Step("conformance", [*MAKE, "pytest", "PYTESTS=tests/conform", TIER], 3600, beside=True, builds=["bench-bin"]),
    Step("lint", [*MAKE, "lint", "LINT=test"], 600, beside=True, builds=["all"], tiers=["test"]),
    Step("end to end on vcan0", [*MAKE, "e2e-vcan", TIER], 2400, beside=True, builds=["all"]),
    Step("fuzz targets, a short run", [*STRICT, "fuzz-check"], 1800, beside=True, tiers=REST),
    Step("end to end, sanitizers", [*MAKE, "e2e-san"], 1800, beside=True, builds=[SANITIZED, "all"], tiers=REST),
    Step("end to end on slc0", [*MAKE, "e2e-slc0"], 1200, beside=True, builds=["all"], tiers=["test", "all"]),
]


def steps_of(tier: str) -> list[Step]:
    """Steps of a tier, their commands with its name filled in."""
    return [
        replace(step, command=[word.replace("{tier}", tier) for word in step.command])
        for step in STEPS
        if tier in step.tiers
    ]


ANSI = re.compile(r"\x1b\[[0-9;]*m")
CMOCKA = re.compile(r"\[  (PASSED |FAILED |SKIPPED)[ ]?\] (\d+) test\(s\)")
PYTEST = re.compile(r"=*\s*((?:\d+ [a-z]+(?:, )?)+) in [\d.]+s\b.*")
TOTAL = re.compile(r"check: (\d+) passed, (\d+) failed, (\d+) skipped")
SKIPPED = re.compile(r"SKIPPED (?!\(|\[\d+%\])\S.*")  # pytest's short summary (-ra), tools/run_c_tests.py
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
    cpu_s: float = 0.0
    closing: list[str] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    """Of what was skipped, a line each."""

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
        elif m := TOTAL.fullmatch(line):
            for kind, count in zip(("passed", "failed", "skipped"), m.groups(), strict=True):
                setattr(self, kind, int(count))  # of all programs, also those whose output was shown
        elif SKIPPED.fullmatch(line):
            self.reasons.append(line)

    def add(self, kind: str, count: int) -> None:
        setattr(self, kind, getattr(self, kind) + count)

    def close(self, status: int, duration_s: float, cpu_s: float) -> None:
        """A step that fails without a runner saying so (a crash, a compiler, lint) is one failure."""
        self.status, self.duration_s, self.cpu_s = status, duration_s, cpu_s
        if status != 0 and self.failed == 0:
            self.failed = 1
        if status == 0 and self.failed:
            self.status = 1


class Screen:
    """Our output for steps that run at once: the earliest one's as it comes, the others' lines wait for their turn."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: dict[str, list[str]] = {}  # of each step that has begun, in order; the first one's is printed
        self._ended: set[str] = set()

    def begin(self, name: str, title: str) -> None:
        with self._lock:
            self._waiting[name] = []
            if len(self._waiting) > 1:
                print(f"--- beside it: {name}", flush=True)
        self.line(name, f"\n--- {title}\n")

    def line(self, name: str, text: str) -> None:
        with self._lock:
            if name == next(iter(self._waiting)):
                print(text, end="", flush=True)
            else:
                self._waiting[name].append(text)

    def end(self, name: str, verdict: str) -> None:
        with self._lock:
            self._ended.add(name)
            if name != next(iter(self._waiting)):
                print(f"--- beside it: {name}: {verdict}", flush=True)
            while self._waiting and (first := next(iter(self._waiting))) in self._ended:
                del self._waiting[first]
                self._ended.remove(first)
                if self._waiting:
                    print("".join(self._waiting[next(iter(self._waiting))]), end="", flush=True)


class Run:
    """One step on its way to its end or its time limit; its output goes to the screen and into a log."""

    def __init__(self, step: Step, screen: Screen, env: dict[str, str]) -> None:
        self.outcome = Outcome(step.name)
        self.cut = False  # ended by us
        self._step, self._screen = step, screen
        self._over = threading.Event()
        self._began_s = time.monotonic()
        self._process = subprocess.Popen(
            step.command,
            cwd=ROOT,
            env=env,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            start_new_session=True,
        )

    def finish(self) -> Outcome:
        """To the end of the step and of all that writes into its pipe."""
        name, log = self._step.name, LOGS / (re.sub(r"\W+", "-", self._step.name) + ".log")
        limit = threading.Timer(self._step.limit_s, self.end)
        limit.daemon = True
        limit.start()
        self._screen.begin(name, f"{name}: {' '.join(self._step.command)}")
        with log.open("w", encoding="utf-8") as keep, self._process as process:
            assert process.stdout is not None
            for line in process.stdout:
                self._screen.line(name, line)
                keep.write(line)
                keep.flush()
                self.outcome.read(line)
            _, status, used = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
        limit.cancel()
        self._over.set()
        self.outcome.close(
            process.returncode or int(self.cut), time.monotonic() - self._began_s, used.ru_utime + used.ru_stime
        )
        if self.cut:
            self._screen.line(name, f"--- {name}: ended after {self.outcome.duration_s:.0f} s\n")
        verdict = "ok" if self.outcome.status == 0 else "FAILED"
        self._screen.line(
            name, f"--- {name}: {verdict}, {self.outcome.passed} passed, {self.outcome.duration_s:.0f} s\n"
        )
        self._screen.end(name, verdict)
        return self.outcome

    def end(self) -> None:
        """As by Ctrl-C, so that pytest says where it was and its fixtures end what they started; then less kindly."""
        self.cut = True
        for number, grace_s in ((signal.SIGINT, GRACE_S), (signal.SIGTERM, GRACE_S / 4), (signal.SIGKILL, GRACE_S)):
            try:
                os.killpg(self._process.pid, number)
            except ProcessLookupError:
                return
            if self._over.wait(grace_s):
                return


class Lanes:
    """Runs steps at once, as many as there are lanes, the next one where one has ended; one that waits has its own."""

    def __init__(self, steps: Iterable[Step], count: int, screen: Screen) -> None:
        self.outcomes: dict[str, Outcome] = {}
        steps = list(steps)
        shared = deque(step for step in steps if not step.waits)
        self._queues = [deque([step]) for step in steps if step.waits] + [shared] * min(count, len(shared))
        self._screen = screen
        self._running: list[Run] = []
        self._lock = threading.Lock()
        # Waited for by events: a join() that Ctrl-C interrupts takes the thread for ended ever after.
        self._done = [threading.Event() for _ in self._queues]
        self._threads = [threading.Thread(target=self._lane, args=(n,)) for n in range(len(self._done))]

    def run(self) -> None:
        """To the last step's end; Ctrl-C ends those that run."""
        try:
            for thread in self._threads:
                thread.start()
            for done in self._done:
                done.wait()
        except KeyboardInterrupt:
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # once is enough: what runs is being ended
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
            with self._lock:
                for queue in self._queues:
                    queue.clear()
                running = list(self._running)
            enders = [threading.Thread(target=run.end) for run in running]
            for thread in enders:
                thread.start()
            for thread in enders:
                thread.join()
            for thread, done in zip(self._threads, self._done, strict=True):
                if thread.ident is not None:
                    done.wait()
            for run in running:
                self.outcomes.pop(run.outcome.name, None)
            raise

    def _lane(self, number: int) -> None:
        try:
            self._steps_of(number)
        finally:
            self._done[number].set()

    def _steps_of(self, number: int) -> None:
        # make's own flags must not leak into the makes we start. A user-mode kernel keeps to one CPU.
        cpus = sorted(os.sched_getaffinity(0))
        env = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")} | {
            "PYTHONUNBUFFERED": "1",
            "UML_CPU": str(cpus[-1 - number % len(cpus)]),
        }
        while True:
            with self._lock:
                if not self._queues[number]:
                    return
                step = self._queues[number].popleft()
                try:
                    run = Run(step, self._screen, env)
                except OSError as error:
                    print(f"\n--- {step.name}: {error}", flush=True)
                    self.outcomes[step.name] = Outcome(step.name, failed=1, status=1)
                    continue
                self._running.append(run)
            outcome = run.finish()
            with self._lock:
                self._running.remove(run)
                self.outcomes[outcome.name] = outcome


def groups(steps: Iterable[Step]) -> Iterable[list[Step]]:
    """What runs at once, in order: a step alone, or all that come one after the other and leave room for others."""
    for beside, some in itertools.groupby(steps, lambda step: step.beside):
        if beside:
            yield list(some)
        else:
            yield from ([step] for step in list(some))


def build_first(steps: Sequence[Step]) -> list[Step]:
    """What makes that run at once would both build. A failure is seen a second time, in the steps that need it."""
    wanted = dict.fromkeys(tuple(step.builds) for step in steps if step.builds) if len(steps) > 1 else ()
    return [Step(f"to begin with, {' '.join(goals)}", [*STRICT, *goals], 1200) for goals in wanted]


def summary(outcomes: Iterable[Outcome]) -> bool:
    """Print a row for each step, pytest's closing lines, why tests were skipped and the sum; true when all is well."""
    outcomes = list(outcomes)
    print(f"\n{'step':34} {'':7} {'passed':>7} {'failed':>7} {'skipped':>7} {'time/s':>7} {'CPU/s':>7}")
    for o in outcomes:
        verdict = "ok" if o.status == 0 else "FAILED"
        print(f"{o.name:34} {verdict:7} {o.passed:7} {o.failed:7} {o.skipped:7} {o.duration_s:7.1f} {o.cpu_s:7.1f}")
    print()
    for o in outcomes:
        for line in o.closing:
            print(f"{o.name}:\n{line}")
    for o in outcomes:
        for line in o.reasons:
            print(f"{o.name}: {line}")
    passed, failed, skipped = (sum(getattr(o, kind) for o in outcomes) for kind in ("passed", "failed", "skipped"))
    print(f"\n{passed} passed, {failed} failed, {skipped} skipped", flush=True)
    return bool(passed) and not failed


def run_steps(chosen: Sequence[Step], before: Sequence[Outcome] = ()) -> int:
    """The steps, and a summary of them after that of what ran before. The exit status."""
    LOGS.mkdir(parents=True, exist_ok=True)
    screen = Screen()
    lanes: list[Lanes] = []
    handlers = {n: signal.signal(n, signal.default_int_handler) for n in (signal.SIGINT, signal.SIGTERM)}
    try:
        for group in groups(chosen):
            for step in build_first(group):
                Lanes([step], 1, screen).run()
            lanes.append(Lanes(group, LANES, screen))
            lanes[-1].run()
    except KeyboardInterrupt:
        print("\ninterrupted")
        summary([*before, *(outcome for step in chosen if (outcome := ended(step, lanes)))])
        return 130
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    # One without an outcome: its lane broke down, and what that printed says why.
    outcomes = [ended(step, lanes) or Outcome(step.name, failed=1, status=1) for step in chosen]
    keep(outcomes)
    return 0 if summary([*before, *outcomes]) else 1


def keep(outcomes: Sequence[Outcome]) -> None:
    """For a run of the rest that follows (--after)."""
    (LOGS / OUTCOMES).write_text(json.dumps([asdict(o) for o in outcomes]), encoding="utf-8")


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point: 0 all passed, 1 something failed, 2 bad input, 130 interrupted."""
    p = argparse.ArgumentParser(prog="test_all.py", description=(__doc__ or "").split("\n")[0])
    p.add_argument(
        "tier", choices=TIERS, nargs="?", default="all", help="test: make test; rest: what it leaves out; all (default)"
    )
    p.add_argument("steps", nargs="*", metavar="STEP", help="only these steps, names as printed")
    p.add_argument("--after", action="store_true", help="add what the run before this one counted to the total")
    args = p.parse_args(argv)
    steps = steps_of(args.tier)
    if unknown := set(args.steps) - {step.name for step in steps}:
        names = "; ".join(step.name for step in steps)
        print(f"test_all: no step {', '.join(sorted(unknown))}; there are: {names}", file=sys.stderr)
        return 2
    before: list[Outcome] = []
    if args.after:
        try:
            before = [Outcome(**fields) for fields in json.loads((LOGS / OUTCOMES).read_text(encoding="utf-8"))]
        except (OSError, ValueError) as error:
            print(f"test_all: --after: expected the counts of a run before this one: {error}", file=sys.stderr)
            return 2
    return run_steps([step for step in steps if not args.steps or step.name in args.steps], before)


def ended(step: Step, lanes: Iterable[Lanes]) -> Outcome | None:
    return next((some.outcomes[step.name] for some in lanes if step.name in some.outcomes), None)


if __name__ == "__main__":
    sys.exit(main())
