"""What a case left behind, and the tests that judge it.

    @proves("HOST-CAN-02")
    @judges("torn")
    def a_half_is_told_as_torn(e: HostEvidence) -> str: ...

A test is a pure function of the evidence of its case, as the device suite's are; it raises `Broken`, `TooLittle`, or
`Unseen` where the host does not do what could be judged.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeVar

import numpy as np

from psabench.conform.host.capture import Bus, Played
from psabench.conform.host.results import Sample, Told
from psabench.conform.host.stimulus_bus import BusCycle
from psabench.conform.requirements import Requirement, requirements
from psabench.conform.verdict import Broken, TooLittle

HEARTBEAT_S = 1.0  # 1017h as the board has it
STOOD_S = 0.04  # the stage may have stood still for so long before a host may take the board for silent


class Unseen(Exception):
    """Not observable with this host: the words say why."""


@dataclass(slots=True)
class Match:
    """The host's samples against those that were played, in their order."""

    pairs: list[tuple[Sample, Played]] = field(default_factory=list)
    strange: list[Sample] = field(default_factory=list)  # never played, told twice, or told out of order
    missing: list[Played] = field(default_factory=list)  # due, and not told
    wrong: list[tuple[Sample, Played]] = field(default_factory=list)  # of `pairs`: other codes
    unsettled: list[Sample] = field(default_factory=list)  # told, and of no use


def match(told: Sequence[Sample], played: Sequence[Played]) -> Match:
    """Each sample told with the next one of that number that was played."""
    found = Match()
    where: dict[int, list[int]] = {}
    for i, p in enumerate(played):
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
        found.pairs.append((s, played[last]))
        if s.codes != played[last].codes or s.channel not in (-1, played[last].channel):
            found.wrong.append((s, played[last]))
        if not played[last].settled:
            found.unsettled.append(s)
    found.missing = [p for i, p in enumerate(played) if p.due and p.settled and i not in taken]
    return found


@dataclass
class HostEvidence:
    """Of one case. bus: what was played; told: what the host made of it."""

    case: str
    bus: Bus
    told: Told
    profile: str = "article"  # of the board that is played
    status: int | None = 0  # the host's exit status; None: it had to be ended
    marks: Mapping[str, float] = field(default_factory=dict)  # instants of the case, simulated s
    stood_s: float = 0.0  # longest that the stage has stood still against the wall's time
    clock: Sequence[tuple[float, float]] = ()  # simulated and the wall's time, s, about each step of the stage
    streamed: bool = True  # the host has started the stream
    cycles: Sequence[BusCycle] = ()  # of the host on the board's parallel bus
    errors: str = ""  # what the host has written beside its results

    @cached_property
    def match(self) -> Match:
        return match(self.told.samples, self.bus.samples)

    def samples(self) -> Match:
        """The match of a case in which samples are due. Raises Broken where none came, or the host did not go on."""
        if not self.streamed or not self.bus.samples:
            raise Broken(f"no stream was started{self.last_words()}", "NMT start after the set-up has been read")
        if not self.told.samples:
            raise Broken(f"no sample was reported{self.last_words()}", f"{len(self.bus.samples)} samples")
        m = self.match
        if m.strange:
            s = m.strange[0]
            raise Broken(
                f"{len(m.strange)} samples that were not played, or twice, or out of order; the first is {s.number}",
                "each sample once, in order, and no other",
            )
        if m.wrong:
            s, p = m.wrong[0]
            raise Broken(f"sample {s.number} with {s.codes} of channel {s.channel}", f"{p.codes} of {p.channel}")
        if m.missing:
            p = m.missing[0]
            raise Broken(
                f"{len(m.missing)} samples were not told; the first is {p.seq}, which came at {p.arrived_s:.6f} s",
                f"all {len(self.bus.samples)} that came whole",
            )
        return m

    def last_words(self) -> str:
        """What the host has complained of last, in brackets."""
        line = self.errors.strip().splitlines()[-1:]
        return f" ({line[0][:200]})" if line else ""

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
        """Whether the stage stood still, or went so slowly, that a host may have taken the board for silent."""
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
        """Raises Broken when the host told anything else. Silence that the stage itself made is no false alarm."""
        allowed = {*names, "end"}
        if self.may_seem_silent:
            allowed |= {"stale"}
        if self.longest_s(HEARTBEAT_S) > 0.9 * HEARTBEAT_S * float(limits("HOST-CAN-07").limit("gone_after_periods")):
            allowed |= {"gone"}
        for event in self.told.events:
            if event.name not in allowed:
                raise Broken(
                    f'{{"{event.name}": {event.value}}} after {event.at} samples',
                    "nothing that was not played" if not names else f"{', '.join(names)} at most",
                )

    def count(self, name: str, due: int) -> None:
        """Raises Broken when the numbers told under that name do not come to `due`."""
        if (saw := self.told.sum(name)) != due:
            raise Broken(f"{name}: {saw}", f"{name}: {due}")


Judge = Callable[[HostEvidence], str]
Test = TypeVar("Test", bound=Judge)


@dataclass(frozen=True, slots=True)
class Judged:
    """A test with its case and its requirements."""

    test: Judge
    case: str
    ids: tuple[str, ...]


_cases: dict[Judge, tuple[str, ...]] = {}
_judged: list[Judged] = []


def judges(*cases: str) -> Callable[[Test], Test]:
    """The cases whose evidence a test wants; it judges each by itself."""

    def register(test: Test) -> Test:
        _cases[test] = cases
        return test

    return register


def proves(*ids: str) -> Callable[[Test], Test]:
    """As `psabench.conform.proves.proves`, for tests of hosts. Raises ValueError for an unknown id."""
    if unknown := [i for i in ids if i not in requirements().rows]:
        raise ValueError(f"proves: no requirement {', '.join(unknown)}")

    def register(test: Test) -> Test:
        _judged.extend(Judged(test, case, ids) for case in _cases[test])
        return test

    return register


def judged() -> tuple[Judged, ...]:
    """All tests that were registered, in the order of their modules."""
    return tuple(_judged)


def limits(key: str) -> Requirement:
    """The row that a test takes its figures from."""
    return requirements()[key]


def enough(what: object, words: str) -> None:
    """Raises TooLittle when the case did not show what it should."""
    if not what:
        raise TooLittle(f"the case did not show {words}")
