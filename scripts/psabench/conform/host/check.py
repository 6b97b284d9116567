"""What a case left behind, and the tests that check it.

    @checks("HOST-CAN-02", "torn")
    def a_half_is_told_as_torn(e: HostCapture) -> str: ...

A test is a pure function of the capture of its case, as the device suite's are; it raises `Failed`, `Inconclusive`, or
`Unseen` where the host does not do what could be checked.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeVar

import numpy as np

from psabench.conform.host.capture import Bus, SentSample
from psabench.conform.host.results import Sample, Told
from psabench.conform.host.stimulus_bus import BusCycle
from psabench.conform.requirements import Requirement, requirements
from psabench.conform.verdict import Failed, conclusive, expect
from psabench.errors import expected

HEARTBEAT_S = 1.0  # 1017h as the board has it
STOOD_S = 0.04  # the bench may have stood still for so long before a host may take the board for silent


@dataclass(slots=True)
class Match:
    """The host's samples against those that were sent, in their order."""

    pairs: list[tuple[Sample, SentSample]] = field(default_factory=list)
    strange: list[Sample] = field(default_factory=list)  # never sent, told twice, or told out of order
    missing: list[SentSample] = field(default_factory=list)  # due, and not told
    wrong: list[tuple[Sample, SentSample]] = field(default_factory=list)  # of `pairs`: other codes
    unsettled: list[Sample] = field(default_factory=list)  # told, and of no use


def match(told: Sequence[Sample], sent: Sequence[SentSample]) -> Match:
    """Each sample told with the next one of that number that was sent."""
    found = Match()
    where: dict[int, list[int]] = {}
    for i, p in enumerate(sent):
        where.setdefault(p.seq, []).append(i)
    last = -1
    taken = set()
    for s in told:
        places = where.get(s.number, [])
        k = bisect_right(places, last)
        if k == len(places):
            found.strange.append(s)
            continue
        last = places[k]
        taken.add(last)
        found.pairs.append((s, sent[last]))
        if s.codes != sent[last].codes or s.channel not in (-1, sent[last].channel):
            found.wrong.append((s, sent[last]))
        if not sent[last].settled:
            found.unsettled.append(s)
    found.missing = [p for i, p in enumerate(sent) if p.due and p.settled and i not in taken]
    return found


@dataclass
class HostCapture:
    """Of one case. bus: what was sent; told: what the host made of it."""

    case: str
    bus: Bus
    told: Told
    profile: str = "article"  # of the board
    status: int | None = 0  # the host's exit status; None: it had to be ended
    marks: Mapping[str, float] = field(default_factory=dict)  # instants of the case, simulated s
    stood_s: float = 0.0  # longest that the bench has stood still against the wall's time
    clock: Sequence[tuple[float, float]] = ()  # simulated and the wall's time, s, about each step of the bench
    streamed: bool = True  # the host has started the stream
    cycles: Sequence[BusCycle] = ()  # of the host on the board's parallel bus
    errors: str = ""  # what the host has written beside its results

    @cached_property
    def match(self) -> Match:
        return match(self.told.samples, self.bus.samples)

    def samples(self) -> Match:
        """The match of a case in which samples are due. Raises Failed where none came, or the host did not go on."""
        if not self.streamed or not self.bus.samples:
            raise Failed(f"no stream was started{self.last_words()}", "NMT start after the set-up has been read")
        expect(self.told.samples, f"no sample was reported{self.last_words()}", f"{len(self.bus.samples)} samples")
        m = self.match
        if m.strange:
            s = m.strange[0]
            raise Failed(
                f"{len(m.strange)} samples that were not sent, or twice, or out of order; the first is {s.number}",
                "each sample once, in order, and no other",
            )
        if m.wrong:
            s, p = m.wrong[0]
            raise Failed(f"sample {s.number} with {s.codes} of channel {s.channel}", f"{p.codes} of {p.channel}")
        if m.missing:
            p = m.missing[0]
            raise Failed(
                f"{len(m.missing)} samples were not told; the first is {p.seq}, which came at {p.arrived_s:.6f} s",
                f"all {len(self.bus.samples)} that came whole",
            )
        return m

    def last_words(self) -> str:
        """What the host has complained of last, as the end of a sentence."""
        line = self.errors.strip().splitlines()[-1:]
        return f"; said {line[0][:200]}" if line else ""

    def wall_s(self, begin_s: float, end_s: float) -> float:
        """How long a host may have held that simulated time for, which passes slower on a loaded machine."""
        if not self.clock:
            return end_s - begin_s
        sim_s, wall_s = np.array(self.clock).T
        first = max(0, int(np.searchsorted(sim_s, begin_s)) - 1)
        last = min(len(sim_s) - 1, int(np.searchsorted(sim_s, end_s)))
        return max(end_s - begin_s, float(wall_s[last] - wall_s[first]))

    @property
    def may_seem_silent(self) -> bool:
        """Whether the bench stood still, or went so slowly, that a host may have taken the board for silent."""
        short_s = float(limits("HOST-STALE-01").limit("silent_max_s"))
        return self.stood_s > STOOD_S or self.longest_s(short_s) > short_s + 2 * STOOD_S

    def longest_s(self, span_s: float) -> float:
        """The most that so much simulated time has taken."""
        if not self.clock:
            return span_s
        sim_s, wall_s = np.array(self.clock).T
        last = np.minimum(np.searchsorted(sim_s, sim_s + span_s), len(sim_s) - 1)
        return max(span_s, float((wall_s[last] - wall_s).max()))

    def nothing_but(self, *names: str) -> None:
        """Raises Failed when the host told anything else. Silence that the bench itself made is no false alarm."""
        allowed = {*names, "end"}
        if self.may_seem_silent:
            allowed |= {"stale"}
        if self.longest_s(HEARTBEAT_S) > 0.9 * HEARTBEAT_S * float(limits("HOST-CAN-07").limit("gone_after_periods")):
            allowed |= {"gone"}
        for event in self.told.events:
            if event.name not in allowed:
                raise Failed(
                    f'{{"{event.name}": {event.value}}} after {event.at} samples',
                    "nothing that was not sent" if not names else f"{', '.join(names)} at most",
                )

    def count(self, name: str, due: int) -> None:
        """Raises Failed when the numbers told under that name do not come to `due`."""
        if (saw := self.told.sum(name)) != due:
            raise Failed(f"{name}: {saw}", f"{name}: {due}")


HostCheck = Callable[[HostCapture], str]
Test = TypeVar("Test", bound=HostCheck)


@dataclass(frozen=True, slots=True)
class CaseCheck:
    """A test with its case and its requirements."""

    test: HostCheck
    case: str
    ids: tuple[str, ...]


_case_checks: list[CaseCheck] = []


def checks(requirement: str, *cases: str) -> Callable[[Test], Test]:
    """What a test proves, and the cases whose capture it wants; it checks each by itself.

    Raises ValueError for an unknown id.
    """
    if requirement not in requirements().rows:
        raise ValueError(expected("the id of a requirement", requirement, "checks"))

    def register(test: Test) -> Test:
        _case_checks.extend(CaseCheck(test, case, (requirement,)) for case in cases)
        return test

    return register


def case_checks() -> tuple[CaseCheck, ...]:
    """All tests that were registered, in the order of their modules."""
    return tuple(_case_checks)


def limits(key: str) -> Requirement:
    """The row that a test takes its figures from."""
    return requirements()[key]


def enough(what: object, words: str) -> None:
    """Raises Inconclusive when the case did not show what it should."""
    conclusive(what, f"the case did not show {words}")
