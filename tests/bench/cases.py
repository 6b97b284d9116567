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

NAV = {  # unit, first count
    "kf-filterpy": ("steps", 1000),
    "sins-plan": ("plans", 2),
    "koi": ("hours", 1),
    "koi-python-ins": ("hours", 1),
    "strapdown": ("hours", 2),
    "strapdown-python-ins": ("hours", 1),
}

FLEETS = (64, 1000)
FLEET_MS = (1300, 2300)  # both are asleep before the end

# One PSA-2 of the default scenario and no client: what a simulated second takes, at rest and while the head turns.
ALONE = {
    "alone-eager": ("--eager",),
    "alone-lazy": (),
    "alone-streams": ("--start",),
}
ALONE_S = {"alone-eager": (2, 4), "alone-lazy": (10, 30), "alone-streams": (2, 4)}  # after the board's set-up
TURNS = "-turning"


def turning_scenario() -> Path:
    """`calibrate` with a head that turns for an hour."""
    text = (ROOT / "proto/scenarios/calibrate.yaml").read_text(encoding="utf-8")
    path = ROOT / "build/bench/turning.yaml"
    path.parent.mkdir(parents=True, exist_ok=True)
    turn = "timeline:\n  - {at_s: 0.5, cmd: head.turn, args: {angle_deg: 100}}\n"
    path.write_text(text.replace("turn_s: 2", "turn_s: 3600") + turn, encoding="utf-8")
    return path


def alone(name: str, seconds: int) -> list[str]:
    scenario = str(turning_scenario()) if name.endswith(TURNS) else "calibrate"
    quiet = ["--can", "none", "--pace", "free", "--quiet"]
    return [str(ROOT / "build/psa-emu"), scenario, *ALONE[name.removesuffix(TURNS)], *quiet, "--for", f"{seconds}s"]


def fleet_scenario(units: int) -> Path:
    """`fleet1000` with so many units, an eighth on each bus."""
    text = (ROOT / "proto/scenarios/fleet1000.yaml").read_text(encoding="utf-8")
    path = ROOT / f"build/bench/fleet-{units}.yaml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text.replace("count: 125", f"count: {units // 8}"), encoding="utf-8")
    return path


def fleet_for(units: int, ms: int) -> list[str]:
    """psa-emu with a fleet that no client looks at."""
    emulator, scenario = str(ROOT / "build/psa-emu"), str(fleet_scenario(units))
    return [emulator, scenario, "--can", "none", "--pace", "free", "--quiet", "--for", f"{ms}ms"]


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
    facts: dict[str, int] = field(default_factory=dict)  # all that the last run printed


def parse(output: str) -> dict[str, int]:
    """The integers of `NAME key=value ...`; of a Verilated driver's `frames N checksum H edges E ns T` too."""
    return {k: int(v) for k, v in re.findall(r"(\w+)[= ](\d+)(?= |$)", output.strip())}


def spent(command: Callable[[int], list[str]], seconds: int) -> dict[str, int]:
    """CPU time of a command that runs so many simulated seconds, its start included."""
    began_ns = children_cpu_ns()
    run(command(seconds))
    return {"simulated_s": seconds, "ns": children_cpu_ns() - began_ns}


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


def _compiled(path: Path) -> list[Case]:
    names = sorted(has_cases(path)) if path.exists() else []
    commands = {name: partial(core, path, name) for name in names}
    unit = {"bench_core": "frames", "bench_lib": "bytes", "bench_kf": "steps"}[path.name]
    return [Case(name, unit, partial(printed, c), 2000, c) for name, c in commands.items()]


def nav_cases(bench: Path) -> list[Case]:
    """Those of the page's table of filters: the whole of it is measured without the models."""
    python_cases = [
        Case(name, unit, partial(printed, partial(python, name)), first, fixed=unit == "hours")
        for name, (unit, first) in NAV.items()
    ]
    return _compiled(bench / "bench_kf") + python_cases


def all_cases(bench: Path, peers: dict[str, Peer]) -> list[Case]:
    """In the order of a round."""
    icarus, timing, driven, psd1 = (peers[name] for name in (*NAMES, PSD1))
    cases = [
        Case("icarus", "frames", partial(timed, icarus), 500, icarus.command, (5, 25)),
        Case("verilator-timing", "frames", partial(timed, timing), 5000, timing.command),
        Case("verilator", "frames", partial(printed, driven.command), 20000, driven.command, (1000, 3000)),
        Case(PSD1, "frames", partial(printed, psd1.command), 1000, psd1.command, (50, 150)),
    ]
    cases += _compiled(bench / "bench_core") + _compiled(bench / "bench_lib")
    for name, unit, first in (("decode", "frames", 20000), ("can", "frames", 20000), ("chips-spi", "bytes", 20000)):
        cases.append(Case(name, unit, partial(printed, partial(python, name)), first))
    cases += nav_cases(bench)
    for name, first in MONTE_CARLO.items():
        cases.append(Case(name, "runs", partial(printed, partial(python, name)), first))
    for name in ("gyro-emulator", "gyro-chain"):
        cases.append(Case(name, "runs", partial(printed, partial(python, name)), 10, fixed=True))
    fourier = partial(printed, partial(python, "fourier"))
    cases.append(Case("fourier", "simulated_ms", fourier, 80, fixed=True))
    for name in (f"{n}{turns}" for n in ALONE for turns in ("", TURNS)):
        command, counts = partial(alone, name), ALONE_S[name.removesuffix(TURNS)]
        cases.append(Case(name, "simulated_s", partial(spent, command), 10 * counts[1], command, counts, fixed=True))
    cases.append(Case("chamber", "simulated_s", partial(printed, partial(python, "chamber")), 60, fixed=True))
    for units in FLEETS:
        sample = partial(printed, partial(python, f"fleet-{units}"))
        cases.append(Case(f"fleet-{units}", "unit_ms", sample, 1000, partial(fleet_for, units), FLEET_MS, fixed=True))
    cases.append(Case("fleet-wall", "wall_ms", partial(printed, partial(python, "fleet-wall")), 5, fixed=True))
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
    got = case.facts = case.sample(case.count)
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
