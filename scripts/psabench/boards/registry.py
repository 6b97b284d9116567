"""A class for each board, and which of them is at a node."""

from __future__ import annotations

from collections.abc import Mapping

from psabench.board_names import ALIASES
from psabench.boards.gyro.device import Gyro
from psabench.boards.pik.device import Pik
from psabench.boards.pmka.device import Pmka
from psabench.boards.psa2.device import Psa2
from psabench.boards.psa2.frames import FrameReader
from psabench.boards.psd1.device import Psd1
from psabench.boards.readings import ReadingReader
from psabench.boards.unit import NAME, Unit
from psabench.errors import LinkError
from psabench.link.can_host import CanHost
from psabench.link.canopen_host import CanopenNode
from psabench.places import proto_file

__all__ = ["BOARDS", "Gyro", "Pik", "Pmka", "Psa2", "Psd1", "identify", "of_board", "reader_of"]

BOARDS: Mapping[str, type[Unit]] = {"psa2": Psa2, "psd1": Psd1, "pmka": Pmka, "pik": Pik, "gyro": Gyro}
NAME_S = 1.0  # bench time for the answer to object 1008h: a unit that is there answers at once


def of_board(board: str) -> type[Unit]:
    """The class of a board as the emulator calls it. Raises ValueError for one that this package does not know."""
    known = BOARDS.get(ALIASES.get(board, board))
    if known is None:
        raise ValueError(f"no such board: {board}; there are {', '.join(BOARDS)}")
    return known


def reader_of(board: str, node_id: int) -> FrameReader | ReadingReader:
    """What collects the frames or readings of such a board at a node, without a word to it."""
    kind = of_board(board)
    return FrameReader(node_id) if kind is Psa2 else ReadingReader(kind.layout, node_id)


def identify(host: CanHost, node_id: int) -> type[Unit]:
    """The class of the unit at a node, from its name (object 1008h); PSA-2 where no one answers, or the name is new."""
    listeners = list(host.listeners)
    try:
        title = str(CanopenNode(host, node_id, proto_file("psa2.eds"), patience_s=NAME_S).read(NAME))
    except LinkError:
        return Psa2
    finally:
        host.listeners[:] = listeners
    return next((kind for kind in BOARDS.values() if kind.title == title), Psa2)
