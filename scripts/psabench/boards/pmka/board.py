"""PMKA as the rest of the package knows it."""

from __future__ import annotations

from psabench.boards.board import PARALLEL_BUS, Beat, Bits, Board, Bus, Fields, bits

_AXES = ("X", "Y", "Z")
_INTEGRATORS = ("X", "Y", "Z", "K")
_SIGNS = {0: "none", 1: "positive", 3: "negative"}
_SERVED = ("none", *_AXES)

# Fields of the registers on the bus (docs/reference/protocol_pmka.md).
FIELDS: Fields = {
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

BOARD = Board(
    name="pmka",
    device="Pmka",
    lines=(
        *"KL1 KL2 KL3 KL4 TAU0 TAU1 TAU2 RP1 RN1 RP2 RN2 RP3 RN3 RP4 RN4 SH CONV MUX0 MUX1".split(),
        *PARALLEL_BUS,
    ),
    port_lines=("KL1", "KL2", "KL3", "KL4", "SH", "MUX0", "MUX1"),
    bus=Bus(quiet="MODE", harmless="INDEX", harmless_word=0),
    beat=Beat(rows={"PMKA-SAMP-01": "ts_us"}, line="SH", level=1, message="PMKA_STATE", counter="SEQ"),
    clocks=("ts_ns",),  # a period
    has_thermometer=True,
    fields=FIELDS,
)
