"""What `make bench` measures: a table of cases, and how one run of a case is measured.

A case is a command that takes a count and prints `NAME key=value ... ns=T`, or a peer of which the process is timed.
Times are CPU times, so that they say little of what else the machine does; those of start and CAN, where more than one
process works, are real ones.
"""

from __future__ import annotations

import re
import resource
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from tests.bench.peers import NAMES, PSD1, Peer, run

ROOT = Path(__file__).resolve().parents[2]


NUMPY = "mc-numpy"  # what the other gyrocompasses are compared with
MONTE_CARLO = {
    NUMPY: 2000,
    "mc-closed": 1_000_000,
    "mc-closed-all": 1_000_000,
    "mc-samples": 5000,
    "mc-samples-all": 5000,
}


@dataclass(slots=True)
class Case:
    """One row: `sample(count)` measures count units of work; rates, units a second, are its results round by round."""

    name: str
    unit: str  # of the count: frames, starts, bytes
    sample: Callable[[int], dict[str, int]]
    first: int  # a count that takes well under a second
    under_callgrind: Callable[[int], list[str]] | None = None
    counts: tuple[int, int] = (200, 600)  # of two runs under callgrind; the difference is free of the set-up
    fixed: bool = False  # the count is the result, not a time
    count: int = 0
    rates: list[float] = field(default_factory=list)
    ns: list[float] = field(default_factory=list)
    edges_per_unit: float | None = None
    instructions_per_unit: float | None = None


def parse(output: str) -> dict[str, int]:
    """The integers of `NAME key=value ...`; of a Verilated driver's `frames N checksum H edges E ns T` too."""
    return {k: int(v) for k, v in re.findall(r"(\w+)[= ](\d+)(?= |$)", output.strip())}


def printed(command: Callable[[int], list[str]], count: int) -> dict[str, int]:
    """A command that times itself."""
    return parse(run(command(count)))


def timed(peer: Peer, count: int) -> dict[str, int]:
    """A simulator, from start to end, less what it takes for one frame: its start."""
    ns = []
    for frames in (1, count + 1):
        began_ns = children_cpu_ns()
        run(peer.command(frames))
        ns.append(children_cpu_ns() - began_ns)
    return {"frames": count, "ns": ns[1] - ns[0]}


def children_cpu_ns() -> int:
    """CPU time of all processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return int((used.ru_utime + used.ru_stime) * 1e9)


def core(exe: Path, name: str, count: int) -> list[str]:
    return [str(exe), name, str(count)]


def python(name: str, count: int) -> list[str]:
    return [sys.executable, "-m", "tests.bench.python_cases", name, str(count)]


def has_cases(exe: Path) -> set[str]:
    """The cases that a C driver lists when it is called without one."""
    text = subprocess.run([exe], capture_output=True, text=True, check=False).stderr
    return set(text.partition("cases:")[2].split())


def all_cases(bench: Path, peers: dict[str, Peer]) -> list[Case]:
    """In the order of a round."""
    icarus, timing, driven, psd1 = (peers[name] for name in (*NAMES, PSD1))
    cases = [
        Case("icarus", "frames", partial(timed, icarus), 500, icarus.command, (5, 25)),
        Case("verilator-timing", "frames", partial(timed, timing), 5000, timing.command),
        Case("verilator", "frames", partial(printed, driven.command), 20000, driven.command, (1000, 3000)),
        Case(PSD1, "frames", partial(printed, psd1.command), 1000, psd1.command, (50, 150)),
    ]
    for exe, unit in (("bench_core", "frames"), ("bench_lib", "bytes")):
        path = bench / exe
        if not path.exists():
            continue
        for name in sorted(has_cases(path)):
            command = partial(core, path, name)
            cases.append(Case(name, unit, partial(printed, command), 2000, command))
    for name, unit, first in (("decode", "frames", 20000), ("can", "frames", 20000), ("chips-spi", "bytes", 20000)):
        cases.append(Case(name, unit, partial(printed, partial(python, name)), first))
    for name, first in MONTE_CARLO.items():
        cases.append(Case(name, "runs", partial(printed, partial(python, name)), first))
    for name in ("gyro-emulator", "gyro-chain"):
        cases.append(Case(name, "runs", partial(printed, partial(python, name)), 10, fixed=True))
    cases.append(Case("start", "starts", partial(printed, partial(python, "start")), 20, fixed=True))
    return cases


def calibrate(case: Case, seconds: float) -> None:
    """Sets the count that takes about so long."""
    case.count = case.first
    if case.fixed:
        return
    got = case.sample(case.first)
    case.count = max(int(case.first * seconds * 1e9 / max(got["ns"], 1)), 1)
    if case.name == "vcd":
        case.count = (case.count + 99) // 100 * 100


def measure(case: Case) -> None:
    """One more rate."""
    got = case.sample(case.count)
    case.ns.append(float(got["ns"]))
    case.rates.append(got[case.unit] * 1e9 / got["ns"])
    if got.get("edges"):
        case.edges_per_unit = got["edges"] / got[case.unit]


def count_instructions(case: Case) -> None:
    """Instructions a unit, by callgrind: the difference of two counts."""
    if not case.under_callgrind:
        return
    collected = []
    for count in case.counts:
        tool = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null"]
        collected.append(_collected([*tool, *case.under_callgrind(count)]))
    case.instructions_per_unit = (collected[1] - collected[0]) / (case.counts[1] - case.counts[0])


def _collected(command: list[str]) -> int:
    p = subprocess.run(command, capture_output=True, text=True, check=True)
    found = re.search(r"Collected : (\d+)", p.stderr)
    if not found:
        raise RuntimeError(f"{' '.join(command)}: no count of instructions in\n{p.stderr}")
    return int(found.group(1))
