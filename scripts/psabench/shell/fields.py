"""Fields of the registers of all boards: groups "accel" and "temp" (converters), a board's name (its bus)."""

from __future__ import annotations

from collections.abc import Mapping

from psabench.boards.board import Bits
from psabench.boards.registry import BOARDS

# By group and register name. A register that is not here is a number.
FIELDS: Mapping[tuple[str, str], tuple[Bits, ...]] = {
    key: fields for board in BOARDS.values() for key, fields in board.fields.items()
}
