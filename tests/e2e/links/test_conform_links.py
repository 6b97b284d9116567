"""PSA-2, PSA-1 and PSD-1 conform over each link, by what the line port and the bus port show.

What a profile changes is of the board, not of the link: every profile is in test_conform_reports.py, over socketcand.
The report is in build/conform/BOARD-PROFILE-LINK. What a link cannot carry is not observable.
"""

from __future__ import annotations

import pytest
from psabench.conform.dut import Addresses
from psabench.conform.verdict import Verdict
from rig import ADAPTERS, over
from whole_runs import not_met, reported

ON_LINK = {"socketcand": {"BUS-HB-01", "BUS-ID-08"}, "slcan": {"BUS-ID-04"}, "vcan": {"BUS-ID-04"}}  # not on all
FD = {"PSA2-FORM-03", "PSA2-FORM-04", "PSA2-FORM-05", "PSA2-FORM-08"}
BOARDS = (("psa2", "article"), ("psa1", "psa1"), ("psd1", "psd1"))


@over("socketcand", "slcan", "vcan")
@pytest.mark.parametrize(("board", "profile"), BOARDS)
def test_a_board_conforms_over(transport: str, board: str, profile: str) -> None:
    at = Addresses(adapter=ADAPTERS[transport], port_only=True)
    run = reported(board, profile, at, transport)
    assert not_met(run) == []
    assert not run.coverage().count_of(Verdict.INCONCLUSIVE)
    verdicts = run.verdicts()
    passed = {i for i, v in verdicts.items() if v is Verdict.PASSED}
    assert len(passed) >= 90
    assert passed >= ON_LINK[transport]
    if transport != "socketcand":  # which carries no FD frames
        assert passed >= FD & set(verdicts)
