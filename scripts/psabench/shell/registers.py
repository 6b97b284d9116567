"""Registers with their fields named, read and written. Names and addresses: the EDS; fields: the boards."""

from __future__ import annotations

import re

from psabench.boards.board import Fields
from psabench.boards.registry import BOARDS
from psabench.errors import expected
from psabench.shell.lexer import Wrong

# A register that is not here is a number.
FIELDS: Fields = {key: fields for board in BOARDS.values() for key, fields in board.fields.items()}


def group(converter: str) -> str:
    """ "accel" of converters x, y, z, "temp" of t; a board's name, for its bus, is its own group."""
    return {"t": "temp", "x": "accel", "y": "accel", "z": "accel"}.get(converter, converter)


def explain(converter: str, name: str, value: int) -> str:
    """`SYNC 0 pulse, DR 2 1000 /s, ...`; "" for a register that is a plain number.

    converter: x, y, z, t; of a register on a bus the board, as "psd1".
    """
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
            return word(name, text, 0xFF, "a byte (56h, 0x56, 86) or fields (DR=3,PHASE=0)")
        rows = {b.name: b for b in FIELDS.get((group(converter), name), ())}
        bits = rows.get(field)
        if bits is None:
            raise Wrong(expected(", ".join(rows) or "the whole byte: it has no fields", field, f"field of {name}"))
        n = number(digits)
        if n is None or n > bits.mask >> bits.shift:
            raise Wrong(expected(f"0 to {bits.mask >> bits.shift}", repr(digits), f"{name}.{field}"))
        value = (value & ~bits.mask) | (n << bits.shift)
    return value


def word(name: str, text: str, most: int = 0xFFFF, what: str = "a word (A55Ah, 0xA55A, 42330)") -> int:
    """What a register is to hold: a number up to that of a register on a bus. Raises Wrong."""
    n = number(text)
    if n is None or n > most:
        raise Wrong(expected(what, repr(text), name))
    return n


def number(text: str) -> int | None:
    """A whole number as the shell's lines have it: 56h, 0x56, 86. None: it is none."""
    if m := re.fullmatch(r"0x([0-9A-Fa-f]+)|([0-9A-Fa-f]+)h", text):
        return int(m[1] or m[2], 16)
    return int(text) if text.isdecimal() else None
