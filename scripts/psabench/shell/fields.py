"""Fields of the registers, by group: converters "accel" and "temp", registers on the bus of a board under its name.

Converters from their data sheets (SBAS418, SBAS288; what each rests on: docs/sources.md, 1.2 and 2.2), the boards' own
from docs/reference/protocol_psd1.md, protocol_pmka.md and protocol_pik.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Bits:
    """A field: its mask, name, and what its values mean ("": the bare number says it)."""

    mask: int
    name: str
    meaning: Mapping[int, str]
    signed: bool = False

    @property
    def shift(self) -> int:
        return (self.mask & -self.mask).bit_length() - 1

    def of(self, register: int) -> int:
        raw, top = (register & self.mask) >> self.shift, (self.mask >> self.shift) + 1
        return raw - top if self.signed and raw >= top // 2 else raw


def _row(mask: int, name: str, *meaning: str) -> Bits:
    return Bits(mask, name, dict(enumerate(meaning)))


_INPUTS = {**{n: f"AIN{n}" for n in range(8)}, **dict.fromkeys(range(8, 16), "AINCOM")}
_RATES = {
    0xF0: "30000 /s", 0xE0: "15000 /s", 0xD0: "7500 /s", 0xC0: "3750 /s", 0xB0: "2000 /s", 0xA1: "1000 /s",
    0x92: "500 /s", 0x82: "100 /s", 0x72: "60 /s", 0x63: "50 /s", 0x53: "30 /s", 0x43: "25 /s", 0x33: "15 /s",
    0x23: "10 /s", 0x13: "5 /s", 0x03: "2.5 /s",
}  # fmt: skip
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
_INTEGRATORS = ("X", "Y", "Z", "K")
_SIGNS = {0: "none", 1: "positive", 3: "negative"}
_SERVED = ("none", *_AXES)

# By group and register name. A register that is not here is a number.
FIELDS: Mapping[tuple[str, str], tuple[Bits, ...]] = {
    ("accel", "ID"): (_row(0xF0, "ID"),),
    ("accel", "CONFIG0"): (
        _row(0x80, "SYNC", "pulse", "continuous"),
        _row(0x38, "DR", "250 /s", "500 /s", "1000 /s", "2000 /s", "4000 /s"),
        _row(0x04, "PHASE", "linear", "minimum"),
        _row(0x03, "FILTR", "modulator output", "sinc", "sinc + FIR", "sinc + FIR + high-pass"),
    ),
    ("accel", "CONFIG1"): (
        _row(0x70, "MUX", "AIN1", "AIN2", "inputs shorted", "AIN1 + AIN2", "short to AINN2"),
        _row(0x08, "CHOP", "off", "on"),
        _row(0x07, "PGA", *(f"gain {1 << n}" for n in range(7))),
    ),
    ("temp", "STATUS"): (
        _row(0xF0, "ID"),
        _row(0x08, "ORDER", "most significant bit first", "least significant bit first"),
        _row(0x04, "ACAL", "off", "on"),
        _row(0x02, "BUFEN", "off", "on"),
        _row(0x01, "DRDY", "low: data ready", "high"),
    ),
    ("temp", "MUX"): (Bits(0xF0, "PSEL", _INPUTS), Bits(0x0F, "NSEL", _INPUTS)),
    ("temp", "ADCON"): (
        _row(0x60, "CLK", "off", "fCLKIN", "fCLKIN/2", "fCLKIN/4"),
        _row(0x18, "SDCS", "off", "0.5 uA", "2 uA", "10 uA"),
        _row(0x07, "PGA", *(f"gain {1 << min(n, 6)}" for n in range(8))),
    ),
    ("temp", "DRATE"): (Bits(0xFF, "DR", _RATES),),
    ("temp", "IO"): (_row(0xF0, "DIR"), _row(0x0F, "DIO")),
    ("psd1", "STATUS"): (
        _row(0x0001, "FL2", "no word waits", "a word waits"),
        _row(0x0006, "AXIS", *_AXES),
        _row(0x0008, "CYCLE", "none", "runs"),
        _row(0x0010, "INT0", "inactive", "active"),
        _row(0x0020, "FL1", "inactive", "active"),
        _row(0x0040, "DR", "inactive", "active"),
        _row(0x0080, "READY", "not set up", "set up"),
        _row(0x0100, "COMMAND", "none", "runs"),
        _row(0x0200, "COEF", "unknown", "known"),
        _row(0x0400, "OVERRUN", "no", "conversions were lost"),
        _row(0x0800, "LATE", "no", "a strobe came late"),
    ),
    ("psd1", "TEMP"): (_row(0x3000, "CHANNEL", *_AXES, "board"), Bits(0x0FFF, "CODE", {}, signed=True)),
    ("psd1", "SERVICE"): (
        _row(0x3000, "CHANNEL", "supply", "reference", "board temperature", "self-test"),
        _row(0x0FFF, "CODE"),
    ),
    # UC_HIGH, UC_LOW: a control word or, after COMMAND 10h and 20h, a coefficient: a number.
    ("psd1", "COMMAND"): (
        _row(0x8000, "RUNS", "no", "yes"),
        _row(0x4000, "FAILED", "no", "yes"),
        Bits(0x00FF, "LATEST", _COMMANDS),
    ),
    ("psd1", "FLAGS"): (_row(0x0001, "INT0", "inactive", "active"), _row(0x0002, "FL1", "inactive", "active")),
    ("pmka", "RESETS"): tuple(Bits(0x03 << 2 * i, name, _SIGNS) for i, name in enumerate(_INTEGRATORS)),
    ("pmka", "ROTATION"): (
        *(_row(0x03 << 2 * i, f"{name} SERVES", *_SERVED) for i, name in enumerate(_INTEGRATORS)),
        _row(0x0700, "TAU"),
        _row(0x3000, "CAL", "none", "zero", "resets"),
    ),
    ("pmka", "STATUS"): (
        _row(0x01, "READING", "taken", "waits"),
        _row(0x02, "MISSED", "none", "one was not taken"),
        _row(0x04, "SATURATED", "no", "yes"),
        _row(0x08, "CLIPPED", "no", "yes"),
        _row(0x10, "AUTONOMOUS", "no", "yes"),
    ),
    ("pmka", "MODE"): (_row(0x01, "MODE", "program of the computer", "autonomous"),),
    ("pik", "STATUS"): (
        *(_row(0x01 << i, f"SATURATED_{axis}", "no", "could not keep up") for i, axis in enumerate(_AXES)),
        _row(0x08, "NEW", "no", "latched since the last look"),
    ),
}
