"""Every board with every shipped profile conforms, by all pins; its report is in build/conform/BOARD-PROFILE."""

from __future__ import annotations

import pytest
from psabench.conform.subject import Addresses
from whole_runs import PROFILES, not_met, reported, untested

pytestmark = pytest.mark.host

NOT_YET = {"PSD1-BUS-13"}  # a known turn: the suite has no table


@pytest.mark.parametrize(("board", "profile"), PROFILES)
def test_a_board_conforms_and_its_report_is_kept(board: str, profile: str) -> None:
    run = reported(board, profile, Addresses())
    assert not_met(run) == []
    assert run.conforms
    assert untested(run) <= NOT_YET
