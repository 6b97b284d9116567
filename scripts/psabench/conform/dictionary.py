"""A board's own objects against its EDS: length, value after Res, write access (docs/reference/protocol*.md)."""

from __future__ import annotations

import struct
from collections.abc import Container
from typing import Any

from psabench.boards.objects import Area, BusObjects, Common
from psabench.conform.bus_host import refused
from psabench.conform.dut import Dut
from psabench.conform.requirements import requirements
from psabench.conform.verdict import Failed, expect
from psabench.link.canopen_host import Described

OWN, BUS, READ_ONLY = (
    range(Area.MANUFACTURER, Area.PROFILE),
    BusObjects.BUS,
    0x06010002,
)  # BUS: cycles of the parallel bus, with rows of their own
REAL_FORMATS = {4: "<f", 8: "<d"}


def as_the_dictionary_says(s: Dut, eds: str, varies: Container[int] = ()) -> str:
    """Every object of the board's own; returns what was seen, raises Failed. Just after Res.

    varies: objects whose default is that of one profile.
    """
    beyond = int(requirements()["BUS-SDO-13"].limit("abort_code"))
    objects = [o for o in s.unit.node.objects() if o.index in OWN and o.index != BUS]
    for o in objects:
        what = f"{o.index:04X}h:{o.sub} ({o.name})"
        if o.access == "wo":
            continue
        data = s.unit.node.read_raw(o.index, o.sub)
        expect(o.data_bytes is None or len(data) == o.data_bytes, f"{what} has {len(data)} bytes", f"{o.data_bytes}")
        due = None if o.index in varies else _default(o)
        if due is not None and data != due:
            raise Failed(f"{what} is {data.hex(' ')} after Res", due.hex(" "))
    for o in objects:
        what = f"{o.index:04X}h:{o.sub} ({o.name})"
        if o.access in ("ro", "const"):
            same = bytes(o.data_bytes or 1)
            refused(lambda o=o, d=same: s.unit.node.write_raw(o.index, o.sub, d), READ_ONLY, f"a write to {what}")  # type: ignore[misc]
        elif (data_beyond := _beyond(o)) is not None:
            refused(lambda o=o, d=data_beyond: s.unit.node.write_raw(o.index, o.sub, d), beyond, f"too much to {what}")  # type: ignore[misc]
    return f"{len(objects)} objects of {eds}.eds"


def identity(s: Dut, requirement: str, name: str) -> str:
    """Device name (1008h) and product code (1018h sub 2) against a requirement's limit; raises Failed."""
    saw, code = s.unit.node.read(Common.DEVICE_NAME), int(s.unit.node.read(Common.IDENTITY, 2))
    due = int(requirements()[requirement].limit("product_code"))
    return expect((saw, code) == (name, due), f"{saw}, {code:08X}h", f"{name}, {due:08X}h")


def _default(o: Described) -> bytes | None:
    """Bytes of what it holds after Res; None: the EDS cannot know it."""
    if o.access == "ro" or o.default is None or o.data_bytes is None:
        return None
    return encoded(o, o.default)


def encoded(o: Described, value: Any) -> bytes:
    """A value of this object as its bytes."""
    if isinstance(value, str):
        return value.encode()
    size = o.data_bytes or 0
    if o.real:
        return struct.pack(REAL_FORMATS[size], value)
    return (int(value) & (1 << 8 * size) - 1).to_bytes(size, "little")


def _beyond(o: Described) -> bytes | None:
    """More than its high limit; None: it has none, or its bytes hold no more."""
    if o.high is None or o.data_bytes is None:
        return None
    if o.real:
        return encoded(o, float(o.high) + max(1.0, abs(float(o.high))))
    signed = o.low is not None and int(o.low) < 0
    most = (1 << 8 * o.data_bytes - signed) - 1
    return encoded(o, int(o.high) + 1) if int(o.high) < most else None
