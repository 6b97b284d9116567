"""PSD-1 as the rest of the package knows it."""

from __future__ import annotations

from psabench.boards.board import PARALLEL_BUS, Beat, Bits, Board, Bus, Fields, bits
from psabench.boards.session import GREEN, Decoder, Session, Stack

_AXES = ("X", "Y", "Z")
_COMMANDS = {
    0: "none",
    1: "send as UC1",
    2: "send as UC2",
    3: "show UC1",
    4: "show UC2",
    **{
        code + i: f"{what} {axis}"
        for code, what in ((0x10, "zero coefficient"), (0x20, "full-scale coefficient"), (0x30, "control word"))
        for i, axis in enumerate(_AXES)
    },
}

# Fields of the registers on the bus (docs/reference/protocol_psd1.md).
FIELDS: Fields = {
    ("psd1", "STATUS"): (
        bits(0x0001, "FL2", "no word waits", "a word waits"),
        bits(0x0006, "AXIS", *_AXES),
        bits(0x0008, "CYCLE", "none", "runs"),
        bits(0x0010, "INT0", "inactive", "active"),
        bits(0x0020, "FL1", "inactive", "active"),
        bits(0x0040, "DR", "inactive", "active"),
        bits(0x0080, "READY", "not set up", "set up"),
        bits(0x0100, "COMMAND", "none", "runs"),
        bits(0x0200, "COEF", "unknown", "known"),
        bits(0x0400, "OVERRUN", "no", "conversions were lost"),
        bits(0x0800, "LATE", "no", "a strobe came late"),
    ),
    ("psd1", "TEMP"): (bits(0x3000, "CHANNEL", *_AXES, "board"), Bits(0x0FFF, "CODE", {}, signed=True)),
    ("psd1", "SERVICE"): (
        bits(0x3000, "CHANNEL", "supply", "reference", "board temperature", "self-test"),
        bits(0x0FFF, "CODE"),
    ),
    # UC_HIGH, UC_LOW: a control word or, after COMMAND 10h and 20h, a coefficient: a number.
    ("psd1", "COMMAND"): (
        bits(0x8000, "RUNS", "no", "yes"),
        bits(0x4000, "FAILED", "no", "yes"),
        Bits(0x00FF, "LATEST", _COMMANDS),
    ),
    ("psd1", "FLAGS"): (bits(0x0001, "INT0", "inactive", "active"), bits(0x0002, "FL1", "inactive", "active")),
}

_CYCLE_LINES = ("A0", "RFX", "RFY", "RFZ", "SCLK", "SDAT", "FL2", *PARALLEL_BUS)

SESSION = Session(
    stacks=(Stack("Cycle", GREEN, (Decoder("psd1cycle", hidden=(0,)),), {line: line for line in _CYCLE_LINES}),),
    from_ns=9_880_000,
    scale="5e-08",
    comment="Opens on the second cycle of reading; the lines carry\nthe names of the article.",
    gtk_from_ns=9_880_000,
    gtk_cursor_ns=9_882_400,
    gtk_height=860,
    groups={
        "Conditions of a cycle": "CLK_1M25 INT0 FL1 DR",
        "Converters": "A0 RFX RFY RFZ TFS SCLK SDAT",
        "To the navigation computer": "FL2 *",
    },
)

BOARD = Board(
    name="psd1",
    device="Psd1",
    schedule_s=1.5,
    lines=(*"A0 INT0 FL1 FL2 DR RFX RFY RFZ TFS SCLK SDAT CLK_1M25".split(), *PARALLEL_BUS),
    port_lines=("RFX", "RFY", "RFZ", "SCLK", "SDAT", "FL2", "CS"),
    bus=Bus(quiet="STATUS", harmless="TEMP", harmless_word=0),
    beat=Beat(
        rows={"PSD1-CYC-12": "period_us", "PSD1-CYC-13": "period_us"},
        line="RFX",
        level=0,
        message="PSD1_CYCLE",
        counter="CNT",
    ),
    clocks=("adc_clkin_hz",),
    clock_at_limit=True,
    on_table=True,
    fields=FIELDS,
    session=SESSION,
)
