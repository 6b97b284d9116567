"""What must hold in a schedule, judged by the requirements of the device suite.

A *look* is a dialogue of the suite, or a stimulus with all of its checks. On a board at its defaults every look must
pass. While a fault is on, those requirements must hold that it does not touch by its nature (`fault_rules`). During a
storm of frames those must hold that hold whatever a host does (ALWAYS).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

from psabench.conform import suite
from psabench.conform.capture.log import Capture
from psabench.conform.dut import Dut
from psabench.conform.plan import plan_of, stimuli
from psabench.conform.profile import Variant, variant
from psabench.conform.proves import SuiteTest
from psabench.conform.requirements import Requirement
from psabench.conform.runner import Captures, judge_test, wanted
from psabench.conform.verdict import Outcome, Verdict, decide, not_decided
from psabench.explore.fault_rules import LINES, NOTHING, READINGS, VALUES

Judged = tuple[SuiteTest, tuple[Requirement, ...]]

# Whatever a host sends and whatever a converter does: what the node itself sends has its form.
ALWAYS = "BUS-ID-05 BUS-ID-06 BUS-EMCY-01 BUS-EMCY-02 BUS-EMCY-03 BUS-EMCY-05 BUS-BOOT-01".split()
# Recordings of readings are judged by these stimuli's checks, too.
ALSO: Mapping[str, Sequence[str]] = {"stream": ("quiet", "services", "overload")}
# Looks that take more than a second of simulated time, s; of several boards the least. A schedule that is too short for
# another one cuts it off, and does not judge it.
LONG_S: Mapping[str, float] = {
    "services": 3.6,
    "overload": 2.4,
    "quiet": 2.6,
    "rates": 1.3,
    "forms": 1.7,
    "boot_up_is_the_first_frame_after_power": 1.1,
    "reset_node_restores_the_defaults": 1.1,
    "no_heartbeat_where_the_period_is_0": 2.1,
    "a_silent_client_is_given_up": 2.1,
    "the_remark_goes_with_the_power": 1.1,
    "the_load_is_the_share_of_the_bus": 1.1,
    "numbers_go_on_to_their_modulus": 1.5,
    "the_history_of_errors": 1.7,
    "the_history_holds_eight": 15.1,
    "run": 92.0,
    "navigation": 86.0,
    "turns": 66.0,
    "minute": 61.0,
    "the_temperature_is_that_of_the_chamber": 61.0,
}
# Services that want no readings: they hold on a board whose readings are wrong or have stopped.
SERVICES = ("BUS-BOOT", "BUS-HB", "BUS-ID-02", "BUS-ID-03", "BUS-SDO-0", "BUS-OD-02", "BUS-OD-03")
# Of values beside the tests that want known inputs: steps and noise of codes. Boards that integrate have nothing else.
OF_VALUES = (
    "PSA2-ADC PSA2-CHIP-05 PSA2-CHIP-06 PSA2-CHIP-07 PSA2-READ-10 PSA2-REG-08 PSA2-FORM-01 PSA2-SAMP-04 "
    "PSD1-CHIP PSD1-WORD"
).split()
BESIDE_VALUES = ("BUS-", "PSA2-", "PSD1-")
SEEN_ON_LINES = frozenset({"line", "pins", "port", "bus"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Violation:
    """What was found. key: the same for the same fault of the board, as far as anyone can tell."""

    key: str
    requirements: tuple[str, ...]
    saw: str
    due: str

    def words(self) -> str:
        return f"{', '.join(self.requirements) or self.key}: saw {self.saw}; due {self.due}"


def of_outcome(o: Outcome) -> Violation | None:
    """None: it has passed. A test that cannot be carried out in lockstep has found something, too."""
    if o.verdict is Verdict.FAILED:
        return Violation(key=o.test, requirements=o.requirements, saw=o.saw, due=o.due)
    if o.verdict is Verdict.INCONCLUSIVE:
        return Violation(key=o.test, requirements=o.requirements, saw=o.reason, due="a test that can be carried out")
    return None


@cache
def looks_of(board: str, profile: str) -> Mapping[str, Sequence[Judged]]:
    """Tests by the name of their stimulus, an active one by its own."""
    suite.load()
    found: dict[str, list[Judged]] = {}
    for proof, rows in wanted(variant(board, profile)):
        plan = plan_of(proof.test)
        found.setdefault(proof.test.__name__ if plan.is_active else plan.stimulus, []).append((proof, rows))
    return found


def short_looks(v: Variant, length_s: float) -> list[str]:
    """Those that a schedule of this length can have."""
    found = looks_of(v.board, v.profile)
    known = stimuli(v.family)
    there = (n for n, tests in found.items() if n in known or plan_of(tests[0][0].test).is_active)
    return sorted(n for n in there if LONG_S.get(n, 0.0) <= length_s)


# ---- while a fault is on


def _holds_services(_: SuiteTest, ids: Sequence[str]) -> bool:
    return all(i.startswith(SERVICES) for i in ids)


def _holds_beside_values(test: SuiteTest, ids: Sequence[str]) -> bool:
    of_values = any(i.startswith(tuple(OF_VALUES)) for i in ids) or "inputs" in plan_of(test.test).needs
    return not of_values and all(i.startswith(BESIDE_VALUES) for i in ids)


HOLDS: Mapping[str, Callable[[SuiteTest, Sequence[str]], bool]] = {
    VALUES: _holds_beside_values,
    LINES: lambda t, _: not plan_of(t.test).needs & SEEN_ON_LINES,
    READINGS: _holds_services,
    NOTHING: lambda *_: False,
}


def must_hold(test: SuiteTest, ids: Sequence[str], on: Sequence[str]) -> bool:
    """Whether a test must pass while faults with these rules are on."""
    return all(HOLDS[rule](test, ids) for rule in on)


# ---- looking


def look_at_board(s: Dut, name: str, on: Sequence[str]) -> list[Violation]:
    """Apply a stimulus and judge its checks, or carry out a dialogue. on: rules of the faults that are on."""
    all_looks = looks_of(s.variant.board, s.variant.profile)
    captures = Captures(s, lambda *_: ())
    tests = [t for t in all_looks.get(name, ()) if must_hold(t[0], [r.id for r in t[1]], on)]
    found = [of_outcome(judge_test(captures, *t)) for t in tests]
    if tests and not on and name in ALSO and isinstance(e := captures.shown.get(name), Capture):
        found += [judge_also(e, *t) for other in ALSO[name] for t in all_looks.get(other, ())]
    return [v for v in found if v is not None]


def judge_also(e: Capture, test: SuiteTest, rows: Sequence[Requirement]) -> Violation | None:
    """A check of a capture that was made for others: what it lacks is no finding."""
    plan = plan_of(test.test)
    if not plan.on_recording or plan.needs & {"lockstep"} or (e.lines is None and plan.needs & SEEN_ON_LINES):
        return None
    o = decide(not_decided(test.test, [r.id for r in rows], e.stimulus), lambda: test.test(e), lambda _: ())
    return of_outcome(o) if o.verdict is Verdict.FAILED else None


def judge_always(e: Capture) -> list[Violation]:
    """Of a log in which anything may have been sent."""
    tests = [t for ts in looks_of(e.variant.board, e.variant.profile).values() for t in ts]
    always = [(t, rows) for t, rows in tests if {r.id for r in rows} & set(ALWAYS) and not plan_of(t.test).is_active]
    found = [judge_also(e, t, rows) for t, rows in always]
    return [v for v in found if v is not None]
