"""Which tests a board is asked: those of its requirements, on stimuli that it has."""

from __future__ import annotations

import pytest
from psabench.conform import runner, suite
from psabench.conform.capture.log import Capture
from psabench.conform.plan import check, plan_of, stimuli
from psabench.conform.profile import variant
from psabench.conform.proves import SuiteTest
from psabench.conform.requirements import requirements

suite.load()
WITHOUT_SCENE = {"errors", "slow"}  # ways of stimulus that no bench has yet


@check("there")
def everywhere(e: Capture) -> str:
    """Look."""
    return ""


@check("there", boards=("psa2",))
def on_psa2(e: Capture) -> str:
    """Look at a PSA-2."""
    return ""


def test_a_check_is_asked_of_its_boards_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    suite_tests = (SuiteTest(everywhere, ("BUS-EMCY-04",)), SuiteTest(on_psa2, ("BUS-EMCY-04",)))
    monkeypatch.setattr(runner, "suite_tests", lambda: suite_tests)
    asked = {b: [p.test for p, _ in runner.wanted(variant(b))] for b in ("psa2", "psa1", "pik6")}
    assert asked == {"psa2": [everywhere, on_psa2], "psa1": [everywhere, on_psa2], "pik6": [everywhere]}


@pytest.mark.parametrize(("profile", "board"), requirements().profiles.items())
def test_every_check_has_its_scene(profile: str, board: str) -> None:
    v = variant(board, profile)
    plans = {p.test.__name__: plan_of(p.test) for p, _ in runner.wanted(v)}
    lack = {n for n, p in plans.items() if not p.is_active and p.stimulus not in stimuli(v.family)}
    assert {n for n in lack if not plans[n].needs & WITHOUT_SCENE} == set()
