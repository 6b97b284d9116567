"""A class for each board, and which of them is at a node.

from psabench.boards.devices import Psd1   # of boards/psd1/device.py
"""

from __future__ import annotations

from importlib import import_module

from psabench.boards.psa2.device import Psa2
from psabench.boards.psa2.frames import FrameReader
from psabench.boards.readings import ReadingReader
from psabench.boards.registry import BOARDS, of_name
from psabench.boards.unit import NAME, Unit
from psabench.errors import LinkError, expected
from psabench.link.can_host import CanHost
from psabench.link.canopen_host import CanopenNode
from psabench.places import proto_file

NAME_S = 1.0  # bench time for the answer to object 1008h: a unit that is there answers at once


def of_board(board: str) -> type[Unit]:
    """The class of a board as the emulator calls it. Raises ValueError for one that this package does not know."""
    known = of_name(board)
    if known is None:
        raise ValueError(expected(", ".join(BOARDS), repr(board), "board"))
    kind: type[Unit] = getattr(import_module(f"psabench.boards.{known.name}.device"), known.device)
    return kind


def __getattr__(name: str) -> type[Unit]:
    """The class of that name."""
    board = next((b.name for b in BOARDS.values() if b.device == name), None)
    if board is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return of_board(board)


def all_devices() -> dict[str, type[Unit]]:
    """The class of each board."""
    return {board: of_board(board) for board in BOARDS}


def reader_of(board: str, node_id: int) -> FrameReader | ReadingReader:
    """What collects the frames or readings of such a board at a node, without a word to it."""
    kind = of_board(board)
    return FrameReader(node_id) if kind is Psa2 else ReadingReader(kind.layout, node_id)


def identify(host: CanHost, node_id: int) -> type[Unit]:
    """The class of the unit at a node, from its name (object 1008h); PSA-2 where no one answers, or the name is new."""
    try:
        with host.listeners.restored():
            title = str(CanopenNode(host, node_id, proto_file("psa2.eds"), timeout_s=NAME_S).read(NAME))
    except LinkError:
        return Psa2
    return next((kind for kind in all_devices().values() if kind.title == title), Psa2)
