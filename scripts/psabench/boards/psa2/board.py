"""PSA-2 and PSA-1 as the rest of the package knows it."""

from __future__ import annotations

from collections.abc import Mapping

from psabench.boards.board import Beat, Bits, Board, Fields, Setting, bits
from psabench.boards.objects import Psa2Objects
from psabench.boards.session import GREEN, ORANGE, PURPLE, Decoder, Session, Stack

_INPUTS = {**{n: f"AIN{n}" for n in range(8)}, **dict.fromkeys(range(8, 16), "AINCOM")}
_RATES = {
    0xF0: "30000 /s", 0xE0: "15000 /s", 0xD0: "7500 /s", 0xC0: "3750 /s", 0xB0: "2000 /s", 0xA1: "1000 /s",
    0x92: "500 /s", 0x82: "100 /s", 0x72: "60 /s", 0x63: "50 /s", 0x53: "30 /s", 0x43: "25 /s", 0x33: "15 /s",
    0x23: "10 /s", 0x13: "5 /s", 0x03: "2.5 /s",
}  # fmt: skip

# Fields of the converters' registers, from their data sheets (SBAS418, SBAS288; docs/sources.md, 1.2 and 2.2).
FIELDS: Fields = {
    ("accel", "ID"): (bits(0xF0, "ID"),),
    ("accel", "CONFIG0"): (
        bits(0x80, "SYNC", "pulse", "continuous"),
        bits(0x38, "DR", "250 /s", "500 /s", "1000 /s", "2000 /s", "4000 /s"),
        bits(0x04, "PHASE", "linear", "minimum"),
        bits(0x03, "FILTR", "modulator output", "sinc", "sinc + FIR", "sinc + FIR + high-pass"),
    ),
    ("accel", "CONFIG1"): (
        bits(0x70, "MUX", "AIN1", "AIN2", "inputs shorted", "AIN1 + AIN2", "short to AINN2"),
        bits(0x08, "CHOP", "off", "on"),
        bits(0x07, "PGA", *(f"gain {1 << n}" for n in range(7))),
    ),
    ("temp", "STATUS"): (
        bits(0xF0, "ID"),
        bits(0x08, "ORDER", "most significant bit first", "least significant bit first"),
        bits(0x04, "ACAL", "off", "on"),
        bits(0x02, "BUFEN", "off", "on"),
        bits(0x01, "DRDY", "low: data ready", "high"),
    ),
    ("temp", "MUX"): (Bits(0xF0, "PSEL", _INPUTS), Bits(0x0F, "NSEL", _INPUTS)),
    ("temp", "ADCON"): (
        bits(0x60, "CLK", "off", "fCLKIN", "fCLKIN/2", "fCLKIN/4"),
        bits(0x18, "SDCS", "off", "0.5 uA", "2 uA", "10 uA"),
        bits(0x07, "PGA", *(f"gain {1 << min(n, 6)}" for n in range(8))),
    ),
    ("temp", "DRATE"): (Bits(0xFF, "DR", _RATES),),
    ("temp", "IO"): (bits(0xF0, "DIR"), bits(0x0F, "DIO")),
}


def _spi_stack(
    *, miso: str, mosi: str, above: Decoder, options: Mapping[str, str | int], name: str, color: int
) -> Stack:
    """A converter of PSA-2. SClk is for the accelerometer converters while CST is high."""
    lowest = Decoder("spi", options, hidden=(0, 2, 3, 5, 6))
    return Stack(name, color, (lowest, above), {"CLK": "SClk", "MISO": miso, "MOSI": mosi, "CS#": "CST"})


SESSION = Session(
    stacks=(
        Stack("Frame", GREEN, (Decoder("psa2frame", hidden=(0,)),), {"INT": "Int", "DATA": "Data", "CLK": "CLK"}),
        _spi_stack(
            name="Accelerometers",
            color=PURPLE,
            miso="DOutX",
            mosi="DIn",
            options={"cs_polarity": "active-high"},
            above=Decoder("ads128x"),
        ),
        _spi_stack(
            name="Temperature",
            color=ORANGE,
            miso="DOutT",
            mosi="DInT",
            options={"cpha": 1},
            above=Decoder("ads1256"),
        ),
    ),
    from_ns=63_090_000,
    scale="1.5e-07",
    comment="Opens on the set-up after Res; the lines carry the\nnames of the article's table.",
    gtk_from_ns=63_100_000,
    gtk_cursor_ns=63_106_440,
    groups={
        "Reset and synchronisation": "Res SYNC_A SYNC_T",
        "Serial ports of the converters": "DRD_A DRD_T SClk DIn DOutX DOutY DOutZ CST DInT DOutT",
        "To the navigation computer": "Int Data CLK",
    },
)

BOARD = Board(
    name="psa2",
    device="Psa2",
    aliases=("psa1",),
    profile="article",
    lines=tuple("SYNC_A SClk DRD_A DIn DOutX DOutY DOutZ SYNC_T CST DRD_T DInT DOutT Res Data CLK Int".split()),
    port_lines=("Int", "Data", "CLK"),
    wires=("Int_A", "Int_B", "Data_A", "Data_B", "CLK_A", "CLK_B"),
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
    session=SESSION,
)
