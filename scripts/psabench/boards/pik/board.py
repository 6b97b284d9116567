"""PIK, PIK-5 and PIK-6 as the rest of the package knows it."""

from __future__ import annotations

from psabench.boards.board import PARALLEL_BUS, Board, Bus, Fields, bits
from psabench.boards.session import GREEN, ORANGE, Decoder, Session, Stack, bus_stack, period_stack

_AXES = ("X", "Y", "Z")

# Fields of the registers on the bus (docs/reference/protocol_pik.md).
FIELDS: Fields = {
    ("pik", "STATUS"): (
        *(bits(0x01 << i, f"SATURATED_{axis}", "no", "could not keep up") for i, axis in enumerate(_AXES)),
        bits(0x08, "NEW", "no", "latched since the last look"),
    ),
}

_PULSES = ("FXP", "FXN", "FYP", "FYN", "FZP", "FZN")

SESSION = Session(
    stacks=(
        *(
            Stack(
                f"Count {line}",
                GREEN,
                (Decoder("counter", {"data_edge": "rising"}, hidden=(1, 2)),),
                {"Data": line, "Reset": "LATCH"},
            )
            for line in _PULSES
        ),
        period_stack("Latch", ORANGE, "LATCH"),
        bus_stack(PARALLEL_BUS),
    ),
    from_ns=9_500_000,
    scale="2e-05",
    trace_height=6,
    comment="Opens on the first latch of the counters; the lines\ncarry the names of docs/boards/pik.md.",
    gtk_from_ns=9_500_000,
    gtk_cursor_ns=10_000_000,
    gtk_height=860,
    groups={"Resets": f"CLK {' '.join(_PULSES)}", "Counters": "LATCH", "Parallel bus": "*"},
)

BOARD = Board(
    name="pik",
    device="Pik",
    schedule_s=1.5,
    aliases=("pik5", "pik6"),
    lines=(*"CLK LATCH FXP FXN FYP FYN FZP FZN".split(), *PARALLEL_BUS),
    port_lines=("FXP", "FXN", "FYP", "FYN", "FZP", "FZN", "LATCH"),
    bus=Bus(quiet="PERIOD", harmless="PERIOD", harmless_word=None),
    crystal="clock_tol_ppm",  # its clock is whole Hz: a profile cannot say an error of it
    overdrive_v_per_g=9.0,
    fields=FIELDS,
    session=SESSION,
)
