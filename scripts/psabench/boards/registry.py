"""The boards that there are. Loads no library: a board's class is loaded when it is asked for (`devices`)."""

from __future__ import annotations

from collections.abc import Mapping

from psabench.boards.bins.board import BOARD as BINS
from psabench.boards.board import Board
from psabench.boards.gyro.board import BOARD as GYRO
from psabench.boards.pik.board import BOARD as PIK
from psabench.boards.pmka.board import BOARD as PMKA
from psabench.boards.psa2.board import BOARD as PSA2
from psabench.boards.psd1.board import BOARD as PSD1
from psabench.boards.receiver.board import BOARD as RECEIVER

BOARDS: Mapping[str, Board] = {board.name: board for board in (PSA2, PSD1, PMKA, PIK, GYRO, BINS, RECEIVER)}
ALIASES: Mapping[str, str] = {alias: board.name for board in BOARDS.values() for alias in board.aliases}
NAMES = (*BOARDS, *ALIASES)
BUS_BOARDS = tuple(name for name, board in BOARDS.items() if board.bus)  # boards with a parallel bus
PLAYED = tuple(name for name in NAMES if BOARDS[ALIASES.get(name, name)].has_inputs)  # to a host under test
DBC_NODE = 5  # node of PSA-2's identifiers in the DBC; those of node n are n - 5 higher


def of_name(name: str) -> Board | None:
    """The board that a user calls so; None: there is none."""
    return BOARDS.get(ALIASES.get(name, name))
