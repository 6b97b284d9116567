"""Every board with every shipped profile conforms, by all pins; its report is in build/conform/BOARD-PROFILE."""

from __future__ import annotations

import pytest
from psabench.conform.coverage import Result
from psabench.conform.dut import Addresses
from psabench.conform.verdict import Verdict
from whole_runs import PROFILES, not_met, reported, untested

pytestmark = pytest.mark.host

NO_FD = {
    "PSA2-FORM-03",
    "PSA2-FORM-04",
    "PSA2-FORM-05",
    "PSA2-FORM-08",
}  # socketcand carries none: test_conform_links.py
HOST_LESS = {"psd1_host"}  # sends readings only while a host reads its bus, which the suite then leaves alone


@pytest.mark.parametrize(("board", "profile"), PROFILES)
def test_a_board_conforms_and_its_report_is_kept(board: str, profile: str) -> None:
    """Every requirement of its own that anybody can see is seen and met."""
    run = reported(board, profile, Addresses())
    assert not_met(run) == []
    assert run.coverage().result is (Result.NO_VIOLATION if profile in HOST_LESS else Result.CONFORMS)
    assert untested(run) == set()
    verdicts = run.verdicts()
    own = {r.id for r in run.rows if r.group not in ("bus", "lineport") and not r.unobservable}
    assert {i for i in own - NO_FD if verdicts[i] is not Verdict.PASSED} == set()
