"""Registers of the converters with their fields named.

Names and addresses come from the EDS, fields from the data sheets (SBAS418, SBAS288; what each rests on:
docs/sources.md, 1.2 and 2.2).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from psabench.shell.words import Wrong


@dataclass(frozen=True, slots=True)
class Bits:
    """A field: its mask, name, and what its values mean ("": the bare number says it)."""

    mask: int
    name: str
    meaning: Mapping[int, str]

    @property
    def shift(self) -> int:
        return (self.mask & -self.mask).bit_length() - 1

    def of(self, register: int) -> int:
        return (register & self.mask) >> self.shift


def _row(mask: int, name: str, *meaning: str) -> Bits:
    return Bits(mask, name, dict(enumerate(meaning)))


_INPUTS = {**{n: f"AIN{n}" for n in range(8)}, **dict.fromkeys(range(8, 16), "AINCOM")}
_RATES = {
    0xF0: "30000 /s", 0xE0: "15000 /s", 0xD0: "7500 /s", 0xC0: "3750 /s", 0xB0: "2000 /s", 0xA1: "1000 /s",
    0x92: "500 /s", 0x82: "100 /s", 0x72: "60 /s", 0x63: "50 /s", 0x53: "30 /s", 0x43: "25 /s", 0x33: "15 /s",
    0x23: "10 /s", 0x13: "5 /s", 0x03: "2.5 /s",
}  # fmt: skip
# By converter group and register name. A register that is not here is a number.
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
}


def group(converter: str) -> str:
    """ "accel" of converters x, y, z, "temp" of t."""
    return "temp" if converter == "t" else "accel"


def explain(converter: str, name: str, value: int) -> str:
    """`SYNC 0 pulse, DR 2 1000 /s, ...`; "" for a register that is a plain number."""
    parts = []
    for bits in FIELDS.get((group(converter), name), ()):
        field = bits.of(value)
        fallback = "reserved" if bits.meaning else ""
        shown = f"{field:02X}h" if bits.mask == 0xFF else str(field)
        parts.append(" ".join(x for x in (bits.name, shown, bits.meaning.get(field, fallback)) if x))
    return ", ".join(parts)


def changed(converter: str, name: str, value: int, text: str) -> int:
    """The register's value after `text`: a number (56h, 0x56, 86), or fields of it (`DR=3,PHASE=0`). Raises Wrong."""
    for part in text.split(","):
        field, equals, digits = part.partition("=")
        if not equals:
            return _byte(name, text)
        rows = {b.name: b for b in FIELDS.get((group(converter), name), ())}
        bits = rows.get(field)
        if bits is None:
            raise Wrong(f"{name} has no field {field}; it has {', '.join(rows) or 'none: write the whole byte'}")
        n = number(digits)
        if n is None or n > bits.mask >> bits.shift:
            raise Wrong(f"{name}.{field}: {digits!r}; 0 to {bits.mask >> bits.shift} is right")
        value = (value & ~bits.mask) | (n << bits.shift)
    return value


def _byte(name: str, text: str) -> int:
    n = number(text)
    if n is None or n > 0xFF:
        raise Wrong(f"{name}: {text!r}; a byte is wanted (56h, 0x56, 86), or fields (DR=3,PHASE=0)")
    return n


def word(name: str, text: str) -> int:
    """A word for a register on a bus: a number up to FFFFh. Raises Wrong."""
    n = number(text)
    if n is None or n > 0xFFFF:
        raise Wrong(f"{name}: {text!r}; a word is wanted (A55Ah, 0xA55A, 42330)")
    return n


def number(text: str) -> int | None:
    """A whole number as the shell's lines have it: 56h, 0x56, 86. None: it is none."""
    if m := re.fullmatch(r"0x([0-9A-Fa-f]+)|([0-9A-Fa-f]+)h", text):
        return int(m[1] or m[2], 16)
    return int(text) if text.isdecimal() else None
