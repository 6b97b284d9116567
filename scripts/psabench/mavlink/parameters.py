"""Parameters of a MAVLink system: names, values as MAVLink carries them, and what a PARAM_SET comes to. No I/O.

As the emulator's own link: numbers of at most 24 bits travel as REAL32, 32-bit integers bytewise.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass

from psabench.errors import expected

NAME_MAX = 16
U32, I32, R32 = 5, 6, 9  # MAV_PARAM_TYPE
_LAYOUT = {U32: "<I", I32: "<i"}


@dataclass(slots=True, kw_only=True)
class Parameter:
    """One parameter. `value` is the latest that is known; read and write go to where it is, if they are given."""

    name: str
    value: float = math.nan
    kind: int = R32
    integer: bool = False
    low: float = -math.inf
    high: float = math.inf
    read: Callable[[], float] | None = None
    write: Callable[[float], None] | None = None  # None: read-only

    def wire(self) -> float:
        """`param_value` of PARAM_VALUE: the four bytes as a float."""
        if self.kind == R32:
            return struct.unpack("<f", struct.pack("<f", self.value))[0]  # type: ignore[no-any-return]
        whole = 0 if math.isnan(self.value) else int(self.value)
        return struct.unpack("<f", struct.pack(_LAYOUT[self.kind], whole))[0]  # type: ignore[no-any-return]

    def check(self, kind: int, wire: float) -> float:
        """The value of a PARAM_SET. Raises ValueError with what would be right."""
        if self.write is None:
            raise ValueError(expected("a parameter that may be written", "a read-only one"))
        if kind == R32:
            value = wire
        elif kind in _LAYOUT:
            value = float(struct.unpack(_LAYOUT[kind], struct.pack("<f", wire))[0])
        else:
            raise ValueError(expected("type REAL32, INT32 or UINT32", kind))
        what = "an integer" if self.integer else "a number"
        whole = not self.integer or (math.isfinite(value) and value == int(value))
        if not (math.isfinite(value) and whole and self.low <= value <= self.high):
            raise ValueError(expected(f"{what} from {self.low:.9g} to {self.high:.9g}", f"{value:.9g}"))
        return value


class Parameters:
    """All of a system, in the order in which they were added: that is their index."""

    def __init__(self) -> None:
        self._all: list[Parameter] = []
        self._by_name: dict[str, int] = {}

    def __len__(self) -> int:
        return len(self._all)

    def __getitem__(self, index: int) -> Parameter:
        return self._all[index]

    def add(self, p: Parameter) -> int:
        """Its index; one of that name is replaced. Raises ValueError for a name that is too long."""
        if not 0 < len(p.name) <= NAME_MAX:
            raise ValueError(expected(f"1 to {NAME_MAX} characters", repr(p.name), "parameter"))
        index = self._by_name.setdefault(p.name, len(self._all))
        self._all[index:] = [p, *self._all[index + 1 :]]
        return index

    def find(self, name: str, index: int = -1) -> int | None:
        """Index of a parameter by its index (if it is not negative) or its name."""
        if index >= 0:
            return index if index < len(self._all) else None
        return self._by_name.get(name)

    def named(self, name: str) -> Parameter:
        return self._all[self._by_name[name]]
