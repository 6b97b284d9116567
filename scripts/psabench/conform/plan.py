"""How a test of the device suite is carried out: a stimulus gives a capture, checks check it; an active test does both.

    @stimulus("stream", boards=("psa2",))
    def stream(s: Dut) -> Capture: ...            # side effects, once a run, for all checks that want it

    @check("stream", "PSA2-FRAME-01", needs={"line"})
    def int_is_low_for_long_enough(e: Capture, row: Requirement) -> str: ...   # pure: the same for a recording

    @active("PSA2-REQ-04", needs={"can"})
    def a_write_to_id_is_refused(s: Dut) -> str: ...

After the stimulus stand the ids of the requirements that the test proves; a test that takes a second argument gets the
row of the one that holds for the variant, for the figures in it. The function's docstring says in its first line what
is done. It returns in words what was seen, raises `Failed` where that is not what is due and `Inconclusive` where it
cannot tell.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import wraps
from inspect import unwrap
from typing import TYPE_CHECKING, Any

from psabench.conform.capture.intervals import wires_needed
from psabench.conform.capture.log import Capture
from psabench.conform.proves import proves, row_for
from psabench.errors import expected

if TYPE_CHECKING:
    from psabench.conform.dut import Dut

Check = Callable[[Capture], str]
Active = Callable[["Dut"], str]
Test = Callable[..., str]
Prepare = Callable[[Any], None]
StimulusOf = Callable[["Dut"], Capture]

WAYS = frozenset(
    "can line pins wires bus supply chamber head table lockstep exact inputs fd rtr stamps errors slow port"
    " stream".split()
)

# Parts of a recording: all of it; a Res or boot-up and what follows; the readings after the set-up; "": none of it.
PARTS = ("all", "boot", "stream", "")
# Stimuli that a bench goes through by itself. Others are a stimulus: a recording has it only if somebody made it.
STIMULUS_ON_RECORDING: Mapping[str, str] = {
    "stream": "stream",
    "quiet": "stream",
    "starts": "stream",
    "power_on": "boot",
    "services": "all",
    "overload": "all",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Of a test. stimulus "": an active test."""

    stimulus: str
    needs: frozenset[str]  # probes without which it is not observable
    on_recording: str = ""  # the part of a recording that it checks, one of PARTS; "": it wants its stimulus
    boards: frozenset[str] = frozenset()  # families that it is for; none: all that have its requirements

    @property
    def is_active(self) -> bool:
        return not self.stimulus


@dataclass(frozen=True, slots=True, kw_only=True)
class Stimulus:
    """A stimulus by name; the same name may stand for another one on another board."""

    name: str
    boards: tuple[str, ...]  # families
    make: StimulusOf


_plans: dict[Callable[..., str], Plan] = {}
_stimuli: list[Stimulus] = []


def check(
    stimulus: str,
    *ids: str,
    needs: Iterable[str] = ("can",),
    on_recording: str | None = None,
    boards: Iterable[str] = (),
    wires: Iterable[str] = (),
) -> Callable[[Test], Check]:
    """A pure test of the capture of this stimulus. Raises ValueError for a need or a part that there is not.

    on_recording: the part of a recording that it checks, that of its stimulus (STIMULUS_ON_RECORDING) by default.
    boards: families that have the stimulus, where requirements of others, too, are proved, which have another test.
    wires: lines without which it is inconclusive.
    """
    part = STIMULUS_ON_RECORDING.get(stimulus, "") if on_recording is None else on_recording
    if part not in PARTS:
        raise ValueError(expected(", ".join(map(repr, PARTS)), repr(part), "on_recording"))

    plan = Plan(stimulus=stimulus, needs=_ways(needs), on_recording=part, boards=frozenset(boards))
    names = tuple(wires)
    return lambda test: _planned(test, ids, plan, before=(lambda e: wires_needed(e, *names)) if names else None)


def active(
    *ids: str,
    needs: Iterable[str] = ("can",),
    before: Prepare | None = None,
    after: Prepare | None = None,
    boards: Iterable[str] = (),
) -> Callable[[Test], Active]:
    """A test that asks the board itself.

    before: brings the board to a known state first; after: the same once it has passed. boards: as those of a check.
    """
    plan = Plan(stimulus="", needs=_ways(needs), boards=frozenset(boards))
    return lambda test: _planned(test, ids, plan, before, after)


def _planned(
    test: Test, ids: tuple[str, ...], plan: Plan, before: Prepare | None = None, after: Prepare | None = None
) -> Test:
    """The test with its plan, of what it looks at alone: where it wants the row that it proves, it gets that."""
    planned, wants_row = test, unwrap(test).__code__.co_argcount > 1
    if wants_row or before or after:

        @wraps(test)
        def whole_test(seen: Any) -> str:
            if before:
                before(seen)
            saw = test(seen, row_for(seen, *ids)) if wants_row else test(seen)
            if after:
                after(seen)
            return saw

        planned = whole_test
    _plans[planned] = plan
    return proves(*ids)(planned) if ids else planned


def stimulus(name: str, *, boards: Iterable[str]) -> Callable[[StimulusOf], StimulusOf]:
    """A stimulus of these families of boards."""

    def register(make: StimulusOf) -> StimulusOf:
        _stimuli.append(Stimulus(name=name, boards=tuple(boards), make=make))
        return make

    return register


def plan_of(test: Callable[..., str]) -> Plan:
    """Raises ValueError for a test without @check and without @active."""
    if test not in _plans:
        raise ValueError(expected("@check or @active", "neither", test.__name__))
    return _plans[test]


def stimuli(family: str) -> Mapping[str, Stimulus]:
    """The stimuli of a family of boards by name, in the order in which a run plays them."""
    return {s.name: s for s in _stimuli if family in s.boards}


def _ways(needs: Iterable[str]) -> frozenset[str]:
    found = frozenset(needs)
    if found - WAYS:
        raise ValueError(expected(", ".join(sorted(WAYS)), ", ".join(sorted(found - WAYS)), "needs"))
    return found
