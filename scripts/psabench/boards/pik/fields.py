"""Fields of the registers on the bus (docs/reference/protocol_pik.md)."""

from __future__ import annotations

from collections.abc import Mapping

from psabench.boards.board import Bits, bits

_AXES = ("X", "Y", "Z")

FIELDS: Mapping[tuple[str, str], tuple[Bits, ...]] = {
    ("pik", "STATUS"): (
        *(bits(0x01 << i, f"SATURATED_{axis}", "no", "could not keep up") for i, axis in enumerate(_AXES)),
        bits(0x08, "NEW", "no", "latched since the last look"),
    ),
}
