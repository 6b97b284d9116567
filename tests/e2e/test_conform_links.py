"""The device suite over each link: services on CAN, cycles, ports; what a link cannot carry is not observable."""

from __future__ import annotations

import pytest
from psabench.conform import runner, suite
from psabench.conform.outcome import Outcome, Verdict
from psabench.conform.subject import Addresses, Subject
from psabench.conform.variant import variant
from psabench.progress import Bar
from rig import ADAPTERS, over

GROUPS = ("BUS-", "LINE-")
OPEN = (Verdict.FAILED, Verdict.INCONCLUSIVE)
ON_LINK = {"socketcand": {"BUS-HB-01", "BUS-ID-08"}, "slcan": {"BUS-ID-04"}, "vcan": {"BUS-ID-04"}}  # not on all


@over("socketcand", "slcan", "vcan")
@pytest.mark.parametrize("board", ["psa2", "psd1"])
def test_a_board_conforms_over(transport: str, board: str) -> None:
    suite.load()
    v = variant(board)
    outcomes: list[Outcome] = []
    with Subject.open(v, Addresses(adapter=ADAPTERS[transport], port_only=True)) as s:
        runner.run(s, Bar(), only=GROUPS, told=outcomes.append)
    bad = [f"{o.test}: {o.saw or o.reason}; due {o.due}" for o in outcomes if o.verdict in OPEN]
    assert bad == []
    passed = {i for o in outcomes if o.verdict is Verdict.PASSED for i in o.requirements}
    assert len(passed) >= 60
    assert passed >= ON_LINK[transport]
