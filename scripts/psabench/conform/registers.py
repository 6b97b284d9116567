"""Registers of a parallel bus against the table of proto/<board>.yaml: names, rights, what answers where."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from psabench.conform.bus_host import line, line_refused, port
from psabench.conform.dut import Dut
from psabench.conform.profile import proto_yaml
from psabench.conform.verdict import expect

NO_ADDRESS, READ_ONLY, WRITE_ONLY = 0x06090011, 0x06010002, 0x06010001  # abort codes (docs/busport.md)
ADDRESSES = 16


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
