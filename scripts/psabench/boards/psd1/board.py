"""PSD-1 as the rest of the package knows it."""

from __future__ import annotations

from psabench.boards.board import PARALLEL_BUS, Beat, Board, Bus
from psabench.boards.psd1.fields import FIELDS

BOARD = Board(
    name="psd1",
    device="Psd1",
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
)
