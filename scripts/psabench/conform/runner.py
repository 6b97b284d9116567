"""Runs the device suite: every test of every requirement that holds for this board, each with its verdict.

A stimulus is applied before the first check of it, and its capture is kept. A test whose probe is missing is not
observable; one whose stimulus fails is inconclusive. Ctrl-C ends the run; what was checked so far stays.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

from psabench.conform.capture.log import Capture
from psabench.conform.dut import Dut
from psabench.conform.plan import Plan, plan_of, stimuli
from psabench.conform.profile import Variant
from psabench.conform.proves import SuiteTest, suite_tests
from psabench.conform.requirements import Requirement, requirements
from psabench.conform.verdict import Failed, Inconclusive, Outcome, decide, not_decided
from psabench.errors import BenchError
from psabench.procedures.head_bench import Progress

MISSING = {
    "can": "no CAN bus was connected",
    "line": "no line port or adapter was connected (--lines)",
    "pins": "requires a logic analyser on all pins; INT, DATA and CLK alone do not show it",
    "wires": "requires a logic analyser on both wires of each differential pair and behind its receiver",
    "bus": "no bus port was connected (--bus-port)",
    "supply": "no power supply was connected (--scpi supply=...)",
    "chamber": "no thermal chamber was connected (--scpi chamber=...)",
    "head": "no dividing head was connected (--scpi head=...)",
    "table": "no rate table was connected (--scpi table=...)",
    "lockstep": "requires an emulator in lockstep: it takes too long in real time",
    "exact": "the probes' clock is not the board's own: requires an emulator in lockstep",
    "port": "no line port was connected (--lines)",
    "stream": "this board sends readings only while a host reads its bus",
    "fd": "the link to the bus carries no FD frames; slcan and SocketCAN do",
    "rtr": "the link to the bus carries no remote frames; slcan and SocketCAN do",
    "stamps": "the link's time stamps are this machine's, not the bus's",
    "errors": "requires a device that destroys frames on the bus",
    "slow": "requires a bus of another bit rate",
    "inputs": "the volts at the inputs were not told (--input x=2.5)",
}


PLAYS = 4  # of a stimulus, at most, until its probe has lost no samples
# Keeps what shows a failure: name of the test, what it found, the capture it had; tells the files.
Keep = Callable[[str, Failed, Capture | None], tuple[str, ...]]


@dataclass(slots=True)
class Captures:
    """The device under test (DUT) and what its stimuli have shown so far."""

    dut: Dut
    keep: Keep
    shown: dict[str, Capture | Exception] = field(default_factory=dict)

    def capture(self, name: str) -> Capture:
        """Of a stimulus, which is applied if it has not been. Raises what it raised."""
        if name not in self.shown:
            self.shown[name] = self._apply(name)
        found = self.shown[name]
        if isinstance(found, Exception):
            raise found
        return found

    def _apply(self, name: str) -> Capture | Exception:
        known = stimuli(self.dut.variant.family)
        if name not in known:
            return Inconclusive(f"no stimulus {name} for this board")
        try:
            for _ in range(PLAYS):
                found = known[name].make(self.dut)
                if found.lines is None or not len(found.lines.gaps_ns):
                    break  # else samples were lost on their way, and no one can tell what they were
            return found
        except (BenchError, Failed, Inconclusive) as e:
            return e


def wanted(variant: Variant, only: Sequence[str] = ()) -> list[tuple[SuiteTest, tuple[Requirement, ...]]]:
    """Tests for a variant with those of their requirements that hold for it; only: ids, or beginnings of ids."""
    rows = requirements().rows
    found = []
    for proof in suite_tests():
        boards = plan_of(proof.test).boards
        if boards and variant.family not in boards:
            continue
        mine = tuple(rows[i] for i in proof.ids if rows[i].applies(variant.board, variant.profile))
        if mine and (not only or any(i.startswith(tuple(only)) for i in proof.ids)):
            found.append((proof, mine))
    order = list(stimuli(variant.family))
    return sorted(found, key=lambda t: _turn(plan_of(t[0].test), order))


def _turn(plan: Plan, order: Sequence[str]) -> int:
    """Checks first, in the order of their stimuli; active tests may leave the board otherwise than they found it."""
    return len(order) if plan.is_active else order.index(plan.stimulus) if plan.stimulus in order else -1


def run(
    dut: Dut,
    progress: Progress,
    *,
    only: Sequence[str] = (),
    clock_ppm: float = 100.0,
    told: Callable[[Outcome], None] = lambda _: None,
    keep: Keep = lambda *_: (),
) -> list[Outcome]:
    """Check everything; told: of each outcome as it comes. clock_ppm: allowed to all clocks."""
    dut.allowed_ppm = clock_ppm
    captures, tests = Captures(dut, keep), wanted(dut.variant, only)
    each = (judge_test(captures, proof, rows) for proof, rows in tests)
    return tell_each(each, len(tests), dut.variant.name, progress, told)


def tell_each(
    each: Iterable[Outcome], count: int, subject: str, progress: Progress, told: Callable[[Outcome], None]
) -> list[Outcome]:
    """All outcomes, each told as it comes."""
    outcomes: list[Outcome] = []
    with progress.step(subject, max(1, count)) as advance:
        for outcome in each:
            outcomes.append(outcome)
            told(outcome)
            advance()
    return outcomes


def judge_test(captures: Captures, proof: SuiteTest, rows: tuple[Requirement, ...]) -> Outcome:
    """Run one test of the suite on this device, its stimulus first where it has not been applied."""
    plan = plan_of(proof.test)
    begun_s = time.monotonic()
    found = not_decided(proof.test, [r.id for r in rows], plan.stimulus)
    missing = plan.needs - captures.dut.probes
    if missing:
        return replace(found, reason="; ".join(MISSING[m] for m in sorted(missing)))
    capture: Capture | None = None

    def test() -> str:
        nonlocal capture
        capture = None if plan.is_active else captures.capture(plan.stimulus)
        return proof.test(capture or captures.dut)

    found = decide(found, test, lambda e: captures.keep(found.test, e, capture))
    return replace(found, took_s=time.monotonic() - begun_s)
