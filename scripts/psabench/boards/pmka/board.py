"""PMKA as the rest of the package knows it."""

from __future__ import annotations

from psabench.boards.board import PARALLEL_BUS, Beat, Bits, Board, Bus, Fields, bits
from psabench.boards.session import GREEN, Session, bus_stack, period_stack

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

SESSION = Session(
    stacks=(period_stack("Samples", GREEN, "SH"), bus_stack(PARALLEL_BUS)),
    from_ns=9_500_000,
    scale="2e-05",
    comment="Opens on the first periods; the lines carry\nthe names of docs/boards/pmka.md.",
    gtk_from_ns=9_500_000,
    gtk_cursor_ns=10_000_000,
    gtk_height=1000,
    groups={
        "Keys and beat": "KL1 KL2 KL3 KL4 TAU0 TAU1 TAU2",
        "Precision resets": "RP1 RN1 RP2 RN2 RP3 RN3 RP4 RN4",
        "Sample and conversion": "SH CONV MUX0 MUX1",
        "Parallel bus": "*",
    },
)

BOARD = Board(
    name="pmka",
    device="Pmka",
    schedule_s=8.0,
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
    session=SESSION,
)
