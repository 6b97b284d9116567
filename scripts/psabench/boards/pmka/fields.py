"""Fields of the registers on the bus (docs/reference/protocol_pmka.md)."""

from __future__ import annotations

from collections.abc import Mapping

from psabench.boards.board import Bits, bits

_AXES = ("X", "Y", "Z")
_INTEGRATORS = ("X", "Y", "Z", "K")
_SIGNS = {0: "none", 1: "positive", 3: "negative"}
_SERVED = ("none", *_AXES)

FIELDS: Mapping[tuple[str, str], tuple[Bits, ...]] = {
    ("pmka", "RESETS"): tuple(Bits(0x03 << 2 * i, name, _SIGNS) for i, name in enumerate(_INTEGRATORS)),
    ("pmka", "ROTATION"): (
        *(bits(0x03 << 2 * i, f"{name} SERVES", *_SERVED) for i, name in enumerate(_INTEGRATORS)),
        bits(0x0700, "TAU"),
        bits(0x3000, "CAL", "none", "zero", "resets"),
    ),
    ("pmka", "STATUS"): (
        bits(0x01, "READING", "taken", "waits"),
        bits(0x02, "MISSED", "none", "one was not taken"),
        bits(0x04, "SATURATED", "no", "yes"),
        bits(0x08, "CLIPPED", "no", "yes"),
        bits(0x10, "AUTONOMOUS", "no", "yes"),
    ),
    ("pmka", "MODE"): (bits(0x01, "MODE", "program of the computer", "autonomous"),),
}
