"""PSA-2 and PSA-1 as the rest of the package knows it."""

from __future__ import annotations

from psabench.boards.board import Beat, Board, Setting
from psabench.boards.objects import Psa2Objects
from psabench.boards.psa2.fields import FIELDS

BOARD = Board(
    name="psa2",
    device="Psa2",
    aliases=("psa1",),
    profile="article",
    lines=tuple("SYNC_A SClk DRD_A DIn DOutX DOutY DOutZ SYNC_T CST DRD_T DInT DOutT Res Data CLK Int".split()),
    port_lines=("Int", "Data", "CLK"),
    beat=Beat(
        rows={"PSA2-READ-06": "period_us"},
        line="Int",
        level=0,
        message="PSA2_XY",
        counter="SEQ",
        stamp=("PSA2_ZT", "TSTAMP"),
    ),
    clocks=("fclk_hz", "temp_clkin_hz", "sclk_hz", "line_hz"),
    has_thermometer=True,
    setting=Setting(index=Psa2Objects.SAMPLE_NTH, sub=0, value=bytes([3, 0])),
    fields=FIELDS,
)
