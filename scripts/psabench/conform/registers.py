"""Registers of a parallel bus against the table of proto/<board>.yaml: names, rights, what answers where, which object
shows the same."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from psabench.conform.bus_host import line, line_refused, port
from psabench.conform.dut import Dut
from psabench.conform.profile import proto_yaml
from psabench.conform.verdict import Inconclusive, conclusive, expect

NO_ADDRESS, READ_ONLY, WRITE_ONLY = 0x06090011, 0x06010002, 0x06010001  # abort codes (docs/busport.md)
ADDRESSES = 16
LOOKS, TRIES = 4, 40  # readings; to read two doors within one of them, in real time
WORD = 0xFFFF


@cache
def table(board: str) -> tuple[Mapping[str, Any], ...]:
    """Rows of the registers, the address is the number of the row."""
    return tuple(proto_yaml(f"{board}.yaml")["bus"])


def names_and_rights(s: Dut, board: str, *, never: Mapping[str, int], writes: Mapping[str, int]) -> str:
    """Every address read and written; returns what was seen, raises Failed.

    never: registers whose read is rejected now, with its code; writes: what a writable one takes, where 0 will not do.
    """
    rows = table(board)
    who = port(s).who()
    due = {k: str(row["name"]) for k, row in enumerate(rows)}
    expect(dict(who.names) == due, f"names {dict(who.names)}", f"{due}")
    for address, row in enumerate(rows):
        _rights(s, address, row, never, writes)
    for address in (*range(len(rows), ADDRESSES), 0x20):
        line_refused(s, f"R {address:X}", NO_ADDRESS)
        line_refused(s, f"W {address:X} 0", NO_ADDRESS)
    return f"{len(rows)} registers with their names and rights"


def _rights(s: Dut, address: int, row: Mapping[str, Any], never: Mapping[str, int], writes: Mapping[str, int]) -> None:
    name, access = str(row["name"]), str(row.get("access", "rw"))
    if access == "wo":
        line_refused(s, f"R {address:X}", WRITE_ONLY)
    elif name in never:
        line_refused(s, f"R {address:X}", never[name])
    else:
        line(s, f"R {address:X}")
    if access == "ro":
        line_refused(s, f"W {address:X} 0", READ_ONLY)
    else:
        line(s, f"W {address:X} {writes.get(name, 0):X}")


@dataclass(frozen=True, slots=True)
class Door:
    """A register and the object that shows the same."""

    name: str
    address: int
    index: int
    sub: int


def bus_doors(board: str) -> tuple[Door, ...]:
    """The registers of a board beside which its table names an object."""
    return tuple(Door(str(r["name"]), k, *r["object"]) for k, r in enumerate(table(board)) if "object" in r)


def one_value(s: Dut, board: str, next_reading: Callable[[Dut], None], number: int, *, told_apart: bool = True) -> str:
    """Every register beside its object in some readings; returns what was seen, raises Failed.

    next_reading: lets the board make another. number: object whose sub-index 1 numbers readings. told_apart: raises
    Inconclusive where two registers showed the same in all readings, so that no one could tell one from the other.
    """
    seen: dict[str, list[int]] = {}
    for _ in range(LOOKS):
        next_reading(s)
        for door in bus_doors(board):
            seen.setdefault(door.name, []).append(_both(s, door, number))
    alike = [f"{a} and {b}" for a, b in itertools.combinations(seen, 2) if seen[a] == seen[b]]
    conclusive(not (told_apart and alike), f"{', '.join(alike)} showed the same in {LOOKS} readings")
    told = f"; alike: {', '.join(alike)}" if alike else ""
    return f"{len(seen)} registers as their objects in {LOOKS} readings{told}"


def _both(s: Dut, door: Door, number: int) -> int:
    """The word of a register and of its object within one reading."""
    read = s.unit.node.read
    for _ in range(TRIES):
        before, told = int(read(number, 1)), int(read(door.index, door.sub)) & WORD
        word = line(s, f"R {door.address:X}").data
        if int(read(number, 1)) == before:
            due = f"{told:04X}h as in {door.index:04X}h:{door.sub}"
            expect(word == told, f"{word:04X}h in {door.name}", due)
            return word
    raise Inconclusive(f"no reading stood still while {door.name} and its object were read")
