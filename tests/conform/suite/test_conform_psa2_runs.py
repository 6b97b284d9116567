"""Whole runs of the device suite on PSA-2 and PSA-1: every shipped profile conforms, by pins and by the line port."""

from __future__ import annotations

import pytest
from psabench.conform import runner, suite
from psabench.conform.dut import Addresses, Dut
from psabench.conform.plan import stimuli
from psabench.conform.profile import Variant, variant
from psabench.conform.requirements import requirements
from psabench.conform.verdict import Outcome, Verdict
from psabench.procedures.head_bench import Silent

suite.load()

OPEN = (Verdict.FAILED, Verdict.INCONCLUSIVE)
SOCKETCAND, SLCAN = "socketcand:0", "slcan"


def judged(v: Variant, at: Addresses, seed: int, clock_ppm: float) -> list[Outcome]:
    with Dut.open(v, at, seed=seed, clock_ppm=clock_ppm) as dut:
        return runner.run(dut, Silent(), only=["PSA2", "PSA1"])


@pytest.mark.parametrize(
    ("board", "profile", "seed", "clock_ppm", "at"),
    [
        ("psa2", "article", 2, 100.0, Addresses()),
        ("psa2", "intent", 3, -100.0, Addresses()),
        ("psa2", "ungated", 5, 100.0, Addresses()),
        ("psa2", "lab32", 6, 100.0, Addresses()),
        ("psa2", "w16", 7, -100.0, Addresses()),
        ("psa2", "w24", 8, 100.0, Addresses()),
        ("psa1", "psa1", 9, -100.0, Addresses()),
        ("psa2", "article", 10, -100.0, Addresses(port_only=True)),
        ("psa2", "w16", 11, 100.0, Addresses(port_only=True)),
        ("psa2", "w24", 12, -100.0, Addresses(port_only=True)),
        ("psa2", "lab32", 13, 0.0, Addresses(port_only=True)),
        ("psa1", "psa1", 14, 100.0, Addresses(port_only=True)),
        ("psa2", "article", 15, 0.0, Addresses(adapter=SLCAN)),
    ],
)
def test_a_profile_conforms(board: str, profile: str, seed: int, clock_ppm: float, at: Addresses) -> None:
    v = variant(board, profile)
    found = judged(v, at, seed, clock_ppm)
    assert not [(o.requirements, o.saw, o.due, o.reason) for o in found if o.verdict in OPEN]
    passed = {i for o in found if o.verdict is Verdict.PASSED for i in o.requirements}
    rows = {r.id for r in requirements() if r.group == "psa2" and r.applies(board, profile) and not r.unobservable}
    fd = {i for i in rows if i in ("PSA2-FORM-03", "PSA2-FORM-04", "PSA2-FORM-05", "PSA2-FORM-08")}
    if not at.port_only:
        assert rows - passed == ({"PSA2-CAN-03"} if at.adapter == SLCAN else fd)  # slcan has no time stamps of the bus
    else:
        assert not {i for i in rows - passed if "line" in requirements()[i].observe}


@pytest.mark.parametrize("wrong", ["w24", "w16", "lab32", "intent"])
def test_a_board_of_another_profile_does_not_conform(wrong: str) -> None:
    """The board is one, the user says another: the rows in which they differ fail, and none of the others crash."""
    with Dut.open(variant("psa2", wrong), Addresses(), seed=3) as dut:
        dut.variant = variant("psa2", "article")
        found = runner.run(dut, Silent(), only=["PSA2-SETUP", "PSA2-FRAME", "PSA2-INT", "PSA2-WORD", "PSA2-READ-02"])
    failed = {i for o in found if o.verdict is Verdict.FAILED for i in o.requirements}
    due = {
        "w24": {"PSA2-FRAME-06", "PSA2-INT-04"},
        "w16": {"PSA2-FRAME-06", "PSA2-INT-04"},
        "lab32": {"PSA2-READ-02"},
        "intent": {"PSA2-SETUP-03", "PSA2-SETUP-16"},
    }
    assert due[wrong] <= failed


def test_every_check_has_its_scene() -> None:
    from psabench.conform.plan import plan_of
    from psabench.conform.proves import suite_tests

    known = stimuli("psa2")
    mine = [p.test for p in suite_tests() if any(i.startswith("PSA") for i in p.ids)]
    assert not [t.__name__ for t in mine if not plan_of(t).is_active and plan_of(t).stimulus not in known]
