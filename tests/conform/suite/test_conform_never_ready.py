"""A board that never becomes ready: the suite waits for it once, and checks what it shows all the same."""

from __future__ import annotations

import pytest
from psabench.conform import runner, suite
from psabench.conform.dut import Addresses, Dut
from psabench.conform.plan import Stimulus, stimuli
from psabench.conform.profile import variant
from psabench.conform.verdict import Failed, Verdict
from psabench.errors import LinkError
from psabench.procedures.head_bench import Silent

suite.load()


def test_it_is_waited_for_once_and_judged_by_what_it_shows(monkeypatch: pytest.MonkeyPatch) -> None:
    waits = 0

    def never(timeout_s: float = 5.0) -> None:
        nonlocal waits
        waits += 1
        raise LinkError("frames are not settled")

    with Dut.open(variant("psa2"), Addresses(), seed=3) as s:
        monkeypatch.setattr(s.unit, "wait_ready", never)
        found = runner.run(s, Silent(), only=["PSA2-RES-03", "PSA2-CAN-01", "PSA2-CAN-02", "PSA2-FORM-02"])
    by_scene = {o.stimulus: o.verdict for o in found}
    assert waits == 1
    assert by_scene == {"power_on": Verdict.INCONCLUSIVE, "stream": Verdict.PASSED, "forms": Verdict.PASSED}


def test_a_scene_that_shows_a_broken_board_is_played_once(monkeypatch: pytest.MonkeyPatch) -> None:
    played = 0

    def quiet(_: Dut) -> None:
        nonlocal played
        played += 1
        raise Failed("nothing", "something")

    with Dut.open(variant("psa2"), Addresses(), seed=3) as s:
        known = dict(stimuli("psa2")) | {"quiet": Stimulus(name="quiet", boards=("psa2",), make=quiet)}  # type: ignore[arg-type]
        monkeypatch.setattr(runner, "stimuli", lambda _: known)
        found = runner.run(s, Silent(), only=["PSA2-CAN-04", "PSA2-CAN-05"])
    assert played == 1
    assert {o.verdict for o in found if o.stimulus == "quiet"} == {Verdict.FAILED}
