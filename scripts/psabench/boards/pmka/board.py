"""PMKA as the rest of the package knows it."""

from __future__ import annotations

from psabench.boards.board import PARALLEL_BUS, Beat, Board, Bus
from psabench.boards.pmka.fields import FIELDS

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
