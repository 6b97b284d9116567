"""One run of the device suite on a board that conforms: what of it failed or stayed open is a false alarm."""

from __future__ import annotations

import gc
import json
import multiprocessing
import os
import signal
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from psabench.boards.registry import BOARDS, BUS_BOARDS
from psabench.conform import runner
from psabench.conform.dut import INPUTS_V, UNIT, Addresses, Dut, scenario
from psabench.conform.profile import variant
from psabench.conform.verdict import Outcome, Verdict
from psabench.emulator import Emulator
from psabench.errors import BenchError
from psabench.link.endpoints import scpi_addresses
from psabench.procedures.head_bench import Silent

from tests.false_positives.design import Case

ALARMS = (Verdict.FAILED, Verdict.INCONCLUSIVE)
LIMIT_S, LOAD_LIMIT_S = 900.0, 3600.0  # far more than a run takes: what hangs is an alarm, too
FORK = multiprocessing.get_context("fork")  # the suite is imported once


@dataclass(frozen=True, slots=True, kw_only=True)
class Alarm:
    """A test that did not pass. verdict: also `no verdict`, of a run that came to no end."""

    requirements: tuple[str, ...]
    verdict: str
    words: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """Of a case. state: of the sources that were run."""

    case: Case
    state: str
    passed: int = 0
    tests: int = 0
    alarms: tuple[Alarm, ...] = ()
    took_s: float = 0.0

    def row(self) -> dict[str, Any]:
        """As it is in false_positives.json."""
        return asdict(self)

    @classmethod
    def of(cls, row: dict[str, Any]) -> Result:
        """From false_positives.json."""
        alarms = tuple(Alarm(**a | {"requirements": tuple(a["requirements"])}) for a in row["alarms"])
        return cls(**row | {"case": Case(**row["case"]), "alarms": alarms})


@dataclass(slots=True)
class Found:
    """What a run came to, or why it came to nothing."""

    outcomes: list[Outcome] = field(default_factory=list)
    trouble: str = ""


Judged = Callable[[Case], list[Outcome]]


def judged(case: Case, *, loops: int = os.cpu_count() or 1, only: Sequence[str] = ()) -> list[Outcome]:
    """All outcomes of the suite. loops: busy ones, where the case is under load; only: as `runner.run`'s.

    Raises BenchError.
    """
    return real_time(case, loops, only) if case.load else in_lockstep(case, only)


def in_lockstep(case: Case, only: Sequence[str]) -> list[Outcome]:
    """With an emulator whose time moves when we say so."""
    v = variant(case.board, case.profile)
    errors = {"clock_ppm": case.board_ppm, "recorder_ppm": case.probes_ppm}
    with Dut.open(v, Addresses(), seed=case.seed, **errors) as dut:
        return runner.run(dut, Silent(), only=only)


def real_time(case: Case, loops: int, only: Sequence[str]) -> list[Outcome]:
    """With an emulator in real time, over its socketcand, line port, bus port and supply, beside so many busy loops."""
    v = variant(case.board, case.profile)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="psabench-")))
        path, line, bus = folder / "bench.yaml", folder / "line", folder / "bus"
        path.write_text(json.dumps(scenario(v, INPUTS_V, case.board_ppm)), encoding="utf-8")
        has_bus = v.family in BUS_BOARDS
        extra: list[str | Path] = ["--line", line, *(["--bus-port", f"{UNIT}:{bus}"] if has_bus else [])]
        emulator = Emulator(path, pace="wall", seed=case.seed, control=False, scpi=True, extra=extra)
        stack.enter_context(emulator)
        can = emulator.endpoint(can="socketcand")
        at = Addresses(
            can=f"socketcand:{can['host']}:{can['port']}",
            lines=line,
            bus_port=bus if has_bus else None,
            scpi=scpi_addresses(emulator.endpoints),
            inputs_v=INPUTS_V if BOARDS[v.family].has_inputs else {},
        )
        stack.enter_context(busy(loops))
        with Dut.open(v, at) as dut:
            return runner.run(dut, Silent(), only=only)


def _spin() -> None:
    while True:
        pass


@contextmanager
def busy(count: int) -> Iterator[None]:
    """So many processes that do nothing but take time."""
    spinning = [FORK.Process(target=_spin) for _ in range(count)]
    for p in spinning:
        p.start()
    try:
        yield
    finally:
        for p in spinning:
            p.kill()
            p.join()


def result(case: Case, state: str, judged: Judged = judged) -> Result:
    """Run it in a process of its own, which is ended with all that it started when it takes too long.

    The suite has been loaded (`suite.load`): whoever edits it meanwhile changes nothing.
    """
    begun_s = time.monotonic()
    found = _bounded(case, LOAD_LIMIT_S if case.load else LIMIT_S, judged)
    alarms = [_alarm(o) for o in found.outcomes if o.verdict in ALARMS]
    passed = sum(o.verdict is Verdict.PASSED for o in found.outcomes)
    if found.trouble or not passed:
        alarms.append(Alarm(requirements=(), verdict="no verdict", words=found.trouble or "nothing passed"))
    return Result(
        case=case,
        state=state,
        passed=passed,
        tests=len(found.outcomes),
        alarms=tuple(alarms),
        took_s=round(time.monotonic() - begun_s, 1),
    )


def _alarm(o: Outcome) -> Alarm:
    words = o.reason or f"{o.saw}; due {o.due}"
    return Alarm(requirements=o.requirements, verdict=o.verdict.value, words=f"{o.test}: {words}")


def _bounded(case: Case, limit_s: float, judged: Judged) -> Found:
    mine, other = FORK.Pipe(duplex=False)
    child = FORK.Process(target=_child, args=(other, case, judged))
    child.start()
    other.close()
    try:
        if not mine.poll(limit_s):
            return Found(trouble=f"no end after {limit_s:g} s")
        found: Found = mine.recv()
        return found
    except EOFError:
        return Found(trouble="the suite ended without a word")
    finally:
        _end(child.pid)
        child.join()
        mine.close()


def _child(to: Connection, case: Case, judged: Judged) -> None:
    os.setsid()  # a group of its own: it can be ended with its busy loops
    gc.disable()  # it lives for seconds; a tenth of them would go there
    try:
        to.send(Found(outcomes=judged(case)))
    except BenchError as e:
        to.send(Found(trouble=str(e)))
    except (ArithmeticError, AssertionError, AttributeError, LookupError, OSError, TypeError, ValueError) as e:
        to.send(Found(trouble=f"{type(e).__name__}: {e}"))


def _end(pid: int | None) -> None:
    """Whatever of its group is left. An emulator that it started sees its input end and ends by itself."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(pid or 0, signal.SIGKILL) if pid else None


def worst(alarms: Sequence[Alarm]) -> str:
    """Of a line on the terminal."""
    return "; ".join(f"{' '.join(a.requirements)} {a.verdict}: {a.words}" for a in alarms)
