"""Every profile of PSA-2 and PSD-1 and PSA-1 conform over each link, by what the line port and the bus port show.

The report is in build/conform/BOARD-PROFILE-LINK. What a link cannot carry is not observable.
"""

from __future__ import annotations

import pytest
from psabench.conform.dut import Addresses
from psabench.conform.verdict import Verdict
from rig import ADAPTERS, over
from whole_runs import PROFILES, not_met, reported

ON_LINK = {"socketcand": {"BUS-HB-01", "BUS-ID-08"}, "slcan": {"BUS-ID-04"}, "vcan": {"BUS-ID-04"}}  # not on all
FD = {"PSA2-FORM-03", "PSA2-FORM-04", "PSA2-FORM-05", "PSA2-FORM-08"}
FIRST = (("psa2", "article"), ("psa1", "psa1"), ("psd1", "psd1"))
MINE = {
    "psa2": ["PSA2"],
    "psa1": ["PSA"],
    "psd1": ["PSD1"],
}  # its own requirements; services are the same in each profile


@over("socketcand", "slcan", "vcan")
@pytest.mark.parametrize(("board", "profile"), [p for p in PROFILES if p[0] in MINE])
def test_a_board_conforms_over(transport: str, board: str, profile: str) -> None:
    """In a user-mode kernel, where all takes its time, services are looked at with one profile of each board."""
    services = transport != "vcan" or (board, profile) in FIRST
    at = Addresses(adapter=ADAPTERS[transport], port_only=True)
    run = reported(board, profile, at, transport, () if services else MINE[board])
    assert not_met(run) == []
    assert not run.coverage().count_of(Verdict.INCONCLUSIVE)
    verdicts = run.verdicts()
    passed = {i for i, v in verdicts.items() if v is Verdict.PASSED}
    assert len(passed) >= (90 if services else 30)
    if services:
        assert passed >= ON_LINK[transport]
    if transport != "socketcand":  # which carries no FD frames
        assert passed >= FD & set(verdicts)
